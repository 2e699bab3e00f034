"""Turn to the goal and drive: the floor that every other controller has to beat."""

from dataclasses import dataclass

import numpy as np

from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.elementary import arctan2, cos
from socialnav_mj.geometry import Array


@dataclass(kw_only=True)
class GoStraight(TwistController):
    """Drives towards the goal at full speed and sees nobody; stands while the goal is behind it."""

    name: str = "go_straight"

    def twist(self, observation: Observation) -> Array:
        """Full speed scaled by the cosine of the goal's bearing, and the turn that removes it in one control step.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses goal.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s].
        """
        goal = observation["goal"]
        bearing = arctan2(goal[:, 1], goal[:, 0])
        speed = self.limits.max_speed * np.maximum(cos(bearing), 0.0)
        return np.stack([speed, bearing / self.limits.control_timestep], axis=1)
