"""How an agent's run can end."""

from enum import IntEnum


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
