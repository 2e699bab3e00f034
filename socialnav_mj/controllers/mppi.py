"""`mppi`: model-predictive path-integral control, the plan that is the weighted mean of noisy ones.

Williams et al. 2017, doi 10.1109/ICRA.2017.7989202. Costs, motion and prediction are those of `mpc`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Observation
from socialnav_mj.controllers.planning.arrays import costs_of
from socialnav_mj.controllers.planning.loops import bearing, driven, yaw_command
from socialnav_mj.controllers.planning.path_integral import (
    LEAST_WEIGHT,
    control_costs,
    correlated,
    improved,
    weights_of,
)
from socialnav_mj.controllers.planning.planner import STEPS, Planner
from socialnav_mj.controllers.prediction import STEP
from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import Array, wrap_angle


@dataclass(kw_only=True)
class MPPI(Planner):
    """A speed and a yaw rate for each of 16 steps of 0.2 s, improved once a control step from the plan of the last one.

    Beside the noisy plans stand three without noise: the last one, the way straight to the goal, and a stop (informed
    samples: Trevisan and Alonso-Mora 2024, doi 10.1109/LRA.2024.3397083). Noise of a plan lasts over several steps,
    since white noise hardly moves a robot.
    """

    samples: int = 160
    """Noisy plans a control step, >= 1."""
    temperature: float = 0.05
    """Plans that cost this much more count 1 / e as much, > 0 [s]."""
    speed_noise: float = 0.4
    """Standard deviation of speeds, as a share of the limit, > 0 [1]."""
    yaw_noise: float = 1.0
    """Standard deviation of yaw rates, > 0 [rad/s]."""
    correlation: float = 0.7
    """Of the noise of two steps that follow one another, in [0, 1)."""
    uncontrolled: float = 0.0
    """Share of the temperature with which controls are drawn to those of a robot that is not commanded, in [0, 1]."""
    name: str = "mppi"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (isinstance(self.samples, int) and self.samples >= 1):
            raise ValueError(f"samples = {self.samples!r} is not allowed; allowed: integers >= 1")
        for name in ("temperature", "speed_noise", "yaw_noise"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)!r} is not allowed; allowed: numbers > 0")
        if not 0.0 <= self.correlation < 1.0:
            raise ValueError(f"correlation = {self.correlation!r} is not allowed; allowed: numbers in [0, 1)")
        if not 0.0 <= self.uncontrolled <= 1.0:
            raise ValueError(f"uncontrolled = {self.uncontrolled!r} is not allowed; allowed: numbers in [0, 1]")

    def twist(self, observation: Observation) -> Array:
        """First step of the improved plan.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses all of them.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        speed, yaw_rate = (observation["twist"][rows, k].copy() for k in (0, 1))
        goal = observation["goal"][rows]
        crowd = self._crowd(self._foresight.look(observation))
        straight = self._straight(speed, yaw_rate, goal)
        nominal = self._last_plan(observation, rows, straight)
        deviation = np.array([self.speed_noise * self.limits.max_speed, self.yaw_noise])
        noise = deviation * correlated(self._random.standard_normal((self.samples, STEPS, 2)), self.correlation)
        plans = np.concatenate([_as_many(nominal, 3), nominal[:, None] + noise], axis=1)
        plans[:, 1], plans[:, 2] = straight, 0.0
        low, high = (0.0, -self.limits.max_yaw_rate), (self.limits.max_speed, self.limits.max_yaw_rate)
        plans = np.clip(plans, low, high)
        made = plans - nominal[:, None]
        weight = self.uncontrolled * self.temperature
        drawn = control_costs(nominal, made, deviation=deviation, correlation=self.correlation, weight=weight)
        # What a plan is drawn to is not known to the loops: its span is added to what may be given up.
        span = float(drawn.max(initial=0.0) - drawn.min(initial=0.0))
        costs, _ = costs_of(
            np.ascontiguousarray(plans.reshape(*plans.shape[:2], 2 * STEPS)),
            speed,
            yaw_rate,
            goal,
            crowd,
            self._terms,
            np.full((len(rows), 1), np.inf),
            LEAST_WEIGHT * self.temperature + span,
        )
        plan = improved(nominal, made, weights_of(costs + drawn, self.temperature))
        self._person = np.where(observation["active"], observation["person"], -1)
        self._plan = np.zeros((len(self._person), STEPS, 2))
        self._plan[rows] = plan
        result = np.zeros((len(observation["active"]), 2))
        result[rows] = plan[:, 0]
        return result

    def _last_plan(self, observation: Observation, rows: NDArray[np.int64], straight: Array) -> Array:
        """Plans of the step before, moved on by a control step, (n, steps, 2); straight for agents not there then."""
        if len(self._person) != len(observation["active"]):
            return straight
        at = np.minimum(np.arange(STEPS) + self.limits.control_timestep / STEP, STEPS - 1.0)
        before = at.astype(np.int64)
        after, share = np.minimum(before + 1, STEPS - 1), (at - before)[:, None]
        plan = self._plan[rows]
        plan = (1.0 - share) * plan[:, before] + share * plan[:, after]
        new = self._person[rows] != observation["person"][rows]
        return np.where(new[:, None, None], straight, plan)

    def _straight(self, speed: Array, yaw_rate: Array, goal: Array) -> Array:
        """Controls that lead to the goal at full speed, (n, steps, 2)."""
        result, terms = np.zeros((len(goal), STEPS, 2)), self._terms
        x, y, heading, v, w = np.zeros((5, len(goal)))
        v, w = v + speed, w + yaw_rate
        for k in range(STEPS):
            error = wrap_angle(bearing(goal[:, 1] - y, goal[:, 0] - x) - heading)
            command = yaw_command(error, terms)
            result[:, k, 0], result[:, k, 1] = terms.max_speed, command
            way, turn, v, w = driven(terms.max_speed, command, v, w, terms)
            middle = heading + 0.5 * turn
            x, y, heading = x + way * cos(middle), y + way * sin(middle), heading + turn
        return result


def _as_many(plan: Array, count: int) -> Array:
    return np.repeat(plan[:, None], count, axis=1)
