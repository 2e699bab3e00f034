"""`mpc`: a plan of the next seconds, sampled among predicted people; its first step is driven, then it is made anew."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Observation
from socialnav_mj.controllers.planning.arrays import costs_of
from socialnav_mj.controllers.planning.loops import bearing, yaw_command
from socialnav_mj.controllers.planning.planner import Planner
from socialnav_mj.controllers.planning.search import KEPT, SAMPLES, SPREAD, Choice, Costs, search
from socialnav_mj.controllers.planning.terms import Crowd
from socialnav_mj.geometry import Array, wrap_angle


@dataclass(kw_only=True)
class MPC(Planner):
    """Sampled model-predictive control with a receding horizon: the cheapest of plans that `planning.search` tries."""

    name: str = "mpc"

    @property
    def choice(self) -> Choice:
        """What was chosen at the last control step; a row for each agent that was active, in the order of slots."""
        return self._choice

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
        costs = self._costs(twist[:, 0].copy(), twist[:, 1].copy(), goal, crowd)
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

    def _costs(self, speed: Array, yaw_rate: Array, goal: Array, crowd: Crowd) -> Costs:
        """What plans cost agents with these speeds, goals and others around."""

        def costs(plans: Array, best: Array) -> tuple[Array, Array]:
            return costs_of(plans, speed, yaw_rate, goal, crowd, self._terms, best)

        return costs
