"""The paper's study: which controllers run in which settings."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from socialnav_mj.config import Scenario, TurnLimit
from socialnav_mj.controllers.hybrid import Who
from socialnav_mj.controllers.replay_irl import load_policy, shipped_policies
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.panel import CAPPED, MIXED, POTENTIAL_FIELD, REPLAY_IRL, ROBOTS, Entry
from socialnav_mj.studies.settings import SETTINGS
from socialnav_mj.studies.study import Run, Study, learned

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
    field: str = POTENTIAL_FIELD
    """Controller that stands where the paper's potential field stands, alone and in the hybrid."""
    who: Who = "pedestrians"
    """Who counts in the switch of the hybrid."""
    runs: tuple[str, ...] = ROBOTS
    """Methods that it changes; the others are those of the default setting."""
    is_full: bool = False
    """Whether it has as many draws and trainings as the default setting, whatever is asked of the others."""

    @property
    def turn_limit(self) -> str:
        """Under which its policies are to have been trained."""
        return str(self.task_kwargs.get("turn_limit", Scenario.turn_limit))


def _of_setting(name: str, *, is_full: bool = False) -> Variant:
    setting = SETTINGS[name]
    return Variant(name=name, title=setting.title, task_kwargs=dict(setting.task_kwargs), is_full=is_full)


DEFAULT = Variant(name="default", title="default", is_full=True)
VARIANTS: tuple[Variant, ...] = (
    DEFAULT,
    _of_setting("turn_per_second", is_full=True),
    Variant(name="capped", title="capped field in the paper's place", field=CAPPED, runs=(MIXED,), is_full=True),
    _of_setting("yielding"),
    _of_setting("unicycle"),
    _of_setting("radii_0.25"),
    _of_setting("radii_0.40"),
    _of_setting("retire"),
    Variant(name="switch_anyone", title="agents count in the switch", who="anyone", runs=(MIXED,)),
)
"""The default setting first."""
OTHERS = (*(variant.name for variant in VARIANTS[1:]), SWEEP_RUN)
"""What there is beside the default setting."""


