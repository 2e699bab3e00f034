"""How an agent's run can end."""

from enum import IntEnum
from math import pi


class Outcome(IntEnum):
    """How an agent's run ended."""

    ARRIVED = 0
    """It came within the goal radius."""
    TIMED_OUT = 1
    """Its deadline passed."""
    COLLIDED = 2
    """It was taken out at its first collision (on_collision="retire" only)."""
    UNFINISHED = 3
    """The episode was stopped while it was under way."""
    NEVER_SPAWNED = 4
    """Its place was never free."""
    OVERTURNED = 5
    """It lay on its side or back, tilted by more than `OVERTURNED_TILT`, and was taken out."""


OVERTURNED_TILT = pi / 2.0
"""A robot whose mast points below the horizon is overturned. Let go at rest, assets/robot.xml falls back on its wheels
from 62 degrees whatever the direction and from 80 towards a wheel; from 85 it ends at 147 to 180 degrees
(tests/test_physics.py). So no robot is taken out that would right itself [rad]."""
