"""The leaderboard: which controllers run on which recordings, and what is made of their episodes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from socialnav_mj.controllers import with_policy_of, with_training
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.recordings import load_recording
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.studies.files import write_csv, write_pages, write_provenance
from socialnav_mj.studies.held_out import recording_name
from socialnav_mj.studies.leaderboard.board import Board, board_of
from socialnav_mj.studies.leaderboard.families import compare, families_of, there
from socialnav_mj.studies.leaderboard.figure import draw_fronts
from socialnav_mj.studies.leaderboard.page import figure_of, leaderboard_page
from socialnav_mj.studies.leaderboard.row_origins import origins_of
from socialnav_mj.studies.panel import Entry
from socialnav_mj.studies.settings import DEFAULT, SETTINGS
from socialnav_mj.studies.study import Run, SideBySide, read_runs


@dataclass(frozen=True, kw_only=True)
class Leaderboard(SideBySide):
    """What is to be run; the other settings have `other_draws`."""

    trainings: int = 3
    """Of each controller that learned and has as many, those with the least seeds; others stand with one."""
    settings: tuple[str, ...] = ()
    """Other settings in which the first recording is run, of `SETTINGS`."""
    setting_controllers: tuple[str, ...] = ()
    """Those of `controllers` that run in these; all if there are none."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if unknown := [name for name in self.settings if name not in SETTINGS]:
            raise ValueError(f"unknown setting {unknown[0]!r}; available: {', '.join(SETTINGS)}")
        if self.trainings < 1:
            raise ValueError(f"trainings = {self.trainings} is not allowed; allowed: integers >= 1")
        if unknown := [spec for spec in self.setting_controllers if spec not in self.controllers]:
            raise ValueError(
                f"setting_controllers has {unknown[0]!r}; allowed: the controllers, {', '.join(self.controllers)}"
            )
        if len(set(self.setting_controllers)) != len(self.setting_controllers) or len(self.setting_controllers) == 1:
            given = self.setting_controllers
            raise ValueError(f"setting_controllers = {given} is not allowed; allowed: none, or two or more, each once")

    def roster(self, recording: str, setting: str = DEFAULT) -> tuple[Entry, ...]:
        """Who runs on a recording.

        Args:
            recording: One of `recordings`.
            setting: Of `SETTINGS`.

        Returns:
            Each controller under its spec as it was given; of one that learned, with the policies of the recording and
            the setting's turn limit, an entry for each of the first trainings, if there are as many as are asked for.
        """
        entries: list[Entry] = []
        for spec in self.controllers if setting == DEFAULT else self.setting_controllers or self.controllers:
            own = with_policy_of(spec, recording_name(recording), SETTINGS[setting].turn_limit)
            trained = [with_training(own, seed) for seed in range(self.trainings)]
            found = [one for one in trained if one is not None]
            if self.trainings > 1 and len(found) == self.trainings:
                entries += [Entry(controller=one, method=spec, training_seed=k) for k, one in enumerate(found)]
            else:
                entries.append(Entry(controller=own, method=spec))
        return (*entries, Entry(controller=HUMAN, method=HUMAN))

    def runs(self) -> list[Run]:
        """One evaluation for each recording in the default setting, then those in the others.

        Returns:
            Named after recording and setting.
        """
        runs = [self._run(recording, DEFAULT) for recording in self.recordings]
        return runs + [self._run(self.recordings[0], setting) for setting in self.settings if setting != DEFAULT]

    def _run(self, recording: str, setting: str) -> Run:
        roster = self.roster(recording, setting)
        evaluation = Evaluation(
            dataset=recording,
            data_dir=self.data_dir,
            scenarios=self.scenarios,
            controllers=tuple(entry.controller for entry in roster if entry.method != HUMAN),
            draws=self.draws_of(recording, all_of_them=setting == DEFAULT),
            seed=self.seed,
            task_kwargs=dict(SETTINGS[setting].task_kwargs),
        )
        name = recording_name(recording)
        return Run(name=name if setting == DEFAULT else f"{name}.{setting}", evaluation=evaluation, roster=roster)


def write_leaderboard(
    study: Leaderboard, out: Path, *, command: str, n_jobs: int = -1, costs: Mapping[str, float] | None = None
) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        study: That was run by `study.reproduce`.
        out: Its folder; gets tables/, figures/, README.md, report.html and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.
        costs: CPU time of controllers over that of the physics, as `bench --controllers` measures it.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
    """
    results = read_runs(study, out, n_jobs=n_jobs)
    boards = _boards(study, results)
    families = families_of(study.controllers)
    write_csv(out / "tables" / "leaderboard.csv", [row for board in boards for row in board.rows()])
    write_csv(out / "tables" / "pairs.csv", [row for board in boards for row in board.pair_rows()])
    compared = [row for board in boards for family in there(families, board) for row in compare(board, family)]
    write_csv(out / "tables" / "parents.csv", compared)
    for board in boards:
        draw_fronts(board, out / "figures", figure_of(board))
    recordings = [load_recording(recording, data_dir=study.data_dir) for recording in study.recordings]
    origins = [origin for run in study.runs() for origin in origins_of(run, results[run.name])]
    provenance = write_provenance(study, results, recordings, out, command=command)
    page = leaderboard_page(boards, families=families, costs=costs or {}, origins=origins, provenance=provenance)
    return write_pages(out, page, results, command=command)


def _boards(study: Leaderboard, results: Mapping[str, Results]) -> list[Board]:
    boards = []
    for run in study.runs():
        name, _, setting = run.name.partition(".")
        name, setting = (name, setting) if setting in SETTINGS else (run.name, DEFAULT)
        boards.append(board_of(results[run.name].agents, run.named_roster, recording=name, setting=setting))
    return boards
