"""The paper's experiment: which controllers run in which settings."""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import tasks
from socialnav_mj.analysis.paired import HUMAN
from socialnav_mj.analysis.panel import MIXED, POTENTIAL_FIELD, REPLAY_IRL, Entry
from socialnav_mj.controllers.hybrid import Who
from socialnav_mj.controllers.replay_irl import load_policy, policies_folder, shipped_policies
from socialnav_mj.evaluation import Done, Evaluation, EvaluationError, Job, evaluate, jobs_of

ROBOTS = (POTENTIAL_FIELD, REPLAY_IRL, MIXED)
SWITCH_DISTANCE = 2.0
"""The paper's [m]."""
SWEEP = (0.5, 1.0, 1.5, 3.0, 4.0, 5.0)
"""Other switch distances [m]."""
SWEEP_RUN = "switch_sweep"


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A setting of the experiment."""

    name: str
    title: str
    """What it changes."""
    task_kwargs: dict[str, Any] = field(default_factory=dict)
    """Keyword arguments of the tasks."""
    attraction_limit: float | None = 1.0
    """Of the potential field, alone and in the mixed policy; None for eq 3 as printed."""
    who: Who = "pedestrians"
    """Who counts in the switch of the mixed policy."""
    runs: tuple[str, ...] = ROBOTS
    """Methods that it changes; the others are those of the default setting."""


DEFAULT = Variant(name="default", title="default")
VARIANTS: tuple[Variant, ...] = (
    DEFAULT,
    Variant(name="turn_per_second", title="turn limit per second", task_kwargs={"turn_limit": "per_second"}),
    Variant(name="radii_0.25", title="radii sum 0.25 m", task_kwargs={"pedestrian_radius": 0.08}),
    Variant(name="radii_0.40", title="radii sum 0.40 m", task_kwargs={"pedestrian_radius": 0.23}),
    Variant(name="retire", title="retire on collision", task_kwargs={"on_collision": "retire"}),
    Variant(name="switch_anyone", title="agents count in the switch", who="anyone", runs=(MIXED,)),
    Variant(name="pf_as_printed", title="PF as printed", attraction_limit=None, runs=(POTENTIAL_FIELD, MIXED)),
)
"""The default setting first."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """An evaluation of its own folder, and what its controllers are in the experiment."""

    name: str
    evaluation: Evaluation
    roster: tuple[Entry, ...]
    """One entry a controller, and the human row."""


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """What is to be reproduced."""

    dataset: str
    """Name in the catalogue, or path of a recording."""
    policies: tuple[str, ...]
    """Trained policies, as `load_policy` takes them, one for each training seed."""
    data_dir: str | None = None
    """Where recordings are looked for first."""
    scenarios: tuple[str, ...] = tasks.ALL_TASKS
    draws: int = 10
    seed: int = 0
    """Of the first draw."""
    variants: bool = False
    """Whether to run the variants and the sweep of the switch distance as well."""

    def __post_init__(self) -> None:
        if not self.policies:
            raise ValueError("policies = () is not allowed; allowed: one or more trained policies")
        seeds = [training_seed(policy) for policy in self.policies]
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"policies {self.policies} have training seeds {seeds}; allowed: one of each")

    @cached_property
    def trainings(self) -> dict[int, str]:
        """Training seed: policy, ascending."""
        return dict(sorted((training_seed(policy), policy) for policy in self.policies))

    @property
    def settings(self) -> tuple[Variant, ...]:
        """The default setting, and the variants if they are asked for."""
        return VARIANTS if self.variants else VARIANTS[:1]

    def roster(self, variant: Variant) -> tuple[Entry, ...]:
        """All controllers of a setting.

        Args:
            variant: The setting.

        Returns:
            Potential field, learned and mixed policy of each training, recorded humans.
        """
        far = _potential_field(variant)
        return (
            Entry(controller=far, method=POTENTIAL_FIELD),
            *(Entry(controller=_learned(p), method=REPLAY_IRL, training_seed=k) for k, p in self.trainings.items()),
            *self._mixed(far, SWITCH_DISTANCE, variant.who),
            Entry(controller=HUMAN, method=HUMAN),
        )

    def sweep_roster(self, distance: float) -> tuple[Entry, ...]:
        """The mixed policies at another switch distance.

        Args:
            distance: [m].

        Returns:
            One for each training.
        """
        return self._mixed(_potential_field(DEFAULT), distance, DEFAULT.who)

    def _mixed(self, far: str, distance: float, who: Who) -> tuple[Entry, ...]:
        return tuple(
            Entry(
                controller=f"hybrid(near={_learned(p)!r}, far={far!r}, switch_distance={distance!r}, who={who!r})",
                method=MIXED,
                training_seed=k,
            )
            for k, p in self.trainings.items()
        )

    def runs(self) -> list[Run]:
        """Everything that has to be evaluated.

        Returns:
            The default setting first, the sweep last.
        """
        result = []
        for variant in self.settings:
            own = tuple(entry for entry in self.roster(variant) if entry.method in (*variant.runs, HUMAN))
            result.append(self._run(variant.name, own, variant.task_kwargs))
        if self.variants:
            swept = tuple(entry for distance in SWEEP for entry in self.sweep_roster(distance))
            result.append(self._run(SWEEP_RUN, (*swept, Entry(controller=HUMAN, method=HUMAN)), {}))
        return result

    def _run(self, name: str, roster: tuple[Entry, ...], task_kwargs: dict[str, Any]) -> Run:
        evaluation = Evaluation(
            dataset=self.dataset,
            data_dir=self.data_dir,
            scenarios=self.scenarios,
            controllers=tuple(entry.controller for entry in roster if entry.method != HUMAN),
            draws=self.draws,
            seed=self.seed,
            task_kwargs=task_kwargs,
        )
        return Run(name=name, evaluation=evaluation, roster=roster)

    def jobs(self) -> list[Job]:
        """Every episode of every run."""
        return [job for run in self.runs() for job in jobs_of(run.evaluation)]


def _potential_field(variant: Variant) -> str:
    return "potential_field" if variant.attraction_limit == 1.0 else "potential_field(attraction_limit=None)"


def _learned(policy: str) -> str:
    return f"replay_irl(policy={policy!r})"


def shipped_for(dataset: str, features: str = "continuous") -> tuple[str, ...]:
    """Shipped policies that were trained on a recording.

    Args:
        dataset: Name of the recording.
        features: Name of the feature set.

    Returns:
        Names, one for each training seed.

    Raises:
        ValueError: If there is none.
    """
    pattern = re.compile(rf"{re.escape(dataset)}_{re.escape(features)}_seed\d+")
    found = tuple(name for name in shipped_policies() if pattern.fullmatch(name))
    if not found:
        raise ValueError(
            f"no shipped policy was trained on {dataset!r} with {features!r} features; available: "
            f"{', '.join(shipped_policies()) or 'none'}; name the policies to take, or paths of .safetensors files"
        )
    return found


def training_seed(policy: str) -> int:
    """Training seed of a policy, by its card.

    Args:
        policy: As `load_policy` takes it.

    Returns:
        The seed.

    Raises:
        PolicyError: If there is no such policy.
    """
    return int(load_policy(policy).card["config"]["seed"])


def policy_checksum(policy: str) -> str:
    """sha256 of a policy's weights.

    Args:
        policy: As `load_policy` takes it.

    Returns:
        Hexadecimal digits.
    """
    path = Path(policy) if policy.endswith(".safetensors") else policies_folder() / f"{policy}.safetensors"
    return hashlib.sha256(path.read_bytes()).hexdigest()


def run_folder(out: Path, name: str) -> Path:
    """Where the episodes of a run are.

    Args:
        out: Folder of the experiment.
        name: Of the run.

    Returns:
        An evaluation's folder.
    """
    return out / "runs" / name


def reproduce(experiment: Experiment, out: Path, *, command: str = "", n_jobs: int = -1) -> Iterator[Done]:
    """Run what is not there yet; everything that can be wrong is told before anything runs.

    Args:
        experiment: What is to be run.
        out: Gets `runs/NAME/episodes/*.npz`.
        command: Kept beside the episodes.
        n_jobs: Processes; -1 for one a core.

    Returns:
        A note of each episode. It raises `EvaluationError` after all others have run, if some could not be.

    Raises:
        FileNotFoundError: If the recording is not there.
        EpisodeError: If an episode of the folder is damaged, or was run with another configuration.
        ValueError: If the experiment asks for what does not exist or is not allowed.
    """
    started = [
        evaluate(run.evaluation, run_folder(out, run.name), command=command, n_jobs=n_jobs) for run in experiment.runs()
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
