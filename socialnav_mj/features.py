"""Fixed-size descriptions of what an agent sees, for learned rewards and policies; pure functions.

Everything is taken from an observation in the agent's own frame (see `socialnav_mj.observation`), so features do not
change when the scene is moved or turned. Pedestrians and other agents are people alike. A state of the reward is a
feature vector followed by two flags, goal reached and collided; both are absorbing, and there all else is 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.geometry import Array

N_FLAGS = 2
GOAL_FLAG, COLLISION_FLAG = -2, -1
"""Places of the flags in a state."""

HORIZON = 4.0
"""Encounters farther ahead than this are no risk [s]."""
SIGHT = 6.0
"""People farther away are not seen [m]."""


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


class FeatureSet(Protocol):
    """A fixed-size description of a view."""

    name: str
    size: int
    """Length of a feature vector, without flags."""

    def __call__(self, view: View) -> Array:
        """Features, shape (n, size)."""

    def mirror(self, features: Array) -> Array:
        """Features of the mirrored scene (left and right exchanged), shape (..., size)."""


def view_of(observation: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> View:
    """What some agents see, pedestrians and other agents together.

    Args:
        observation: See `socialnav_mj.observation`.
        rows: Slots of the agents, shape (n,).

    Returns:
        The view; empty columns are left out.
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


def _sector(position: Array, count: int) -> NDArray[np.int64]:
    """Index of the sector, the first centred ahead, counted to the left."""
    angle = np.arctan2(position[..., 1], position[..., 0])
    return np.rint(angle / (2.0 * np.pi / count)).astype(np.int64) % count


class Continuous:
    """Goal, own motion, and the nearest person in each of 12 sectors up to 6 m; 54 numbers.

    | index | feature | range |
    |---|---|---|
    | 0, 1 | cosine and sine of the goal's bearing | [-1, 1] |
    | 2 | min(d, 10 m) / 10 m, d the distance to the goal | [0, 1] |
    | 3 | exp(-d / 1 m) | (0, 1] |
    | 4 | forward speed / 1 m/s | about [0, 1] |
    | 5 | yaw rate / 2.618 rad/s | about [-1, 1] |
    | 6 + k | proximity exp(-distance / 2 m) of the nearest person in sector k, 0 if there is none | [0, 1] |
    | 18 + k | its closing speed / 2 m/s, clipped | [-1, 1] |
    | 30 + k | its tangential speed to the left / 2 m/s, clipped | [-1, 1] |
    | 42 + k | greatest risk in the sector, exp(-t / 2 s) exp(-miss distance / 0.5 m), encounters within 4 s | [0, 1] |
    """

    name = "continuous"
    n_sectors = 12
    size = 6 + 4 * n_sectors

    def __call__(self, view: View) -> Array:
        """Features of a view.

        Args:
            view: Of n agents.

        Returns:
            Shape (n, 54).
        """
        n, s = len(view.goal), self.n_sectors
        result = np.zeros((n, self.size))
        distance_to_goal = np.hypot(view.goal[:, 0], view.goal[:, 1])
        result[:, :2] = view.goal / np.maximum(distance_to_goal, 1e-9)[:, None]
        result[:, 2] = np.minimum(distance_to_goal, 10.0) / 10.0
        result[:, 3] = np.exp(-distance_to_goal)
        result[:, 4] = view.twist[:, 0]
        result[:, 5] = view.twist[:, 1] / 2.618
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        seen = view.present & (distance < SIGHT)
        agent, person = np.nonzero(seen)
        position, velocity = view.position[agent, person], view.velocity[agent, person]
        distance = distance[agent, person]
        sector = _sector(position, s)
        ahead = position / np.maximum(distance, 1e-9)[:, None]
        closing = -np.einsum("kd,kd->k", velocity, ahead)
        tangential = ahead[:, 0] * velocity[:, 1] - ahead[:, 1] * velocity[:, 0]
        time, miss = closest_approach(position, velocity)
        risk = np.where((closing > 0.0) & (time < HORIZON), np.exp(-time / 2.0 - miss / 0.5), 0.0)
        np.maximum.at(result, (agent, 6 + 3 * s + sector), risk)
        # The nearest is written last and stays.
        order = np.argsort(-distance, kind="stable")
        agent, sector = agent[order], sector[order]
        result[agent, 6 + sector] = np.exp(-distance[order] / 2.0)
        result[agent, 6 + s + sector] = np.clip(closing[order] / 2.0, -1.0, 1.0)
        result[agent, 6 + 2 * s + sector] = np.clip(tangential[order] / 2.0, -1.0, 1.0)
        return result

    def mirror(self, features: Array) -> Array:
        """Features of the mirrored scene.

        Args:
            features: Shape (..., 54).

        Returns:
            The same shape.
        """
        s = self.n_sectors
        swap = -np.arange(s) % s
        index = np.concatenate([np.arange(6), *(6 + block * s + swap for block in range(4))])
        result = features[..., index].copy()
        result[..., [1, 5]] *= -1.0
        result[..., 6 + 2 * s : 6 + 3 * s] *= -1.0
        return result


