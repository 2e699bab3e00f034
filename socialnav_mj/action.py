"""What agents command: wheel speeds of every slot, as the environment specifies and checks them."""

import numpy as np
from dm_env import specs
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.geometry import Array, twist_of_wheel_speed, wheel_speed_of_twist


def wheel_speed_spec(scenario: Scenario, n_slots: int) -> specs.BoundedArray:
    """Wheel speeds (left, right) of every slot.

    Args:
        scenario: Gives the robot and its limits.
        n_slots: Agents that can be in the scene at once.

    Returns:
        Shape (n_slots, 2), with the bounds of a single wheel. The plant also holds forward speed and yaw rate within
        theirs [rad/s].
    """
    robot, turn = scenario.robot, scenario.max_yaw_rate
    corners = wheel_speed_of_twist(
        [[0.0, turn], [robot.max_speed, turn]], wheel_radius=robot.wheel_radius, track=robot.track
    )
    return specs.BoundedArray((n_slots, 2), float, minimum=corners.min(), maximum=corners.max(), name="wheel_speed")


def twist_of_action(action: Array, active: NDArray[np.bool_], scenario: Scenario, *, time: float) -> Array:
    """Forward speed and yaw rate that wheel speeds command.

    Args:
        action: (left, right), shape (n_slots, 2) [rad/s].
        active: Slots that hold an agent, shape (n_slots,); others are told to stand.
        scenario: Gives the robot.
        time: For the error message [s].

    Returns:
        Shape (n_slots, 2) [m/s], [rad/s].

    Raises:
        ValueError: If the shape is wrong or a row of an active slot is not finite.
    """
    action = np.asarray(action, dtype=float)
    shape = (len(active), 2)
    if action.shape != shape:
        raise ValueError(f"action has shape {action.shape}; expected {shape} = (n_agents, (left, right))")
    if not np.isfinite(action[active]).all():
        slot = int(np.flatnonzero(active & ~np.isfinite(action).all(axis=1))[0])
        raise ValueError(
            f"action[{slot}] = {action[slot]} of an active agent at {time:.2f} s; expected finite wheel speeds"
        )
    robot = scenario.robot
    return twist_of_wheel_speed(
        np.where(active[:, None], action, 0.0), wheel_radius=robot.wheel_radius, track=robot.track
    )
