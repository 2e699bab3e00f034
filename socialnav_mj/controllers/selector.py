"""`selector`: of two planners the calmer one, unless its plan is less safe than the other's."""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import IS_CONTROLLER, Observation
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.switching import SwitchingController


@dataclass(kw_only=True)
class Selector(SwitchingController):
    """Lets both planners plan, and compares what their plans lack in clearance.

    The paper switches by the distance to the nearest pedestrian; this one by what each policy would bring about. Both
    planners go on planning from their own last plan, whoever drives.
    """

    calm: MPC = field(
        default_factory=lambda: MPC(preset="calm", name="mpc(preset='calm')"), metadata={IS_CONTROLLER: True}
    )
    """What drives as long as it is safe enough."""
    free: MPC = field(
        default_factory=lambda: MPC(preset="free", name="mpc(preset='free')"), metadata={IS_CONTROLLER: True}
    )
    """What drives otherwise."""
    tolerance: float = 0.15
    """By how much the calm plan's clearance cost may exceed the free plan's, >= 0; chosen on draws 0-9 [s]."""
    name: str = "selector"

    def __post_init__(self) -> None:
        if not (isinstance(self.tolerance, (int, float)) and isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance = {self.tolerance!r} is not allowed; allowed: numbers >= 0")
        for name in ("calm", "free"):
            if not isinstance(getattr(self, name), MPC):
                raise ValueError(f"{name} = {getattr(self, name)!r} is not allowed; allowed: mpc with any settings")

    @property
    def members(self) -> tuple[MPC, MPC]:
        """The two planners, calm first."""
        return self.calm, self.free

    def choose(self, observation: Observation) -> NDArray[np.int64]:
        """Compare what both plans cost for their lack of clearance; the tolerance is subtracted from the calm one's.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses active.

        Returns:
            0 where the calm planner acts, 1 where the free one does, shape (n_agents,).
        """
        active = observation["active"]
        costs = np.full((len(active), 2), np.nan)
        costs[active, 0] = self.calm.choice.clearance - self.tolerance
        costs[active, 1] = self.free.choice.clearance
        return self.cheapest(costs)
