"""Many episodes: a grid of scenarios, controllers and draws, in parallel, resumable, one file an episode."""

import json
import logging
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Any

from socialnav_mj import suite
from socialnav_mj.config import SHARES, Scenario
from socialnav_mj.controllers import make_controller, split_label
from socialnav_mj.environment import build_environment
from socialnav_mj.files import check_output, clear_leftovers, finished_files, write_whole
from socialnav_mj.human import HUMAN, human_episode_in_parts
from socialnav_mj.parts import file_of_part, is_before_last
from socialnav_mj.processes import in_processes
from socialnav_mj.provenance import recording_metadata
from socialnav_mj.recordings import DEFAULT_READING, Reading, Recording, load_recording
from socialnav_mj.recordings.known import unverified
from socialnav_mj.recordings.plausibility import doubts
from socialnav_mj.resumption import (
    Change,
    ChangedError,
    Named,
    OnChange,
    Wanted,
    changes,
    name_of_version,
    named_controllers,
    set_aside,
)
from socialnav_mj.rollout import rollout_in_parts

logger = logging.getLogger(__name__)


class EvaluationError(RuntimeError):
    """Some episodes could not be run; the others are kept."""


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """A grid of scenarios, controllers and draws on one recording."""

    dataset: str = "plaza"
    """Name in the catalogue, or path of a recording."""
    variant: str | None = None
    """Which annotation of the recording; None is the default one."""
    data_dir: str | None = None
    """Where recordings are looked for first."""
    reading: Reading = DEFAULT_READING
    """How the recording is read, where it does not say so itself."""
    scenarios: tuple[str, ...] = suite.ALL_TASKS
    """Names of tasks."""
    controllers: tuple[str, ...] = ("potential_field", "go_straight")
    """As `make_controller` takes them; the recorded people are always scored too."""
    draws: int = 3
    """Number of draws."""
    seed: int = 0
    """Seed of the first draw; the others count up from it."""
    part: float | None = None
    """Length at least of the parts in which episodes are written, see `parts`; whole by default [s]."""
    task_kwargs: dict[str, Any] = field(default_factory=dict)
    """Settings that differ from the scenarios', see `Scenario.changed`."""

    def __post_init__(self) -> None:
        if self.part is not None and not 1.0 <= self.part < inf:
            raise ValueError(f"part = {self.part:g} is not allowed; allowed: numbers >= 1 [s]")
        if unknown := [name for name in self.scenarios if name not in suite.ALL_TASKS]:
            raise ValueError(f"unknown task {unknown[0]!r}; available: {', '.join(suite.ALL_TASKS)}")
        if self.draws < 1:
            raise ValueError(f"draws = {self.draws} is not allowed; allowed: integers >= 1")
        if self.seed < 0:
            raise ValueError(f"seed = {self.seed} is not allowed; allowed: integers >= 0")
        for name, values in (("scenarios", self.scenarios), ("controllers", self.controllers)):
            if len(set(values)) < len(values) or not values:
                raise ValueError(f"{name} = {values} is not allowed; allowed: one or more, each once")
        if HUMAN in self.controllers:
            raise ValueError(f"controllers: {HUMAN!r} is no controller; the recorded people are always scored")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One episode of an evaluation."""

    evaluation: Evaluation
    scenario: str
    controller: str
    draw: int

    @property
    def file_name(self) -> str:
        """Name of the episode's file; of its last part, if it is written in parts."""
        label = "".join(c if c.isalnum() or c in "_-=." else "-" for c in self.controller)
        return f"{self.scenario}.{label}.draw_{self.draw:03d}.npz"

    @property
    def cost(self) -> float:
        """CPU time that it takes, about [s]: 2.5/4.2/7/9 s in scenarios 1 to 4, half a second for recorded people."""
        return 0.5 if self.controller == HUMAN else 1.7 + 8.0 * SHARES[self.scenario]


@dataclass(frozen=True, kw_only=True)
class Done:
    """Outcome of a job: run, found in the folder, or failed."""

    job: Job
    simulated_time: float | None = None
    """[s]; None if the episode was there already or failed."""
    duration: float = 0.0
    """Real time that it took in its process [s]."""
    error: str | None = None
    """What went wrong, and where."""


def jobs_of(evaluation: Evaluation) -> list[Job]:
    """All episodes of an evaluation, the longest first.

    Args:
        evaluation: What is to be run.

    Returns:
        Jobs; those of the recorded people at the end.
    """
    return [
        Job(evaluation=evaluation, scenario=scenario, controller=controller, draw=draw)
        for controller in (*evaluation.controllers, HUMAN)
        for scenario in reversed(evaluation.scenarios)
        for draw in range(evaluation.seed, evaluation.seed + evaluation.draws)
    ]


