"""The nearest others of each agent, and where they will be: what it sees, remembers and predicts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Limits, Observation
from socialnav_mj.controllers.planning.entrances import Entrances
from socialnav_mj.controllers.planning.tracks import Tracks, seen_by
from socialnav_mj.controllers.prediction import LAGS, STEP, Prediction, constant_velocity
from socialnav_mj.geometry import Array

MOST_NEIGHBOURS = 12
"""How many others an agent reckons with: the nearest; chosen on draws 0-9 of students003."""
NEIGHBOUR_DISTANCE = 7.0
"""Nobody farther away is reckoned with: twice what two walkers cover in a horizon of 3.2 s, and a little [m]."""
NOWHERE = 1e3
"""Coordinate of places in which there is nobody [m]."""


class Ahead(NamedTuple):
    """The k nearest others of each of n agents, the nearest first, in its frame."""

    path: Array
    """(n, steps + 1, k, 2) now and at the end of each step; `NOWHERE` where there are fewer than k [m]."""
    real: NDArray[np.bool_]
    """(n, k) there is somebody."""
    person: NDArray[np.bool_]
    """(n, k) it is a pedestrian, not an agent."""
    entrance: tuple[Array, Array, Array]
    """As `Entrances.around` returns it."""


class Foresight:
    """Looks ahead from step to step; made anew for each episode."""

    def __init__(self, prediction: Prediction, limits: Limits, *, steps: int) -> None:
        """Nothing has been seen yet.

        Args:
            prediction: Of how others move.
            limits: Of the episode; gives the time between two observations.
            steps: How many steps of `prediction.STEP` to look ahead.
        """
        self._of_people, self._of_agents = prediction, constant_velocity(steps)
        self._steps, self._elapsed = steps, limits.control_timestep
        self._lags = [round(lag * STEP / limits.control_timestep) for lag in LAGS]
        self._tracks = Tracks(depth=max(self._lags))
        self._entrances = Entrances()

    def look(self, observation: Observation) -> Ahead:
        """Take in what is seen at a control step, and predict.

        Args:
            observation: Of all slots, keys as in `socialnav_mj.observation`.

        Returns:
            A row for each active agent, in the order of their slots.
        """
        rows = np.flatnonzero(observation["active"])
        self._entrances.note(self._tracks.update(observation, elapsed=self._elapsed), elapsed=self._elapsed)
        position, _, there = seen_by(observation, rows)
        columns, real = _nearest(position, there)
        velocity = self._tracks.velocities(observation, rows, columns, self._lags)
        here = position[np.arange(len(rows))[:, None], columns][:, :, None]
        person = columns < observation["pedestrian_mask"].shape[1]
        people, agents = (of(velocity, steps=self._steps) for of in (self._of_people, self._of_agents))
        moved = np.where(person[..., None, None], people, agents)
        path = np.concatenate([here, here + moved], axis=2).swapaxes(1, 2)
        path = np.where(real[:, None, :, None], path, NOWHERE)
        entrance = self._entrances.around(observation["position"][rows], observation["heading"][rows])
        return Ahead(path=path, real=real, person=person, entrance=entrance)


def _nearest(position: Array, there: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Columns of the nearest others, (n, k) with k as small as it can be, and whether there is one."""
    distance = np.hypot(position[..., 0], position[..., 1])
    distance = np.where(there & (distance <= NEIGHBOUR_DISTANCE), distance, np.inf)
    k = min(MOST_NEIGHBOURS, int(np.isfinite(distance).sum(axis=1).max(initial=0)))
    columns = np.argsort(distance, axis=1, kind="stable")[:, :k]
    return columns, np.isfinite(distance[np.arange(len(distance))[:, None], columns])
