"""What controllers that plan share: what they see ahead, and what touching, nearness and entrances cost them."""

from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from socialnav_mj.controllers.base import Limits, TwistController
from socialnav_mj.controllers.planning.foresight import Ahead, Foresight
from socialnav_mj.controllers.planning.terms import Crowd, Terms, terms_of
from socialnav_mj.controllers.prediction import Prediction, load_prediction

Preset = Literal["social", "brisk", "free", "calm"]

WEIGHTS = ("person", "agent", "zone", "entrance")
PRESETS: dict[str, tuple[float, float, float, float]] = {
    "social": (6.0, 6.0, 0.35, 25.0),
    "brisk": (6.0, 6.0, 0.15, 25.0),
    "free": (6.0, 6.0, 0.0, 25.0),
    "calm": (8.0, 6.0, 1.0, 25.0),
}
"""Weights of `WEIGHTS` in each preset; chosen on draws 0-9 of students003."""
STEPS = 16
"""Of the horizon, of 0.2 s each: 3.2 s; chosen on draws 0-9 of students003."""


@dataclass(kw_only=True)
class Planner(TwistController):
    """Base of controllers that weigh plans of the next seconds (costs and motion are in `controllers.planning`).

    Everything is computed in each agent's own frame from what it sees and has seen. Agents do not tell each other their
    plans. Random numbers come from the seed of `reset` and are the same for all agents of a step, so that no agent's
    plan depends on who else is there beyond what it sees of them.
    """

    preset: Preset = "social"
    """Weights that are not given are this preset's; "brisk" has a cheaper zone, "calm" a dear one, "free" none."""
    person_weight: float | None = None
    """Cost of touching a person now, >= 0 [s]."""
    agent_weight: float | None = None
    """Cost of touching an agent now, >= 0 [s]."""
    zone_weight: float | None = None
    """Cost of a second within 1.3 m of a person, >= 0 [1]."""
    entrance_weight: float | None = None
    """Cost of a second where somebody appears once a second, >= 0 [1]."""
    prediction: str = "linear"
    """As `prediction.load_prediction` takes it."""
    _prediction: Prediction = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.preset not in get_args(Preset):
            raise ValueError(f"preset = {self.preset!r} is not allowed; allowed: {', '.join(get_args(Preset))}")
        names = (f"{kind}_weight" for kind in WEIGHTS)
        for name, own in zip(names, PRESETS[self.preset], strict=True):
            given = getattr(self, name)
            if given is None:
                setattr(self, name, own)
            elif not (isinstance(given, (int, float)) and 0.0 <= given < np.inf):
                raise ValueError(f"{name} = {given!r} is not allowed; allowed: numbers >= 0, None")
        self._prediction = load_prediction(self.prediction, steps=STEPS)

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Forget everything and take the limits of the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Of the random samples.
        """
        super().reset(limits, seed=seed)
        self._random = np.random.default_rng(seed)
        self._terms: Terms = terms_of(limits, steps=STEPS)
        self._foresight = Foresight(self._prediction, limits, steps=STEPS)
        self._person = np.empty(0, dtype=np.int64)
        self._heading = self._plan = np.empty(0)

    def _crowd(self, ahead: Ahead) -> Crowd:
        person, real = ahead.person, ahead.real
        weight: dict[str, Any] = {kind: getattr(self, f"{kind}_weight") for kind in WEIGHTS}
        none = slice(None if weight["entrance"] else 0)
        entrance_x, entrance_y, frequency = (np.ascontiguousarray(own[:, none]) for own in ahead.entrance)
        return Crowd(
            x=np.ascontiguousarray(ahead.path[..., 0]),
            y=np.ascontiguousarray(ahead.path[..., 1]),
            contact=np.where(person, self.limits.contact_distance, self.limits.agent_contact_distance),
            clearance_weight=np.where(real, np.where(person, weight["person"], weight["agent"]), 0.0),
            zone_weight=np.where(real & person, weight["zone"], 0.0),
            entrance_x=entrance_x,
            entrance_y=entrance_y,
            entrance_weight=weight["entrance"] * frequency,
        )
