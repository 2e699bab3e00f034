"""`mpc`: a plan of the next seconds, sampled among predicted people; its first step is driven, then it is made anew."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Limits, Observation, TwistController
from socialnav_mj.controllers.planning.arrays import plan_costs
from socialnav_mj.controllers.planning.foresight import Ahead, Foresight
from socialnav_mj.controllers.planning.loops import bearing, compiled, yaw_command
from socialnav_mj.controllers.planning.search import KEPT, SAMPLES, SPREAD, Choice, search
from socialnav_mj.controllers.planning.terms import Crowd, Terms, terms_of
from socialnav_mj.controllers.prediction import Prediction, load_prediction
from socialnav_mj.geometry import Array, wrap_angle

Preset = Literal["social", "free", "calm"]

WEIGHTS = ("person", "agent", "zone", "entrance")
PRESETS: dict[str, tuple[float, float, float, float]] = {
    "social": (6.0, 6.0, 0.35, 25.0),
    "free": (6.0, 6.0, 0.0, 25.0),
    "calm": (8.0, 6.0, 1.0, 25.0),
}
"""Weights of `WEIGHTS` in each preset; chosen on draws 0-9 of students003."""
STEPS = 16
"""Of the horizon, of 0.2 s each: 3.2 s; chosen on draws 0-9 of students003."""


@dataclass(kw_only=True)
class MPC(TwistController):
    """Sampled model-predictive control (receding horizon; costs, search and motion are in `controllers.planning`).

    Everything is computed in each agent's own frame from what it sees and has seen. Agents do not tell each other their
    plans. Random numbers come from the seed of `reset` and are the same for all agents of a step, so that no agent's
    plan depends on who else is there beyond what it sees of them.
    """

    preset: Preset = "social"
    """Weights that are not given are this preset's: "social", "free" (no zone) or "calm" (a dear one)."""
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
    name: str = "mpc"
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

    @property
    def choice(self) -> Choice:
        """What was chosen at the last control step; a row for each agent that was active, in the order of slots."""
        return self._choice

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Forget everything and take the limits of the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Of the random refinements.
        """
        super().reset(limits, seed=seed)
        self._random = np.random.default_rng(seed)
        self._terms: Terms = terms_of(limits, steps=STEPS)
        self._foresight = Foresight(self._prediction, limits, steps=STEPS)
        self._person = np.empty(0, dtype=np.int64)
        self._heading = self._plan = np.empty(0)

    def twist(self, observation: Observation) -> Array:
        """First step of the best plan found.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses all of them.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        noise = self._random.standard_normal((len(KEPT), SAMPLES, len(SPREAD)))
        crowd = self._crowd(self._foresight.look(observation))
        twist, goal = observation["twist"][rows], observation["goal"][rows]
        costs = partial(self._costs, twist[:, 0].copy(), twist[:, 1].copy(), goal, crowd)
        last = self._last_plan(observation, rows)
        self._choice = search(costs, goal, last, noise=noise, max_speed=self.limits.max_speed)
        plan = self._choice.plan
        self._person = np.where(observation["active"], observation["person"], -1)
        self._heading = observation["heading"].copy()
        self._plan = np.zeros((len(self._person), plan.shape[1]))
        self._plan[rows] = plan
        first = plan[:, 2] > 0.0
        error = np.where(first, plan[:, 0], bearing(goal[:, 1], goal[:, 0]) + plan[:, 3])
        result = np.zeros((len(observation["active"]), 2))
        result[rows, 0] = np.where(first, plan[:, 1], plan[:, 4])
        result[rows, 1] = yaw_command(wrap_angle(error), self._terms)
        return result

    def _last_plan(self, observation: Observation, rows: NDArray[np.int64]) -> Array:
        """Plans of the step before as they look now, (n, 5); NaN for agents that were not there."""
        if len(self._person) != len(observation["active"]):
            return np.full((len(rows), len(SPREAD)), np.nan)
        plan = self._plan[rows]
        plan[:, 0] = wrap_angle(plan[:, 0] + self._heading[rows] - observation["heading"][rows])
        plan[:, 2] = np.maximum(plan[:, 2] - self.limits.control_timestep, 0.0)
        plan[self._person[rows] != observation["person"][rows]] = np.nan
        return plan

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

    def _costs(
        self, speed: Array, yaw_rate: Array, goal: Array, crowd: Crowd, plans: Array, best: Array
    ) -> tuple[Array, Array]:
        loops = compiled()
        if loops is None:
            return plan_costs(plans, speed, yaw_rate, goal, crowd, self._terms)
        return loops(plans, speed, yaw_rate, goal, crowd, self._terms, best)
