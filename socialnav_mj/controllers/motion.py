"""How a robot follows its commands, for controllers that look ahead: fitted to the physics of the shipped robots."""

from pathlib import Path
from typing import NamedTuple

from socialnav_mj.config import Scenario


class Motion(NamedTuple):
    """A robot's motion in the 0.2 s after a command; `tests/test_motion.py` holds roll-outs beside the physics."""

    speed_response: float
    """Share of a commanded change of speed that is made [1]."""
    speed_change: float
    """The largest change of speed [m/s]."""
    mean_speed: float
    """Share of the change of speed that the mean speed has [1]."""
    yaw_acceleration: float
    """With which a commanded yaw rate is reached [rad/s^2]."""
    yaw_delay: float
    """After which it is [s]."""
    yaw_change: float
    """The largest change of the yaw rate; infinite if any allowed one is made [rad/s]."""
    acceleration: float
    """Which it brakes with at least, from full speed to a stand [m/s^2]."""


LIGHT = Motion(
    speed_response=0.725,
    speed_change=0.49,
    mean_speed=0.55,
    yaw_acceleration=29.7,
    yaw_delay=0.005,
    yaw_change=float("inf"),
    acceleration=2.2,  # from 1 m/s it stops within .22 m (docs/simulation.md)
)
"""Of robot.xml."""
HEAVY = Motion(
    speed_response=0.864,
    speed_change=0.196,
    mean_speed=0.548,
    yaw_acceleration=2.01,
    yaw_delay=0.0,
    yaw_change=0.402,
    acceleration=0.95,
)
"""Of robot_heavy.xml, whose motors reach their largest forces."""
IDEAL = Motion(
    speed_response=1.0,
    speed_change=1e6,
    mean_speed=1.0,
    yaw_acceleration=1e6,
    yaw_delay=0.0,
    yaw_change=float("inf"),
    acceleration=1e6,
)
"""Of an ideal unicycle: at once, as far as numbers go."""
MOTIONS: dict[str, Motion] = {"robot.xml": LIGHT, "robot_heavy.xml": HEAVY}
"""By the name of the robot's MJCF file; a robot of yours may be added, and is taken for `LIGHT` if it is not."""


def motion_of(scenario: Scenario) -> Motion:
    """What a scenario's controllers are told of their robots' motion.

    Args:
        scenario: Gives robot and plant.

    Returns:
        As fitted; a slippery floor is not told.
    """
    return IDEAL if scenario.plant == "unicycle" else MOTIONS.get(Path(scenario.robot.model).name, LIGHT)
