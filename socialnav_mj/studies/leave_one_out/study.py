"""Leave one recording out: every recording is driven by policies that learned from it and by one that did not."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from socialnav_mj.controllers.replay_irl import load_policy, shipped_policies
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.studies.files import level_rows, write_csv, write_pages, write_provenance
from socialnav_mj.studies.held_out import IN_SAMPLE, learned_from, period_of_people, recording_name
from socialnav_mj.studies.leave_one_out.comparison import SideBySide, learned_method, side_by_side
from socialnav_mj.studies.leave_one_out.page import leave_one_out_page
from socialnav_mj.studies.panel import POTENTIAL_FIELD, Entry
from socialnav_mj.studies.study import Run, Study, learned, read_runs

PUBLIC = ("README.md", "provenance.json", "tables")
"""What may travel with the project: no recordings, no episodes."""


@dataclass(frozen=True, kw_only=True)
class LeaveOneOut(Study):
    """What is to be run; each policy learned from all recordings but one."""

    recordings: tuple[str, ...]
    """Names in the catalogue, or paths."""
    scenarios: tuple[str, ...] = ("scenario_1", "scenario_2")

    def __post_init__(self) -> None:
        if len(self.names) < 2 or len(set(self.names)) < len(self.names):
            raise ValueError(f"recordings = {self.recordings} is not allowed; allowed: two or more of different names")
        for name in self.names:
            if not self.trainings[name]:
                others = [other for other in self.names if other != name]
                raise ValueError(
                    f"no policy learned from {' and '.join(others)} and left out {name}; given: "
                    f"{', '.join(self.policies) or 'none'}; train one with `socialnav-mj train replay-irl --dataset "
                    f"{' '.join(others)}`"
                )

        configurations = [load_policy(policy).card["config"] for policy in self.policies]
        parts = {(tuple(c["train_window"]), tuple(c["validation_window"])) for c in configurations}
        if len(parts) > 1:
            raise ValueError(
                f"the policies were trained and validated on different parts: {sorted(parts)}; allowed: one"
            )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the recordings, in the order given."""
        return tuple(recording_name(recording) for recording in self.recordings)

    @cached_property
    def trainings(self) -> dict[str, dict[int, str]]:
        """Recording left out: training seed: policy; seeds ascend."""
        result: dict[str, dict[int, str]] = {name: {} for name in self.names}
        for policy in self.policies:
            trained = load_policy(policy)
            sources = set(learned_from(trained.card["config"]))
            left_out = set(self.names) - sources
            if len(left_out) != 1 or not sources < set(self.names):
                raise ValueError(
                    f"policy {policy!r} learned from {', '.join(sorted(sources))}; allowed: all but one of "
                    f"{', '.join(self.names)}"
                )
            own = result[left_out.pop()]
            if trained.training_seed in own:
                raise ValueError(
                    f"policies {own[trained.training_seed]!r} and {policy!r} left out the same recording and have the "
                    f"same training seed, {trained.training_seed}; allowed: one of each"
                )
            own[trained.training_seed] = policy
        return {name: dict(sorted(own.items())) for name, own in result.items()}

    def method(self, left_out: str) -> str:
        """The policies that left out a recording, as a method of the tables.

        Args:
            left_out: Name of the recording.

        Returns:
            What they learned from is in it.
        """
        return learned_method([name for name in self.names if name != left_out])

    def runs(self) -> list[Run]:
        """One evaluation for each recording, by all policies.

        Returns:
            In the order of the recordings, and named after them; in each roster the held-out policies come last but
            for the human row.
        """
        return [self._run(recording, name) for recording, name in zip(self.recordings, self.names, strict=True)]

    def _run(self, recording: str, name: str) -> Run:
        trained = [
            Entry(controller=learned(policy), method=self.method(left_out), training_seed=seed)
            for left_out in (*(other for other in self.names if other != name), name)
            for seed, policy in self.trainings[left_out].items()
        ]
        unlearned = Entry(controller=POTENTIAL_FIELD, method=POTENTIAL_FIELD)
        evaluation = Evaluation(
            dataset=recording,
            data_dir=self.data_dir,
            scenarios=self.scenarios,
            controllers=tuple(entry.controller for entry in (unlearned, *trained)),
            draws=self.draws,
            seed=self.seed,
        )
        return Run(
            name=name, evaluation=evaluation, roster=(unlearned, *trained, Entry(controller=HUMAN, method=HUMAN))
        )


def shipped_leaving_one_out(recordings: tuple[str, ...], features: str = "continuous") -> tuple[str, ...]:
    """Shipped policies that learned from exactly all but one of some recordings, by their cards.

    Args:
        recordings: Names, or paths.
        features: Name of the feature set.

    Returns:
        Names; none if there are none.
    """
    names = {recording_name(recording) for recording in recordings}
    configurations = {policy: load_policy(policy).card["config"] for policy in shipped_policies()}
    return tuple(
        policy
        for policy, configuration in configurations.items()
        if configuration["features"] == features
        and len(names - set(learned_from(configuration))) == 1
        and names > set(learned_from(configuration))
    )


def write_leave_one_out(study: LeaveOneOut, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        study: That was run by `study.reproduce`.
        out: Its folder; gets tables/leave_one_out.csv, README.md, report.html and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
    """
    results = read_runs(study, out, n_jobs=n_jobs)
    recordings = [load_recording(recording, data_dir=study.data_dir) for recording in study.recordings]
    compared = [
        _compare(study, run, results[run.name], recording)
        for run, recording in zip(study.runs(), recordings, strict=True)
    ]
    rows = []
    for side in compared:
        for method in side.methods:
            own = [level for level in side.levels.rows if level.method == method]
            rows += level_rows(own, recording=side.recording, role=side.role(method))
        rows += level_rows(side.differences, recording=side.recording, role="difference")
    write_csv(out / "tables" / "leave_one_out.csv", rows)
    provenance = write_provenance(study, results, recordings, out, command=command)
    page = leave_one_out_page(compared, provenance=provenance)
    return write_pages(out, page, results, command=command)


def _compare(study: LeaveOneOut, run: Run, results: Results, recording: Recording) -> SideBySide:
    """All controllers of a run on people whom the in-sample policies learned from."""
    in_sample = [policy for name, own in study.trainings.items() if name != run.name for policy in own.values()]
    configurations = [load_policy(policy).card["config"] for policy in in_sample]
    periods = period_of_people(recording, configurations)
    begin, end = configurations[0]["train_window"]
    return side_by_side(
        results.agents,
        run.roster,
        held_out=study.method(run.name),
        people=[person for person, period in periods.items() if period == IN_SAMPLE],
        recording=run.name,
        window=(begin, end),
    )
