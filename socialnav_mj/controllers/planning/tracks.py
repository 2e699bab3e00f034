"""What each agent remembers of those it sees: their velocities at the control steps before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Observation
from socialnav_mj.geometry import Array, to_agent_frame

LONGEST_JUMP = 0.5
"""Who is farther than this from where its velocity led is somebody else in the same column [m]."""


def seen_by(observation: Observation, rows: NDArray[np.int64]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Everybody whom some agents see: pedestrians in the first columns, then agents.

    Args:
        observation: Of all slots, keys as in `socialnav_mj.observation`; uses positions, velocities and masks.
        rows: Slots of the agents, shape (n,).

    Returns:
        Relative position [m] and velocity over ground [m/s], both (n, c, 2) in the agents' frames, and who is there,
        (n, c).
    """
    return (
        np.concatenate([observation["pedestrian_position"][rows], observation["agent_position"][rows]], axis=1),
        np.concatenate([observation["pedestrian_velocity"][rows], observation["agent_velocity"][rows]], axis=1),
        np.concatenate([observation["pedestrian_mask"][rows], observation["agent_mask"][rows]], axis=1),
    )


def _to_world(vector: Array, heading: Array) -> Array:
    return to_agent_frame(vector, -heading[:, None])


@dataclass(kw_only=True)
class Tracks:
    """Velocities of everybody at the last control steps, for each agent as far as it has seen them itself.

    A column of an observation holds the same person or robot from step to step. It gets somebody new after it was
    empty, or at once: then the newcomer is not where its predecessor went, and is told by that. Nobody's name is
    asked. An agent forgets everybody when its slot gets another agent.
    """

    depth: int
    """How many control steps back one can look."""

    def __post_init__(self) -> None:
        self._now = 0
        self._person = np.empty(0, dtype=np.int64)
        self._age = np.zeros((0, 0), dtype=np.int64)

    def update(self, observation: Observation, *, elapsed: float) -> Array:
        """Take in what is seen at a control step.

        Args:
            observation: Keys as in `socialnav_mj.observation`.
            elapsed: Time since the last update [s].

        Returns:
            Where those are who appeared since the last update, before the eyes of an agent that was there before them,
            (k, 2), world frame [m].
        """
        person = np.where(observation["active"], observation["person"], -1)
        columns = observation["pedestrian_mask"].shape[1] + observation["agent_mask"].shape[1]
        if self._age.shape != (len(person), columns):
            self._age = np.full((len(person), columns), -1)
            self._person = np.full(len(person), -1)
            self._place = np.zeros((len(person), columns, 2))
            self._velocity = np.zeros((self.depth + 1, len(person), columns, 2))
        rows = np.flatnonzero(observation["active"])
        position, velocity, there = seen_by(observation, rows)
        heading = observation["heading"][rows]
        place = observation["position"][rows, None] + _to_world(position, heading)
        expected = self._place[rows] + elapsed * self._velocity[self._now][rows]
        gap = place - expected
        watched = self._person[rows] == person[rows]
        same = there & watched[:, None] & (self._age[rows] >= 0)
        same &= np.hypot(gap[..., 0], gap[..., 1]) <= LONGEST_JUMP
        age = np.full_like(self._age, -1)
        age[rows] = np.where(there, np.where(same, self._age[rows] + 1, 0), -1)
        self._now = (self._now + 1) % (self.depth + 1)
        self._age, self._person = age, person
        self._place[rows] = place
        self._velocity[self._now][rows] = _to_world(velocity, heading)
        appeared = there & ~same & watched[:, None]
        newcomer = np.flatnonzero(appeared.any(axis=0))
        return place[appeared[:, newcomer].argmax(axis=0), newcomer] if newcomer.size else np.empty((0, 2))

    def velocities(
        self, observation: Observation, rows: NDArray[np.int64], columns: NDArray[np.int64], lags: Sequence[int]
    ) -> Array:
        """Velocities of others at steps before the last update; at most as far back as the agent has seen them.

        Args:
            observation: That of the last update.
            rows: Slots of agents under way, shape (n,).
            columns: Of those whom each of them asks about, as `seen_by` counts them, shape (n, k).
            lags: Steps back, each at most `depth`.

        Returns:
            (n, k, lags, 2) in the agents' frames now; where a lag is more than has been seen, the oldest seen [m/s].
        """
        back = np.minimum(np.asarray(lags), np.maximum(self._age[rows[:, None], columns], 0)[..., None])
        slot = (self._now - back) % (self.depth + 1)
        velocity = self._velocity[slot, rows[:, None, None], columns[..., None]]
        return to_agent_frame(velocity, observation["heading"][rows][:, None, None])
