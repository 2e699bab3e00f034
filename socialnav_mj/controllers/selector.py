"""`selector`: of two planners the calmer one, unless its plan is less safe than the other's."""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import IS_CONTROLLER, Limits, Observation, TwistController
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.geometry import Array


@dataclass(kw_only=True)
class Selector(TwistController):
    """Lets both planners plan, and compares what their plans lack in clearance.

    The paper switches by the distance to the nearest pedestrian; this one by what each policy would bring about. Both
    planners go on planning from their own last plan, whoever drives.
    """

    calm: MPC = field(default_factory=lambda: MPC(preset="calm"), metadata={IS_CONTROLLER: True})
    """What drives as long as it is safe enough."""
    free: MPC = field(default_factory=lambda: MPC(preset="free"), metadata={IS_CONTROLLER: True})
    """What drives otherwise."""
    tolerance: float = 0.15
    """By how much the calm plan's clearance cost may exceed the free plan's, >= 0; chosen on draws 0-9 [s]."""
    name: str = "selector"
    _acting: NDArray[np.int64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (isinstance(self.tolerance, (int, float)) and isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance = {self.tolerance!r} is not allowed; allowed: numbers >= 0")
        for name in ("calm", "free"):
            if not isinstance(getattr(self, name), MPC):
                raise ValueError(f"{name} = {getattr(self, name)!r} is not allowed; allowed: mpc with any settings")

    @property
    def policies(self) -> tuple[str, ...]:
        """Names of the two planners, calm first."""
        return self.calm.name, self.free.name

    @property
    def active_policy(self) -> NDArray[np.int64]:
        """0 where the calm planner chose the last action, 1 where the free one did, shape (n_agents,)."""
        return self._acting.copy()

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Reset both planners for the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Given to both.
        """
        super().reset(limits, seed=seed)
        for planner in (self.calm, self.free):
            planner.reset(limits, seed=seed)
        self._acting = np.zeros(0, dtype=np.int64)

    def twist(self, observation: Observation) -> Array:
        """First step of the calm plan, or of the free one where the calm one is not safe enough.

        Args:
            observation: Keys as in `socialnav_mj.observation`; both planners see all of it.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s].
        """
        calm, free = (planner.twist(observation) for planner in (self.calm, self.free))
        risk = self.calm.choice.clearance - self.free.choice.clearance
        self._acting = np.zeros(len(calm), dtype=np.int64)
        self._acting[observation["active"]] = risk > self.tolerance
        return np.where((self._acting == 0)[:, None], calm, free)
