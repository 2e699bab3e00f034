"""Observations and actions as Gymnasium's spaces."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from socialnav_mj.features.seen import Observer, Values

Seen = Values | dict[str, Values]
"""One array, or arrays by name."""


def observation_space(observer: Observer) -> spaces.Space[Any]:
    """The space of what one agent sees.

    Args:
        observer: Makes the observations.

    Returns:
        A box for a flat observation, else a dictionary of boxes, float32.
    """
    boxes: dict[str, spaces.Space[Any]] = {
        key: spaces.Box(low, high, (size,), np.float32) for key, (low, high, size) in observer.bounds.items()
    }
    return boxes[""] if "" in boxes else spaces.Dict(boxes)


def action_space() -> spaces.Box[Any]:
    """The space of one agent's actions.

    Returns:
        Two numbers in [-1, 1], see `socialnav_mj.controllers.base.Limits.wheel_speed_of_action`.
    """
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def bare(seen: Mapping[str, Values]) -> Seen:
    """An observation as an element of `observation_space`.

    Args:
        seen: As an observer makes it.

    Returns:
        The array alone if it is a flat one.
    """
    return seen[""] if "" in seen else dict(seen)


def row_of(seen: Mapping[str, Values], row: int | np.integer[Any]) -> dict[str, Values]:
    """What one of several agents sees.

    Args:
        seen: Arrays with a row for each.
        row: Which one.

    Returns:
        Copies without the leading axis.
    """
    return {key: values[row].copy() for key, values in seen.items()}