@dataclass(frozen=True, kw_only=True)
class Experiment(Study):
    """What is to be reproduced; of its policies there is one for each training seed."""

    dataset: str
    """Name in the catalogue, or path of a recording."""
    variants: tuple[str, ...] = ()
    """Which of `OTHERS` to run as well."""
    variant_draws: int | None = None
    """Draws of the sweep and of settings that are not full, the first ones of `draws`; None for all."""
    variant_trainings: int | None = None
    """Trainings of the same, those with the least seeds; None for all."""

    def __post_init__(self) -> None:
        if unknown := [name for name in self.variants if name not in OTHERS]:
            raise ValueError(f"variants: {unknown[0]!r} is not allowed; allowed: {', '.join(OTHERS)}")
        if self.variant_draws is not None and not 1 <= self.variant_draws <= self.draws:
            raise ValueError(f"variant_draws = {self.variant_draws} is not allowed; allowed: 1 to draws = {self.draws}")
        if self.variant_trainings is not None and self.variant_trainings < 1:
            raise ValueError(f"variant_trainings = {self.variant_trainings} is not allowed; allowed: integers >= 1")
        if not self.policies:
            raise ValueError("policies = () is not allowed; allowed: one or more trained policies")
        for limit, policies in self._by_turn_limit.items():
            seeds = [load_policy(policy).training_seed for policy in policies]
            if len(set(seeds)) < len(seeds):
                raise ValueError(f"policies {policies} ({limit}) have training seeds {seeds}; allowed: one of each")
        missing = [v.title for v in self.settings if v.turn_limit not in self._by_turn_limit]
        if missing:
            raise ValueError(
                f"policies {self.policies} were trained for the turn limits {', '.join(self._by_turn_limit)}; "
                f"there is none for: {', '.join(missing)}"
            )

    @cached_property
    def _by_turn_limit(self) -> dict[str, list[str]]:
        result: dict[str, list[str]] = {}
        for policy in self.policies:
            result.setdefault(load_policy(policy).turn_limit, []).append(policy)
        return result

    @property
    def settings(self) -> tuple[Variant, ...]:
        """The default setting, and those of the others that are asked for."""
        return tuple(variant for variant in VARIANTS if variant.name in (DEFAULT.name, *self.variants))

    def trainings(self, variant: Variant = DEFAULT) -> dict[int, str]:
        """Policies of a setting.

        Args:
            variant: The setting.

        Returns:
            Training seed: policy, ascending.
        """
        policies = {load_policy(policy).training_seed: policy for policy in self._by_turn_limit[variant.turn_limit]}
        count = None if variant.is_full else self.variant_trainings
        return dict(sorted(policies.items())[:count])

    def roster(self, variant: Variant) -> tuple[Entry, ...]:
        """All controllers of a setting.

        Args:
            variant: The setting.

        Returns:
            Both potential fields (in the setting "capped" one, in the paper's place), ReplayIRL and hybrid of each
            training, and the human row.
        """
        capped = () if variant.field == CAPPED else (Entry(controller=CAPPED, method=CAPPED),)
        trained = self.trainings(variant)
        return (
            Entry(controller=variant.field, method=POTENTIAL_FIELD),
            *capped,
            *(Entry(controller=learned(p), method=REPLAY_IRL, training_seed=k) for k, p in trained.items()),
            *_mixed(variant, trained, SWITCH_DISTANCE),
            Entry(controller=HUMAN, method=HUMAN),
        )

    def sweep_roster(self, distance: float) -> tuple[Entry, ...]:
        """The hybrids at a switch distance.

        Args:
            distance: [m].

        Returns:
            One for each training that the sweep has.
        """
        return _mixed(_SWEPT, self.trainings(_SWEPT), distance)

    def draws_of(self, name: str) -> int:
        """Number of draws of a run.

        Args:
            name: Of a setting, or `SWEEP_RUN`.

        Returns:
            At least 1.
        """
        is_full = any(variant.name == name and variant.is_full for variant in VARIANTS)
        return self.draws if is_full else self.variant_draws or self.draws

    def runs(self) -> list[Run]:
        """Everything that has to be evaluated.

        Returns:
            The default setting first, the sweep last.
        """
        result = []
        for variant in self.settings:
            own = tuple(entry for entry in self.roster(variant) if entry.method in (*variant.runs, HUMAN))
            result.append(self._run(variant.name, own, variant.task_kwargs))
        if SWEEP_RUN in self.variants:
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


_SWEPT = replace(DEFAULT, is_full=False)


def _mixed(variant: Variant, trained: Mapping[int, str], distance: float) -> tuple[Entry, ...]:
    """A hybrid for each training."""
    return tuple(
        Entry(
            controller=f"hybrid(near={learned(p)!r}, far={variant.field!r}, switch_distance={distance!r}, "
            f"who={variant.who!r})",
            method=MIXED,
            training_seed=k,
        )
        for k, p in trained.items()
    )


def shipped_for(dataset: str, features: str = "continuous", *, turn_limit: TurnLimit | None = None) -> tuple[str, ...]:
    """Shipped policies that were trained on a recording.

    Args:
        dataset: Name of the recording.
        features: Name of the feature set.
        turn_limit: Only those that were trained for it; None for all.

    Returns:
        Names, one for each turn limit and training seed.

    Raises:
        ValueError: If there is none.
    """
    pattern = re.compile(rf"{re.escape(dataset)}_{re.escape(features)}(_per_second)?_seed\d+")
    found = tuple(
        name
        for name in shipped_policies()
        if pattern.fullmatch(name) and turn_limit in (None, load_policy(name).turn_limit)
    )
    if not found:
        raise ValueError(
            f"no shipped policy was trained on {dataset!r} with {features!r} features; available: "
            f"{', '.join(shipped_policies()) or 'none'}; name the policies to take, or paths of .safetensors files"
        )
    return found
