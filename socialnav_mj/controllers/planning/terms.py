"""What a plan is judged by: the crowd around an agent, the robot's limits and motion, and the shapes of the costs."""

from typing import NamedTuple

import numpy as np

from socialnav_mj.controllers.base import Limits
from socialnav_mj.controllers.motion import Motion
from socialnav_mj.controllers.prediction import STEP
from socialnav_mj.elementary import exp
from socialnav_mj.geometry import Array

# The shapes of the costs: chosen on draws 0-9 of students003.
MARGIN = 0.23
"""Clearance beyond contact that is free of cost now [m]."""
MARGIN_GROWTH = 0.12
"""By which that grows with the time ahead: predictions err [m/s]."""
OVERLAP = 0.02
"""So far inside of contact the clearance cost reaches its weight [m]."""
MOST_LACKING = 2.0
"""Where lacking clearance ends to count, as a multiple of that to `OVERLAP` [1]."""
CLEARANCE_TIME = 2.0
"""Over which the clearance cost decays with the time ahead to 1/e [s]."""
ZONE = 1.3
"""Distance to a person below which time costs: what is reported is 1.2 m [m]."""
ZONE_WIDTH = 0.3
"""Over which that cost rises from 0 to its weight [m]."""
ZONE_TIME = 4.0
"""Over which it decays to 1/e [s]."""
ENTRANCE_RADIUS = 1.13
"""Where the cost of being where somebody may appear ends; it is nearly a normal density with sd 0.4 m [m]."""
HEADING_WEIGHT = 0.15
"""Cost of not facing the goal at the end of the horizon [s/rad]."""
ARRIVAL_DISTANCE = 0.5
"""From the goal, where a roll-out ends: `Scenario.goal_radius` [m]."""


class Crowd(NamedTuple):
    """Who is around each of n agents, in its frame; k places a row, weights 0 in empty ones."""

    x: Array
    """(n, steps + 1, k) ahead, now and at the end of each step [m]."""
    y: Array
    """(n, steps + 1, k) to the left, the same [m]."""
    contact: Array
    """(n, k) distance between the centres at which they touch [m]."""
    clearance_weight: Array
    """(n, k) cost of touching now [s]."""
    zone_weight: Array
    """(n, k) cost of a second within the zone [1]."""
    entrance_x: Array
    """(n, e) places where somebody may appear, ahead [m]."""
    entrance_y: Array
    """(n, e) to the left [m]."""
    entrance_weight: Array
    """(n, e) cost of a second there [1]."""


class Terms(NamedTuple):
    """What roll-outs of one episode share; see `Limits`, `Motion` and this module's constants."""

    step: float
    max_speed: float
    max_yaw_rate: float
    motion: Motion
    margin: Array
    """(steps,) free clearance at each step [m]."""
    overlap: float
    most_lacking: float
    clearance_decay: Array
    """(steps,) by which clearance counts [1]."""
    zone: float
    zone_width: float
    zone_time: Array
    """(steps,) by which a step in the zone counts [s]."""
    entrance_radius: float
    heading_weight: float
    arrival_distance: float


def terms_of(limits: Limits, *, steps: int) -> Terms:
    """Terms for robots with some limits.

    Args:
        limits: Of the episode.
        steps: How many steps of `prediction.STEP` a roll-out has.

    Returns:
        With the robots' motion and this module's constants.
    """
    ahead: Array = STEP * np.arange(steps, dtype=float)
    return Terms(
        step=STEP,
        max_speed=limits.max_speed,
        max_yaw_rate=limits.max_yaw_rate,
        motion=limits.motion,
        margin=MARGIN + MARGIN_GROWTH * ahead,
        overlap=OVERLAP,
        most_lacking=MOST_LACKING,
        clearance_decay=exp(-ahead / CLEARANCE_TIME),
        zone=ZONE,
        zone_width=ZONE_WIDTH,
        zone_time=STEP * exp(-ahead / ZONE_TIME),
        entrance_radius=ENTRANCE_RADIUS,
        heading_weight=HEADING_WEIGHT,
        arrival_distance=ARRIVAL_DISTANCE,
    )
