"""`hybrid`, the paper's mixed policy (section III-C): one controller near people, another elsewhere."""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import IS_CONTROLLER, Observation, TwistController
from socialnav_mj.controllers.potential_field import PotentialField
from socialnav_mj.controllers.replay_irl import ReplayIRL
from socialnav_mj.controllers.switching import SwitchingController
from socialnav_mj.geometry import Array

Who = Literal["pedestrians", "anyone"]


def nearest_distance(observation: Observation, *, who: Who) -> Array:
    """Distance from each agent to whoever is nearest.

    Args:
        observation: Keys as in `socialnav_mj.observation`; uses positions and masks.
        who: Replayed pedestrians, or other agents as well.

    Returns:
        Between centres, shape (n_agents,), infinite where there is nobody [m].
    """
    kinds = ("pedestrian",) if who == "pedestrians" else ("pedestrian", "agent")
    result = np.full(len(observation["active"]), np.inf)
    for kind in kinds:
        position = observation[f"{kind}_position"]
        distance = np.hypot(position[..., 0], position[..., 1])
        distance = np.where(observation[f"{kind}_mask"], distance, np.inf)
        result = np.minimum(result, distance.min(axis=1, initial=np.inf))
    return result


@dataclass(kw_only=True)
class Hybrid(SwitchingController):
    """Acts as `near` while a pedestrian is nearer than the switch distance, else as `far`.

    The paper's text speaks of the nearest pedestrian; its figures are only possible if other agents do not count, so
    that is the default. At exactly the switch distance `far` acts: the paper says "below".
    """

    near: TwistController = field(default_factory=ReplayIRL, metadata={IS_CONTROLLER: True})
    """What acts while somebody is within the switch distance."""
    far: TwistController = field(default_factory=PotentialField, metadata={IS_CONTROLLER: True})
    """What acts while nobody is."""
    switch_distance: float = 2.0
    """Acts `near` below, `far` at or above this distance between centres, >= 0 [m]."""
    who: Who = "pedestrians"
    """Whose distance counts: replayed pedestrians, or "anyone"."""
    name: str = "hybrid"

    def __post_init__(self) -> None:
        if self.who not in get_args(Who):
            raise ValueError(f"who = {self.who!r} is not allowed; allowed: {', '.join(get_args(Who))}")
        if not self.switch_distance >= 0.0:
            raise ValueError(f"switch_distance = {self.switch_distance!r} is not allowed; allowed: numbers >= 0")
        for name in ("near", "far"):
            if not isinstance(getattr(self, name), TwistController):
                raise ValueError(
                    f"{name} = {getattr(self, name)!r} is not allowed; allowed: objects of TwistController"
                )

    @property
    def members(self) -> tuple[TwistController, ...]:
        """The two controllers, near first."""
        return self.near, self.far

    def choose(self, observation: Observation) -> NDArray[np.int64]:
        """Compare distances with the switch distance.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            0 where the near controller acts, 1 where the far one does, shape (n_agents,).
        """
        return np.where(nearest_distance(observation, who=self.who) < self.switch_distance, 0, 1)
