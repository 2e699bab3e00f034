"""Many episodes: a grid of scenarios, controllers and draws, in parallel, resumable, one file an episode."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

import tasks
from socialnav_mj.controllers import controller_config, make_controller
from socialnav_mj.environment import make_scenario
from socialnav_mj.episode import EpisodeError, read_header
from socialnav_mj.files import write_whole
from socialnav_mj.human import HUMAN, human_episode
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.rollout import rollout


class EvaluationError(RuntimeError):
    """Some episodes could not be run; the others are kept."""


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What is to be run."""

    dataset: str = "plaza"
    """Name in the catalogue, or path of a recording."""
    variant: str | None = None
    """Which annotation of the recording; None is the default one."""
    data_dir: str | None = None
    """Where recordings are looked for first."""
    scenarios: tuple[str, ...] = tasks.ALL_TASKS
    """Names of tasks."""
    controllers: tuple[str, ...] = ("potential_field", "go_straight")
    """As `make_controller` takes them; the recorded people are always scored too."""
    draws: int = 3
    """Number of draws."""
    seed: int = 0
    """Seed of the first draw; the others count up from it."""
    task_kwargs: dict[str, Any] = field(default_factory=dict)
    """Further keyword arguments of `socialnav_mj.environment.make_environment`."""

    def __post_init__(self) -> None:
        if unknown := [name for name in self.scenarios if name not in tasks.ALL_TASKS]:
            raise ValueError(f"unknown task {unknown[0]!r}; available: {', '.join(tasks.ALL_TASKS)}")
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
        """Name of the episode's file."""
        label = "".join(c if c.isalnum() or c in "_-=." else "-" for c in self.controller)
        return f"{self.scenario}.{label}.draw_{self.draw:03d}.npz"

    def task_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of `tasks.load`, apart from the recording.

        Returns:
            A new dictionary.
        """
        return {**self.evaluation.task_kwargs, "seed": self.draw}


@dataclass(frozen=True, kw_only=True)
class Done:
    """What is told of a finished job."""

    job: Job
    simulated_time: float
    """[s]; 0 if the episode was there already or failed."""
    error: str | None = None


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


def evaluate(evaluation: Evaluation, folder: str | Path, *, command: str = "", n_jobs: int = -1) -> Iterator[Done]:
    """Run what is not there yet.

    Args:
        evaluation: What is to be run.
        folder: Gets `episodes/*.npz` and `run.json`.
        command: Kept in `run.json`.
        n_jobs: Processes; -1 for one a core.

    Yields:
        A note of each episode, those already there first.

    Raises:
        FileNotFoundError: If the recording is not there.
        EpisodeError: If an episode of the folder is damaged, or was run with another configuration.
        EvaluationError: After all others have run, if some could not be.
        ValueError: If the evaluation asks for what does not exist.
    """
    folder = Path(folder)
    recording = _recording(evaluation.dataset, evaluation.variant, evaluation.data_dir)
    jobs = jobs_of(evaluation)
    configurations = {name: controller_config(make_controller(name)) for name in evaluation.controllers}
    waiting = []
    for job in jobs:
        path = folder / "episodes" / job.file_name
        if path.exists():
            _check_same(path, job, recording, configurations.get(job.controller, {}))
            yield Done(job=job, simulated_time=0.0)
        else:
            waiting.append(job)
    _note_run(folder, evaluation, command)
    failed = []
    for done in Parallel(n_jobs=n_jobs, return_as="generator_unordered")(
        delayed(_run)(job, folder / "episodes") for job in waiting
    ):
        if done.error is not None:
            failed.append(f"{done.job.file_name}: {done.error}")
        yield done
    if failed:
        raise EvaluationError(
            f"{len(failed)} of {len(jobs)} episodes failed, the others are kept:\n" + "\n".join(failed)
        )


def _run(job: Job, folder: Path) -> Done:
    """Run one episode in whatever process; a failure is told, so that the others go on."""
    evaluation = job.evaluation
    try:
        recording = _recording(evaluation.dataset, evaluation.variant, evaluation.data_dir)
        environment = tasks.load(job.scenario, {**job.task_kwargs(), "dataset": recording})
        if job.controller == HUMAN:
            episode = human_episode(recording, environment.task.scenario, scenario_name=job.scenario)
        else:
            episode = rollout(environment, make_controller(job.controller), scenario_name=job.scenario)
        episode.save(folder / job.file_name)
    except Exception as error:  # noqa: BLE001  whatever it is, it is told and the other episodes go on
        return Done(job=job, simulated_time=0.0, error=f"{type(error).__name__}: {error}")
    return Done(job=job, simulated_time=float(episode.time[-1]))


@lru_cache(maxsize=2)
def _recording(dataset: str, variant: str | None, data_dir: str | None) -> Recording:
    return load_recording(dataset, variant=variant, data_dir=data_dir)


def _check_same(path: Path, job: Job, recording: Recording, configuration: dict[str, Any]) -> None:
    metadata = read_header(path)["metadata"]
    scenario = make_scenario(share=tasks.SHARES[job.scenario], **job.task_kwargs())
    expected = {
        "scenario": json.loads(json.dumps(scenario.as_dict())),
        "controller_config": json.loads(json.dumps(configuration)),
    }
    for name, wanted in expected.items():
        found = metadata[name]
        differing = sorted(key for key in {*wanted, *found} if wanted.get(key) != found.get(key))
        if differing:
            key = differing[0]
            raise EpisodeError(
                f"{path} was run with {name}.{key} = {found.get(key)!r}, but {wanted.get(key)!r} is asked for; "
                "choose another output folder, or delete the file to have it run again"
            )
    if metadata["recording"]["checksum"] != recording.checksum:
        raise EpisodeError(
            f"{path} was run on recording {metadata['recording']['name']!r} with checksum "
            f"{metadata['recording']['checksum']}, but {recording.name!r} with {recording.checksum} is asked for; "
            "choose another output folder, or delete the file to have it run again"
        )


def _note_run(folder: Path, evaluation: Evaluation, command: str) -> None:
    content = {"command": command, "controllers": [*evaluation.controllers, HUMAN]}
    write_whole(folder / "run.json", (json.dumps(content, indent=1) + "\n").encode())