class Risk:
    """Binary features of the ReplayIRL authors' kind, in metric form; 80 numbers of 0 or 1.

    | index | feature |
    |---|---|
    | 0-3 | size of the goal's bearing in [0, 1/8), [1/8, 1/4), [1/4, 1/2), [1/2, 1] pi |
    | 4-12 | the goal's bearing in one of 8 sectors; the ninth: it is nearer than 1 m |
    | 13-17 | yaw rate below -0.8, below -0.2, within, above 0.2, above 0.8 rad/s |
    | 18-65 | risk low, medium, high (one of three, if there is anybody) of 8 sectors in the ring below 0.8 m, \
then of 8 sectors in the ring from 0.8 to 1.3 m |
    | 66-73 | somebody nearer than 0.5 m in one of 8 sectors |
    | 74-79 | speed below 0.1, 0.3, 0.5, 0.7, 0.9 m/s, or above |

    The risk of a person is high if it approaches, is nearest within the next 4 s, and its true miss distance then is
    below 0.4 m, medium if that is below 0.8 m, else low; a cell takes the greatest of its people.
    """

    name = "risk"
    n_sectors = 8
    size = 80
    rings = (0.8, 1.3)
    """Outer radii [m]."""
    intimate_distance = 0.5
    """[m]"""

    def __call__(self, view: View) -> Array:
        """Features of a view.

        Args:
            view: Of n agents.

        Returns:
            Shape (n, 80).
        """
        n, s = len(view.goal), self.n_sectors
        result = np.zeros((n, self.size))
        every = np.arange(n)
        bearing = np.abs(np.arctan2(view.goal[:, 1], view.goal[:, 0])) / np.pi
        result[every, np.searchsorted([0.125, 0.25, 0.5], bearing, side="right")] = 1.0
        near = np.hypot(view.goal[:, 0], view.goal[:, 1]) < 1.0
        result[every, 4 + np.where(near, s, _sector(view.goal, s))] = 1.0
        turn = view.twist[:, 1]
        level = (np.abs(turn) > 0.2).astype(np.int64) + (np.abs(turn) > 0.8)
        result[every, 15 + np.sign(turn).astype(np.int64) * level] = 1.0
        result[every, 74 + np.searchsorted([0.1, 0.3, 0.5, 0.7, 0.9], view.twist[:, 0], side="right")] = 1.0
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        agent, person = np.nonzero(view.present & (distance < self.rings[1]))
        position, velocity = view.position[agent, person], view.velocity[agent, person]
        distance = distance[agent, person]
        sector = _sector(position, s)
        time, miss = closest_approach(position, velocity)
        danger = (time > 0.0) & (time < HORIZON)
        risk = np.where(danger & (miss < 0.4), 2, np.where(danger & (miss < 0.8), 1, 0))
        cell = sector + s * (distance >= self.rings[0])
        greatest = np.full((n, 2 * s), -1)
        np.maximum.at(greatest, (agent, cell), risk)
        rows, cells = np.nonzero(greatest >= 0)
        result[rows, 18 + 3 * cells + greatest[rows, cells]] = 1.0
        close = distance < self.intimate_distance
        result[agent[close], 66 + sector[close]] = 1.0
        return result

    def mirror(self, features: Array) -> Array:
        """Features of the mirrored scene.

        Args:
            features: Shape (..., 80).

        Returns:
            The same shape.
        """
        s = self.n_sectors
        swap = -np.arange(s) % s
        cells = np.concatenate([swap, s + swap])
        index = np.concatenate(
            [
                np.arange(4),
                4 + swap,
                [12],
                [17, 16, 15, 14, 13],
                (18 + 3 * cells[:, None] + np.arange(3)).ravel(),
                66 + swap,
                np.arange(74, 80),
            ]
        )
        mirrored: Array = features[..., index].copy()
        return mirrored


FEATURE_SETS: dict[str, FeatureSet] = {"continuous": Continuous(), "risk": Risk()}


def feature_set(name: str) -> FeatureSet:
    """Feature set by name.

    Args:
        name: "continuous" or "risk".

    Returns:
        The feature set.

    Raises:
        ValueError: If there is none of this name.
    """
    if name not in FEATURE_SETS:
        raise ValueError(f"unknown feature set {name!r}; available: {', '.join(FEATURE_SETS)}")
    return FEATURE_SETS[name]


def running_state(features: Array) -> Array:
    """States of agents under way: features and lowered flags.

    Args:
        features: Shape (n, size).

    Returns:
        Shape (n, size + 2).
    """
    return np.concatenate([features, np.zeros((len(features), N_FLAGS))], axis=1)


def mirror_state(features: FeatureSet, state: Array) -> Array:
    """States of the mirrored scene.

    Args:
        features: Feature set of the states.
        state: Shape (..., size + 2).

    Returns:
        The same shape.
    """
    return np.concatenate([features.mirror(state[..., :-N_FLAGS]), state[..., -N_FLAGS:]], axis=-1)


def absorbing_state(size: int, flag: int) -> Array:
    """The state of everybody who reached the goal, or of everybody who collided.

    Args:
        size: Of the feature vector.
        flag: `GOAL_FLAG` or `COLLISION_FLAG`.

    Returns:
        Shape (size + 2,).
    """
    state = np.zeros(size + N_FLAGS)
    state[flag] = 1.0
    return state