def evaluate(
    evaluation: Evaluation,
    folder: str | Path,
    *,
    command: str = "",
    n_jobs: int = -1,
    on_change: OnChange = "refuse",
) -> Iterator[Done]:
    """Run what is not there yet; everything that can be wrong with the request is told before anything runs.

    Args:
        evaluation: What is to be run.
        folder: Gets `episodes/*.npz` and `run.json`.
        command: Kept in `run.json`.
        n_jobs: Processes; -1 for one a core.
        on_change: What becomes of episodes whose controller was edited since: with "again" they move to `superseded/`
            and are run anew, with "keep" the edited one runs beside them under a name of its own.

    Returns:
        A note of each episode, those already there first. It raises `EvaluationError` after all others have run, if
        some could not be.

    Raises:
        FileNotFoundError: If the recording is not there.
        EpisodeError: If an episode of the folder is damaged, or was run with another configuration.
        ChangedError: If a controller has changed and nothing says what becomes of its episodes.
        ValueError: If the evaluation asks for what does not exist or is not allowed, or a controller that is not built
            in fails on made-up observations.
    """
    if n_jobs == 0:
        raise ValueError("n_jobs = 0 is not allowed; allowed: integers >= 1, or -1 for one a core")
    folder = Path(folder)
    recording = recording_of(evaluation)
    for doubt in (*unverified(recording), *doubts(recording)):
        logger.warning("%s: %s", evaluation.dataset, doubt)
    if len({job.file_name for job in jobs_of(evaluation)}) < len(jobs_of(evaluation)):
        raise ValueError(f"controllers {evaluation.controllers} give files of the same name; leave out all but one")
    for scenario in evaluation.scenarios:
        _scenario(evaluation, scenario, evaluation.seed)
    named = named_controllers(evaluation.controllers, _scenario(evaluation, evaluation.scenarios[0], evaluation.seed))
    check_output(folder)
    found = _changes(evaluation, folder, recording, named)
    if found and on_change == "keep":
        evaluation = _versioned(evaluation, found, named)
        named = named_controllers(
            evaluation.controllers, _scenario(evaluation, evaluation.scenarios[0], evaluation.seed)
        )
        found = _changes(evaluation, folder, recording, named)
    if found and on_change == "again":
        for change in found:
            set_aside(change, folder)
    elif found:
        raise ChangedError(found)
    jobs = jobs_of(evaluation)
    clear_leftovers(folder / "episodes")
    # Episodes of earlier commands belong to the run as well: they are in its tables.
    there = {path.name for path in finished_files(folder / "episodes", ".npz") if not is_before_last(path.name)}
    episodes = sorted({job.file_name for job in jobs} | there)
    run = {"command": command, "controllers": [own.name for own in named.values()], "episodes": episodes}
    write_whole(folder / "run.json", (json.dumps(run, indent=1) + "\n").encode())
    return _run_all(jobs, folder / "episodes", n_jobs)


def _run_all(jobs: list[Job], folder: Path, n_jobs: int) -> Iterator[Done]:
    waiting, failed = [], 0
    for job in jobs:
        if (folder / job.file_name).exists():
            yield Done(job=job)
        else:
            waiting.append(job)
    for done in in_processes(_run, [(job, folder) for job in waiting], n_jobs=n_jobs):
        failed += done.error is not None
        yield done
    if failed:
        raise EvaluationError(
            f"{failed} of {len(jobs)} episodes failed, the others are kept; the same command runs the failed ones again"
        )


def _run(job: Job, folder: Path) -> Done:
    """Run one episode in whatever process; a failure is told, so that the others go on."""
    evaluation, begin = job.evaluation, perf_counter()
    try:
        recording = recording_of(evaluation)
        scenario = _scenario(evaluation, job.scenario, job.draw)
        told: dict[str, Any] = {"seconds": inf if evaluation.part is None else evaluation.part}
        told["scenario_name"] = job.scenario
        if job.controller == HUMAN:
            episodes = human_episode_in_parts(recording, scenario, **told)
        else:
            environment = build_environment(recording, scenario, robots="likely")
            episodes = rollout_in_parts(environment, make_controller(job.controller), **told)
        for episode in episodes:
            episode.save(folder / file_of_part(job.file_name, episode.metadata))
    except Exception as error:  # noqa: BLE001  whatever it is, it is told and the other episodes go on
        frame = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({frame.filename}:{frame.lineno})"
        return Done(job=job, error=text)
    return Done(job=job, simulated_time=float(episode.time[-1]), duration=perf_counter() - begin)


def recording_of(evaluation: Evaluation) -> Recording:
    """The recording of an evaluation, read once in each process.

    Args:
        evaluation: What is to be run.

    Returns:
        The recording.

    Raises:
        ValueError: See `load_recording`.
        FileNotFoundError: See `load_recording`.
    """
    return _recording(evaluation.dataset, evaluation.variant, evaluation.data_dir, evaluation.reading)


@lru_cache(maxsize=2)
def _recording(dataset: str, variant: str | None, data_dir: str | None, reading: Reading) -> Recording:
    # What looks wrong is told once, before anything runs, and not by every process.
    return load_recording(dataset, variant=variant, data_dir=data_dir, reading=reading, warn=False)


def _scenario(evaluation: Evaluation, name: str, draw: int) -> Scenario:
    return Scenario().changed(**{"share": SHARES[name], **evaluation.task_kwargs, "seed": draw})


def _changes(evaluation: Evaluation, folder: Path, recording: Recording, named: dict[str, Named]) -> tuple[Change, ...]:
    wanted = Wanted(
        recording=recording_metadata(recording),
        scenario=lambda task, draw: _scenario(evaluation, task, draw).as_dict(),
        controllers={own.name: own.configuration for own in named.values()},
        jobs={job.file_name: (job.scenario, job.draw, named[job.controller].name) for job in jobs_of(evaluation)},
        part=evaluation.part,
    )
    return changes(folder / "episodes", wanted)


def _versioned(evaluation: Evaluation, found: tuple[Change, ...], named: dict[str, Named]) -> Evaluation:
    """The evaluation with names of their own for controllers that have changed."""
    changed = {change.controller for change in found}
    specs = tuple(
        f"{name_of_version(named[spec].name, named[spec].configuration)}={split_label(spec)[1]}"
        if named[spec].name in changed
        else spec
        for spec in evaluation.controllers
    )
    return replace(evaluation, controllers=specs)
