"""The paper's study: which controllers run in which settings."""

import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from socialnav_mj.controllers.hybrid import Who
from socialnav_mj.controllers.replay_irl import load_policy, shipped_policies
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.panel import MIXED, POTENTIAL_FIELD, REPLAY_IRL, Entry
from socialnav_mj.studies.study import Run, Study, learned

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
    """Of the potential field, alone and in the hybrid; None for eq 3 as printed."""
    who: Who = "pedestrians"
    """Who counts in the switch of the hybrid."""
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
class Experiment(Study):
    """What is to be reproduced; of its policies there is one for each training seed."""

    dataset: str
    """Name in the catalogue, or path of a recording."""
    variants: bool = False
    """Whether to run the other settings and the sweep of the switch distance as well."""
    variant_draws: int | None = None
    """Draws of the other settings and the sweep, the first ones of `draws`; None for all."""

    def __post_init__(self) -> None:
        if self.variant_draws is not None and not 1 <= self.variant_draws <= self.draws:
            raise ValueError(f"variant_draws = {self.variant_draws} is not allowed; allowed: 1 to draws = {self.draws}")
        if not self.policies:
            raise ValueError("policies = () is not allowed; allowed: one or more trained policies")
        seeds = [load_policy(policy).training_seed for policy in self.policies]
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"policies {self.policies} have training seeds {seeds}; allowed: one of each")

    @cached_property
    def trainings(self) -> dict[int, str]:
        """Training seed: policy, ascending."""
        return dict(sorted((load_policy(policy).training_seed, policy) for policy in self.policies))

    @property
    def settings(self) -> tuple[Variant, ...]:
        """The default setting, and the others if they are asked for."""
        return VARIANTS if self.variants else VARIANTS[:1]

    def roster(self, variant: Variant) -> tuple[Entry, ...]:
        """All controllers of a setting.

        Args:
            variant: The setting.

        Returns:
            Potential field, ReplayIRL and hybrid of each training, and the human row.
        """
        far = _potential_field(variant)
        return (
            Entry(controller=far, method=POTENTIAL_FIELD),
            *(Entry(controller=learned(p), method=REPLAY_IRL, training_seed=k) for k, p in self.trainings.items()),
            *self._mixed(far, SWITCH_DISTANCE, variant.who),
            Entry(controller=HUMAN, method=HUMAN),
        )

    def sweep_roster(self, distance: float) -> tuple[Entry, ...]:
        """The hybrids at another switch distance.

        Args:
            distance: [m].

        Returns:
            One for each training.
        """
        return self._mixed(_potential_field(DEFAULT), distance, DEFAULT.who)

    def _mixed(self, far: str, distance: float, who: Who) -> tuple[Entry, ...]:
        return tuple(
            Entry(
                controller=f"hybrid(near={learned(p)!r}, far={far!r}, switch_distance={distance!r}, who={who!r})",
                method=MIXED,
                training_seed=k,
            )
            for k, p in self.trainings.items()
        )

    def draws_of(self, name: str) -> int:
        """Number of draws of a run.

        Args:
            name: Of a setting, or `SWEEP_RUN`.

        Returns:
            At least 1.
        """
        return self.draws if name == DEFAULT.name else self.variant_draws or self.draws

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
            draws=self.draws_of(name),
            seed=self.seed,
            task_kwargs=task_kwargs,
        )
        return Run(name=name, evaluation=evaluation, roster=roster)


def _potential_field(variant: Variant) -> str:
    return "potential_field" if variant.attraction_limit == 1.0 else "potential_field(attraction_limit=None)"


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
