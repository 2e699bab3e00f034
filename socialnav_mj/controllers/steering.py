"""How velocities that a robot cannot drive sideways become twists."""

import numpy as np

from socialnav_mj.controllers.base import Limits
from socialnav_mj.elementary import arctan2
from socialnav_mj.geometry import Array


def twist_towards(velocity: Array, limits: Limits) -> Array:
    """Turn to a velocity's direction within one control step, and drive what of it lies ahead.

    The heading mapping of differential drives: a velocity from behind is a turn on the spot.

    Args:
        velocity: Wanted, in the agent's frame, shape (n_agents, 2) [m/s].
        limits: Of the episode.

    Returns:
        (speed, yaw rate), shape (n_agents, 2) [m/s], [rad/s]; not clipped.
    """
    turn = arctan2(velocity[:, 1], velocity[:, 0])
    return np.stack([np.maximum(velocity[:, 0], 0.0), turn / limits.control_timestep], axis=1)


def goal_direction(goal: Array) -> Array:
    """Unit vectors to the goals.

    Args:
        goal: Shape (n_agents, 2) [m].

    Returns:
        The same shape; 0 at the goal itself.
    """
    distance = np.hypot(goal[:, 0], goal[:, 1])
    return goal / np.maximum(distance, 1e-9)[:, None]
