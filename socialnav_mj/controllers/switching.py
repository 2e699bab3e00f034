"""What controllers that switch between policies share: who may act, who acted, and what each would have cost."""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Limits, Observation, TwistController
from socialnav_mj.geometry import Array


class SwitchingController(TwistController):
    """Base of controllers that let one of several others act for each agent, at each control step anew.

    All of them see every observation and go on thinking, whoever acts. Subclasses name them in `members` and choose in
    `choose`.
    """

    _acting: NDArray[np.int64]
    _scores: Array | None

    @property
    @abstractmethod
    def members(self) -> tuple[TwistController, ...]:
        """Controllers to switch between."""

    @abstractmethod
    def choose(self, observation: Observation) -> NDArray[np.int64]:
        """Choose who acts; called after all members have seen the observation.

        Args:
            observation: Of all slots, keys as in `socialnav_mj.observation`.

        Returns:
            Index into `members` for each slot, shape (n_agents,); 0 in inactive ones.
        """

    @property
    def policies(self) -> tuple[str, ...]:
        """Names of the members."""
        return tuple(member.name for member in self.members)

    @property
    def active_policy(self) -> NDArray[np.int64]:
        """Index of the member that chose the last action, shape (n_agents,)."""
        return self._acting.copy()

    @property
    def scores(self) -> Array | None:
        """What acting by each member would have cost at the last step, shape (n_agents, members).

        NaN in inactive slots; None for controllers that choose by a rule and not by costs.
        """
        return None if self._scores is None else self._scores.copy()

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Reset all members for the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Given to all.
        """
        super().reset(limits, seed=seed)
        for member in self.members:
            member.reset(limits, seed=seed)
        self._acting, self._scores = np.zeros(0, dtype=np.int64), None

    def cheapest(self, costs: Array) -> NDArray[np.int64]:
        """Keep costs as `scores` and find the least of each agent.

        Args:
            costs: Of each member, shape (n_agents, members); NaN in inactive slots.

        Returns:
            As `choose` returns it; of equal costs the first.
        """
        self._scores = costs
        return np.where(np.isnan(costs), np.inf, costs).argmin(axis=1)

    def twist(self, observation: Observation) -> Array:
        """Twist of the member that is chosen for each agent.

        Args:
            observation: Keys as in `socialnav_mj.observation`; all members see all of it.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s].
        """
        twists = np.stack([member.twist(observation) for member in self.members], axis=1)
        self._acting = self.choose(observation)
        chosen: Array = twists[np.arange(len(twists)), self._acting]
        return chosen


def check_candidates(candidates: tuple[object, ...]) -> None:
    """Refuse a field `candidates` that does not hold two controllers or more.

    Args:
        candidates: Its content.

    Raises:
        ValueError: If there are fewer, or one is no controller.
    """
    if len(candidates) < 2 or not all(isinstance(one, TwistController) for one in candidates):
        raise ValueError(f"candidates = {candidates!r} is not allowed; allowed: two or more of TwistController")
