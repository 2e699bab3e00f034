"""The leaderboard: which controllers run on which recordings, and what is made of their episodes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from socialnav_mj.controllers import BUILT_IN
from socialnav_mj.controllers.specs import with_policy_of
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.files import write_whole
from socialnav_mj.recordings import load_recording
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.studies.files import write_csv, write_provenance
from socialnav_mj.studies.held_out import recording_name
from socialnav_mj.studies.leaderboard.board import Board, board_of
from socialnav_mj.studies.leaderboard.figure import draw_fronts
from socialnav_mj.studies.leaderboard.page import leaderboard_page
from socialnav_mj.studies.panel import Entry
from socialnav_mj.studies.study import Run, Study, read_runs

CONTROLLERS = (*(name for name in BUILT_IN if name != "stand_still"), "mpc(preset='calm')", "mpc(preset='free')")
"""All built-in ones but the one that goes nowhere, and the planner's other presets."""
PUBLIC = ("README.md", "provenance.json", "tables", "figures")
"""What may travel with the project: no recordings, no episodes."""


@dataclass(frozen=True, kw_only=True)
class Leaderboard(Study):
    """What is to be run."""

    recordings: tuple[str, ...]
    """Names in the catalogue, or paths."""
    controllers: tuple[str, ...] = CONTROLLERS
    """As `make_controller` takes them; learned ones act with the policy of the recording, if there is one."""
    policies: tuple[str, ...] = ()
    """Not asked: policies are part of the controllers."""

    def __post_init__(self) -> None:
        if not self.recordings or len({recording_name(r) for r in self.recordings}) < len(self.recordings):
            raise ValueError(f"recordings = {self.recordings} is not allowed; allowed: one or more of different names")
        if len(self.controllers) < 2 or len(set(self.controllers)) < len(self.controllers):
            raise ValueError(f"controllers = {self.controllers} is not allowed; allowed: two or more, each once")

    def rosters(self) -> dict[str, dict[str, str]]:
        """Recording: the controllers' names on the board, and what they are there.

        Returns:
            Spec as it was given: spec with the policy of the recording.
        """
        return {
            recording_name(recording): {spec: with_policy_of(spec, recording) for spec in self.controllers}
            for recording in self.recordings
        }

    def runs(self) -> list[Run]:
        """One evaluation for each recording.

        Returns:
            In the order of the recordings, and named after them.
        """
        return [self._run(recording, self.rosters()[recording_name(recording)]) for recording in self.recordings]

    def _run(self, recording: str, roster: Mapping[str, str]) -> Run:
        entries = tuple(Entry(controller=own, method=spec) for spec, own in roster.items())
        evaluation = Evaluation(
            dataset=recording,
            data_dir=self.data_dir,
            scenarios=self.scenarios,
            controllers=tuple(roster.values()),
            draws=self.draws,
            seed=self.seed,
        )
        human = Entry(controller=HUMAN, method=HUMAN)
        return Run(name=recording_name(recording), evaluation=evaluation, roster=(*entries, human))


def write_leaderboard(study: Leaderboard, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        study: That was run by `study.reproduce`.
        out: Its folder; gets tables/, figures/, README.md and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
    """
    results = read_runs(study, out, n_jobs=n_jobs)
    boards = _boards(study, results)
    write_csv(out / "tables" / "leaderboard.csv", [row for board in boards for row in board.rows()])
    write_csv(out / "tables" / "pairs.csv", [row for board in boards for row in board.pair_rows()])
    draw_fronts(boards, out / "figures")
    recordings = [load_recording(recording, data_dir=study.data_dir) for recording in study.recordings]
    provenance = write_provenance(study, results, recordings, out, command=command)
    return write_whole(out / "README.md", leaderboard_page(boards, provenance=provenance).encode())


def _boards(study: Leaderboard, results: Mapping[str, Results]) -> list[Board]:
    return [board_of(results[run.name].agents, run.roster, recording=run.name) for run in study.runs()]
