"""What studies are made of: evaluations in folders of their own, run in turn."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from socialnav_mj import suite
from socialnav_mj.controllers import BUILT_IN, make_controller
from socialnav_mj.controllers.planning.planner import PRESETS, Planner
from socialnav_mj.evaluation import Done, Evaluation, EvaluationError, Job, evaluate, jobs_of
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results, read_results
from socialnav_mj.studies.held_out import recording_name
from socialnav_mj.studies.panel import Entry

CONTROLLERS = (
    *(name for name in BUILT_IN if name != "stand_still"),
    *(f"mpc(preset={name!r})" for name in PRESETS if name != Planner.preset),
)
"""All built-in ones but the one that goes nowhere, and the planner's other presets."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """An evaluation of its own folder, and what its controllers are in the study."""

    name: str
    evaluation: Evaluation
    roster: tuple[Entry, ...]
    """One entry a controller, and the human row."""

    @property
    def named_roster(self) -> tuple[Entry, ...]:
        """The roster with the names that episodes give to the controllers; a class of a user's own says its name."""
        return tuple(
            entry if entry.method == HUMAN else replace(entry, controller=make_controller(entry.controller).name)
            for entry in self.roster
        )


@dataclass(frozen=True, kw_only=True)
class Study(ABC):
    """Trained policies beside others, in several evaluations."""

    policies: tuple[str, ...]
    """Trained policies, as `load_policy` takes them."""
    data_dir: str | None = None
    """Where recordings are looked for first."""
    scenarios: tuple[str, ...] = suite.ALL_TASKS
    draws: int = 10
    seed: int = 0
    """Of the first draw."""

    @abstractmethod
    def runs(self) -> list[Run]:
        """Everything that has to be evaluated.

        Returns:
            Runs of different names.
        """

    def jobs(self) -> list[Job]:
        """Every episode of every run."""
        return [job for run in self.runs() for job in jobs_of(run.evaluation)]


@dataclass(frozen=True, kw_only=True)
class SideBySide(Study):
    """Controllers side by side, on several recordings."""

    recordings: tuple[str, ...]
    """Names in the catalogue, or paths."""
    controllers: tuple[str, ...] = CONTROLLERS
    """As `make_controller` takes them; learned ones act with the policy of the recording, if there is one."""
    policies: tuple[str, ...] = ()
    """Not asked: policies are part of the controllers."""
    other_draws: int | None = None
    """Draws wherever `draws` are not run, the first ones of these; None for all."""

    def __post_init__(self) -> None:
        if not self.recordings or len({recording_name(r) for r in self.recordings}) < len(self.recordings):
            raise ValueError(f"recordings = {self.recordings} is not allowed; allowed: one or more of different names")
        if len(self.controllers) < 2 or len(set(self.controllers)) < len(self.controllers):
            raise ValueError(f"controllers = {self.controllers} is not allowed; allowed: two or more, each once")
        if self.other_draws is not None and not 1 <= self.other_draws <= self.draws:
            raise ValueError(f"other_draws = {self.other_draws} is not allowed; allowed: 1 to draws = {self.draws}")

    def draws_of(self, recording: str, *, all_of_them: bool = True) -> int:
        """How often people are replaced.

        Args:
            recording: One of `recordings`; the first has all draws.
            all_of_them: Whether it has them here too.

        Returns:
            `draws` or `other_draws`.
        """
        return self.draws if recording == self.recordings[0] and all_of_them else self.other_draws or self.draws


def learned(policy: str) -> str:
    """A trained policy as a controller.

    Args:
        policy: As `load_policy` takes it.

    Returns:
        As `make_controller` takes it, and the tables name it.
    """
    return f"replay_irl(policy={policy!r})"


def run_folder(out: Path, name: str) -> Path:
    """Where the episodes of a run are.

    Args:
        out: Folder of the study.
        name: Of the run.

    Returns:
        An evaluation's folder.
    """
    return out / "runs" / name


def reproduce(study: Study, out: Path, *, command: str = "", n_jobs: int = -1) -> Iterator[Done]:
    """Run what is not there yet; everything that can be wrong is told before anything runs.

    Args:
        study: What is to be run.
        out: Gets `runs/NAME/episodes/*.npz`.
        command: Kept beside the episodes.
        n_jobs: Processes; -1 for one a core.

    Returns:
        A note of each episode. It raises `EvaluationError` after all others have run, if some could not be.

    Raises:
        FileNotFoundError: If a recording is not there.
        EpisodeError: If an episode of the folder is damaged, or was run with another configuration.
        ValueError: If the study asks for what does not exist or is not allowed.
    """
    started = [
        evaluate(run.evaluation, run_folder(out, run.name), command=command, n_jobs=n_jobs) for run in study.runs()
    ]
    return _in_turn(started)


def _in_turn(started: list[Iterator[Done]]) -> Iterator[Done]:
    failures = []
    for episodes in started:
        try:
            yield from episodes
        except EvaluationError as error:
            failures.append(str(error))
    if failures:
        raise EvaluationError("; ".join(failures))


def read_runs(study: Study, out: Path, *, n_jobs: int = -1) -> dict[str, Results]:
    """Read and score the episodes of a study, and none that its folder holds of more draws or other controllers.

    Args:
        study: That was run by `reproduce`.
        out: Its folder.
        n_jobs: Processes that score episodes.

    Returns:
        Name of the run: its results.

    Raises:
        FileNotFoundError: If a run lacks an episode.
        EpisodeError: If an episode is damaged or does not fit the others.
    """
    return {
        run.name: read_results(
            run_folder(out, run.name), files=[job.file_name for job in jobs_of(run.evaluation)], n_jobs=n_jobs
        )
        for run in study.runs()
    }
