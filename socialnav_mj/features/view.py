"""What agents see of the people around them, before it is made into numbers of a fixed count."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.elementary import arctan2
from socialnav_mj.geometry import Array

HORIZON = 4.0
"""Encounters farther ahead than this are no risk [s]."""


@dataclass(frozen=True, kw_only=True)
class View:
    """What n agents see of themselves and of p people, in their own frames."""

    goal: Array
    """(n, 2) [m]."""
    twist: Array
    """(n, 2) forward speed [m/s] and yaw rate [rad/s]."""
    position: Array
    """(n, p, 2) relative [m]."""
    velocity: Array
    """(n, p, 2) relative to the agent's own velocity [m/s]."""
    present: NDArray[np.bool_]
    """(n, p)"""
    companion: NDArray[np.bool_] | None = None
    """(n, p) which of those present walk with whoever sees them; None if nobody does, as for every agent."""


def view_of(observation: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> View:
    """What some agents see, pedestrians and other agents together.

    Args:
        observation: Of all slots, keys as in `socialnav_mj.observation`; uses goal, twist, and position, velocity and
            mask of pedestrians and of agents.
        rows: Slots of the agents, shape (n,).

    Returns:
        What those n agents see, of p people who are there for at least one of them: pedestrians first.
    """
    position = np.concatenate([observation["pedestrian_position"][rows], observation["agent_position"][rows]], axis=1)
    velocity = np.concatenate([observation["pedestrian_velocity"][rows], observation["agent_velocity"][rows]], axis=1)
    present = np.concatenate([observation["pedestrian_mask"][rows], observation["agent_mask"][rows]], axis=1)
    used = np.flatnonzero(present.any(axis=0))
    twist = observation["twist"][rows]
    own = np.zeros((len(rows), 1, 2))
    own[:, 0, 0] = twist[:, 0]
    return View(
        goal=observation["goal"][rows],
        twist=twist,
        position=position[:, used],
        velocity=velocity[:, used] - own,
        present=present[:, used],
    )


def closest_approach(position: Array, velocity: Array) -> tuple[Array, Array]:
    """Time until, and distance at, the closest approach of straight relative motion.

    Args:
        position: Relative, shape (..., 2) [m].
        velocity: Relative, shape (..., 2) [m/s].

    Returns:
        Time >= 0, 0 for whoever recedes or stands still [s], and true miss distance [m], both of shape (...).
    """
    speed2 = np.einsum("...d,...d->...", velocity, velocity)
    approach = -np.einsum("...d,...d->...", position, velocity)
    time = np.where(speed2 > 1e-9, np.maximum(approach, 0.0) / np.maximum(speed2, 1e-9), 0.0)
    miss = position + velocity * time[..., None]
    return time, np.hypot(miss[..., 0], miss[..., 1])


def sector_of(position: Array, count: int) -> NDArray[np.int64]:
    """In which of some equal sectors around an agent positions are.

    Args:
        position: In the agent's frame, shape (..., 2) [m].
        count: Number of sectors.

    Returns:
        Index of the sector, the first centred ahead, counted to the left, shape (...).
    """
    angle = arctan2(position[..., 1], position[..., 0])
    return np.rint(angle / (2.0 * np.pi / count)).astype(np.int64) % count
