"""Where somebody has appeared before, somebody may appear again: the places, and how often."""

import numpy as np

from socialnav_mj.geometry import Array, to_agent_frame

SAME_PLACE = 0.25
"""Who appears this near to where somebody appeared before counts for that place [m]."""
ENTRANCE_DISTANCE = 4.0
"""Places farther away do not matter to an agent: it gets 3.2 m far, and they are 1.1 m wide [m]."""
PRIOR_TIME = 20.0
"""Added to the time that places have been watched for, so that the first newcomer does not count for many [s]."""


class Entrances:
    """Places of a scene where people or agents appeared; the agents of an episode know them together."""

    def __init__(self) -> None:
        """Nobody has appeared yet."""
        self._places = np.empty((0, 2))
        self._counts = np.empty(0)
        self._time = 0.0

    def note(self, newcomers: Array, *, elapsed: float) -> None:
        """Take in who has appeared.

        Args:
            newcomers: Where, shape (k, 2), world frame [m].
            elapsed: Time since the last call [s].
        """
        self._time += elapsed
        for place in newcomers:
            gap = self._places - place
            distance = np.hypot(gap[:, 0], gap[:, 1])
            if distance.min(initial=np.inf) <= SAME_PLACE:
                self._counts[distance.argmin()] += 1.0
            else:
                self._places, self._counts = np.append(self._places, place[None], axis=0), np.append(self._counts, 1.0)

    def around(self, position: Array, heading: Array) -> tuple[Array, Array, Array]:
        """Places near some agents, the nearest first.

        Args:
            position: Of the agents, (n, 2), world frame [m].
            heading: (n,) [rad].

        Returns:
            Places ahead and to the left, in the agents' frames [m], and how often somebody appears there [1/s], all
            (n, e), with frequency 0 where an agent has fewer than e places around.
        """
        place = to_agent_frame(self._places - position[:, None], heading[:, None])
        distance = np.hypot(place[..., 0], place[..., 1])
        near = distance <= ENTRANCE_DISTANCE
        order = np.argsort(np.where(near, distance, np.inf), axis=1, kind="stable")[
            :, : near.sum(axis=1).max(initial=0)
        ]
        agent = np.arange(len(place))[:, None]
        place, near = place[agent, order], near[agent, order]
        frequency = np.where(near, self._counts[order] / (self._time + PRIOR_TIME), 0.0)
        return place[..., 0].copy(), place[..., 1].copy(), frequency
