"""What agents see as numbers of a fixed count, for policies from outside: flat, or by name with the nearest people."""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.features.sets import FeatureSet, feature_set
from socialnav_mj.features.states import COLLISION_FLAG, GOAL_FLAG, N_FLAGS, absorbing_state, running_state
from socialnav_mj.features.view import view_of
from socialnav_mj.outcome import Outcome

Values = NDArray[np.float32]
Kind = Literal["flat", "dict"]
FLAT_BOUND = 2.0
"""No number of a flat observation is farther from 0."""
FARTHEST = 100.0
"""Distances in a dictionary observation are cut here [m]."""
FASTEST = 10.0
"""So are its speeds [m/s] and yaw rates [rad/s]."""


class Flat:
    """The state of `socialnav_mj.features.states`: features, then 1 at the goal, then 1 after a collision."""

    def __init__(self, features: FeatureSet) -> None:
        """Observe by a feature set.

        Args:
            features: Makes all numbers but the last two.
        """
        self.features = features
        self.bounds = {"": (-FLAT_BOUND, FLAT_BOUND, features.size + N_FLAGS)}
        """Least and greatest value and number of values."""

    def __call__(self, observation: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> dict[str, Values]:
        """What some agents see.

        Args:
            observation: Of all slots, as of `socialnav_mj.observation`.
            rows: Slots of the agents, shape (n,).

        Returns:
            "": shape (n, size + 2).
        """
        if not rows.size:
            return {"": np.zeros((0, self.features.size + N_FLAGS), dtype=np.float32)}
        state = running_state(self.features(view_of(observation, rows)))
        return {"": np.clip(state, -FLAT_BOUND, FLAT_BOUND).astype(np.float32)}

    def ended(self, seen: Mapping[str, Values], outcome: int) -> dict[str, Values]:
        """What an agent sees whose run has just ended.

        Args:
            seen: Its last observation, without a leading axis.
            outcome: How the run ended.

        Returns:
            The absorbing state of the goal or of a collision; the last observation if a deadline ended the run.
        """
        flag = {Outcome.ARRIVED: GOAL_FLAG, Outcome.COLLIDED: COLLISION_FLAG, Outcome.OVERTURNED: COLLISION_FLAG}
        if outcome not in flag:
            return dict(seen)
        return {"": absorbing_state(self.features.size, flag[Outcome(outcome)]).astype(np.float32)}


class Nearest:
    """Goal, own motion, and the nearest people, each quantity an array of its own; absent people are 0."""

    def __init__(self, count: int) -> None:
        """Observe so many people.

        Args:
            count: People that are seen, >= 1; the nearest ones come first.

        Raises:
            ValueError: If it is less than 1.
        """
        if count < 1:
            raise ValueError(f"people = {count} is not allowed; allowed: integers >= 1")
        self.count = count
        place, speed = (-FARTHEST, FARTHEST, count), (-FASTEST, FASTEST, count)
        self.bounds = {
            "goal": (-FARTHEST, FARTHEST, 2),
            "twist": (-FASTEST, FASTEST, 2),
            "people_ahead": place,
            "people_left": place,
            "people_velocity_ahead": speed,
            "people_velocity_left": speed,
            "people_mask": (0.0, 1.0, count),
            "people_are_agents": (0.0, 1.0, count),
        }
        """Of each key: least and greatest value and number of values."""

    def __call__(self, observation: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> dict[str, Values]:
        """What some agents see.

        Args:
            observation: Of all slots, as of `socialnav_mj.observation`.
            rows: Slots of the agents, shape (n,).

        Returns:
            Key of `bounds`: shape (n, number of values).
        """
        joined = {
            name: np.concatenate([observation[f"{kind}_{name}"][rows] for kind in ("pedestrian", "agent")], axis=1)
            for name in ("position", "velocity", "mask")
        }
        position, mask = joined["position"], joined["mask"]
        distance = np.where(mask, np.hypot(position[..., 0], position[..., 1]), np.inf)
        order = np.argsort(distance, axis=1, kind="stable")[:, : self.count]
        short = self.count - order.shape[1]

        def nearest(values: NDArray[Any]) -> NDArray[Any]:
            chosen = np.where(np.take_along_axis(mask, order, axis=1), np.take_along_axis(values, order, axis=1), 0)
            return np.pad(chosen, ((0, 0), (0, short)))

        is_agent = np.arange(mask.shape[1]) >= observation["pedestrian_mask"].shape[1]
        found = {
            "goal": observation["goal"][rows],
            "twist": observation["twist"][rows],
            "people_ahead": nearest(position[..., 0]),
            "people_left": nearest(position[..., 1]),
            "people_velocity_ahead": nearest(joined["velocity"][..., 0]),
            "people_velocity_left": nearest(joined["velocity"][..., 1]),
            "people_mask": nearest(mask),
            "people_are_agents": nearest(np.broadcast_to(is_agent, mask.shape)),
        }
        return {key: np.clip(values, *self.bounds[key][:2]).astype(np.float32) for key, values in found.items()}

    def ended(self, seen: Mapping[str, Values], outcome: int) -> dict[str, Values]:
        """What an agent sees whose run has just ended.

        Args:
            seen: Its last observation, without a leading axis.
            outcome: Of no meaning here.

        Returns:
            Its last observation.
        """
        return dict(seen)


Observer = Flat | Nearest


def observer_of(kind: Kind, *, features: str = "continuous", people: int = 12) -> Observer:
    """How agents observe.

    Args:
        kind: "flat" or "dict".
        features: Feature set of a flat observation.
        people: People that a dictionary holds.

    Returns:
        A function of an observation and the rows of agents.

    Raises:
        ValueError: If there is no such kind or feature set.
    """
    if kind == "flat":
        return Flat(feature_set(features))
    if kind == "dict":
        return Nearest(people)
    raise ValueError(f"observation = {kind!r} is not allowed; allowed: flat, dict")
