"""Agents that drive on in their own imagination: what they would see, and how a twist would move them."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Limits, Observation
from socialnav_mj.controllers.planning.foresight import Ahead
from socialnav_mj.controllers.planning.loops import closest, driven
from socialnav_mj.controllers.planning.terms import Terms
from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import Array, turned_back


class Imagination:
    """n agents, each alone with the others that it sees, who move as predicted whatever it does.

    Everything is in the frame that each agent had at the beginning. A time step is one of the terms'.
    """

    def __init__(self, observation: Observation, rows: NDArray[np.int64], ahead: Ahead, terms: Terms) -> None:
        """Begin with the present.

        Args:
            observation: Of all slots.
            rows: Slots of the agents under way, shape (n,).
            ahead: Where the nearest others will be, a row for each of them.
            terms: Limits and motion.
        """
        self._ahead, self._terms = ahead, terms
        self._person = observation["person"][rows]
        self.real, self.person = ahead.real, ahead.person
        self.goal: Array = observation["goal"][rows]
        self.position = np.zeros((len(rows), 2))
        self.heading = np.zeros(len(rows))
        self.speed: Array = observation["twist"][rows, 0].copy()
        self.yaw_rate: Array = observation["twist"][rows, 1].copy()
        self.step = 0

    def observation(self) -> dict[str, NDArray[np.generic]]:
        """What the agents would see now, with the keys of `socialnav_mj.observation`, of those who are in `ahead`.

        Returns:
            A row for each of the n agents; each sees k pedestrians and k agents at most.
        """
        n, cosine, sine = len(self.heading), cos(self.heading), sin(self.heading)
        here, there = self._ahead.path[:, self.step], self._ahead.path[:, self.step + 1]
        place = turned_back(here - self.position[:, None], cosine[:, None], sine[:, None])
        velocity = turned_back((there - here) / self._terms.step, cosine[:, None], sine[:, None])
        result: dict[str, NDArray[np.generic]] = {
            "active": np.ones(n, dtype=bool),
            "person": self._person,
            "position": self.position,
            "heading": self.heading,
            "twist": np.stack([self.speed, self.yaw_rate], axis=1),
            "goal": turned_back(self.goal - self.position, cosine, sine),
        }
        for kind, who in (("pedestrian", self._ahead.person), ("agent", ~self._ahead.person)):
            mask = self._ahead.real & who
            result[f"{kind}_position"] = np.where(mask[..., None], place, 0.0)
            result[f"{kind}_velocity"] = np.where(mask[..., None], velocity, 0.0)
            result[f"{kind}_mask"] = mask
        return result

    def drive(self, twist: Array) -> Array:
        """Move on by a step.

        Args:
            twist: Commanded, within the limits, shape (n, 2) [m/s], [rad/s].

        Returns:
            Least distance to each other within the step, shape (n, k) [m].
        """
        terms = self._terms
        way, turn, speed, yaw_rate = driven(twist[:, 0], twist[:, 1], self.speed, self.yaw_rate, terms)
        middle = self.heading + 0.5 * turn
        moved = self.position + way[:, None] * np.stack([cos(middle), sin(middle)], axis=1)
        before = self._ahead.path[:, self.step] - self.position[:, None]
        after = self._ahead.path[:, self.step + 1] - moved[:, None]
        self.position, self.heading = moved, self.heading + turn
        self.speed, self.yaw_rate = speed, yaw_rate
        self.step += 1
        distance: Array = closest(before[..., 0], before[..., 1], after[..., 0], after[..., 1])
        return distance


def clipped(twist: Array, limits: Limits) -> Array:
    """Twists as the wheels would take them.

    Args:
        twist: Shape (n, 2) [m/s], [rad/s].
        limits: Of the episode.

    Returns:
        The same shape.
    """
    return np.clip(twist, (0.0, -limits.max_yaw_rate), (limits.max_speed, limits.max_yaw_rate))
