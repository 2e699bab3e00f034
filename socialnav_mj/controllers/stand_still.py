"""`stand_still`: the policy of waiting, for controllers that choose among policies."""

from dataclasses import dataclass

import numpy as np

from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.geometry import Array


@dataclass(kw_only=True)
class StandStill(TwistController):
    """Commands no motion, whatever it sees."""

    name: str = "stand_still"

    def twist(self, observation: Observation) -> Array:
        """No twist.

        Args:
            observation: Only the number of its rows matters.

        Returns:
            Zeros, shape (n_agents, 2).
        """
        return np.zeros((len(observation["active"]), 2))
