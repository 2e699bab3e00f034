"""Angles, planar frames, and the map between twists and wheel speeds."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from socialnav_mj.elementary import arctan2, cos, sin

Array = NDArray[np.float64]


def wrap_angle(angle: ArrayLike) -> Array:
    """Map angles to [-pi, pi]; odd multiples of pi go to -pi, those a rounding error below them to pi.

    Args:
        angle: Angles of any shape [rad].

    Returns:
        The same shape, in [-pi, pi] [rad].
    """
    return (np.asarray(angle, dtype=float) + np.pi) % (2.0 * np.pi) - np.pi


def to_agent_frame(vector: ArrayLike, heading: ArrayLike) -> Array:
    """Rotate world vectors into a frame whose x axis is the agent's heading.

    Args:
        vector: World vectors, shape (..., 2).
        heading: Agent headings, broadcastable to shape (...) [rad].

    Returns:
        The vectors' components ahead of and to the left of the agent, shape (..., 2).
    """
    return turned_back(np.asarray(vector, dtype=float), cos(heading), sin(heading))


def turned_back(vector: Array, cosine: Array, sine: Array) -> Array:
    """Rotate vectors by the opposite of an angle: world vectors into a frame that is turned by it.

    Args:
        vector: Shape (..., 2).
        cosine: Of the angle, broadcastable to shape (...).
        sine: Of the angle, likewise.

    Returns:
        Shape (..., 2), of all arguments together.
    """
    x, y = vector[..., 0], vector[..., 1]
    # Not one complex product: that rounds otherwise on other processors, see `elementary`.
    ahead = cosine * x + sine * y
    result = np.empty((*ahead.shape, 2))
    result[..., 0] = ahead
    np.subtract(cosine * y, sine * x, out=result[..., 1])
    return result


def yaw_of_quaternion(quaternion: ArrayLike) -> Array:
    """Heading of a body: the angle of its x axis projected on the floor.

    Args:
        quaternion: MuJoCo quaternions (w, x, y, z), shape (..., 4).

    Returns:
        Shape (...), in [-pi, pi] [rad].
    """
    quaternion = np.asarray(quaternion, dtype=float)
    w, x, y, z = quaternion[..., 0], quaternion[..., 1], quaternion[..., 2], quaternion[..., 3]
    return arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def quaternion_of_yaw(yaw: ArrayLike) -> Array:
    """MuJoCo quaternion of a rotation about the vertical.

    Args:
        yaw: Shape (...) [rad].

    Returns:
        Quaternions (w, x, y, z), shape (..., 4).
    """
    half = 0.5 * np.asarray(yaw, dtype=float)
    zero = np.zeros_like(half)
    return np.stack([cos(half), zero, zero, sin(half)], axis=-1)


def wheel_speed_of_twist(twist: ArrayLike, *, wheel_radius: float, track: float) -> Array:
    """Wheel speeds of a differential drive that rolls with a twist.

    Args:
        twist: (forward speed [m/s], yaw rate [rad/s]), shape (..., 2).
        wheel_radius: [m].
        track: Distance between the wheels' contact points [m].

    Returns:
        (left, right) wheel speeds, shape (..., 2) [rad/s].
    """
    twist = np.asarray(twist, dtype=float)
    forward, turn = twist[..., 0], 0.5 * track * twist[..., 1]
    return np.stack([forward - turn, forward + turn], axis=-1) / wheel_radius


def twist_of_wheel_speed(wheel_speed: ArrayLike, *, wheel_radius: float, track: float) -> Array:
    """Twist of a differential drive whose wheels roll without slip.

    Args:
        wheel_speed: (left, right), shape (..., 2) [rad/s].
        wheel_radius: [m].
        track: Distance between the wheels' contact points [m].

    Returns:
        (forward speed [m/s], yaw rate [rad/s]), shape (..., 2).
    """
    wheel_speed = np.asarray(wheel_speed, dtype=float)
    left, right = wheel_radius * wheel_speed[..., 0], wheel_radius * wheel_speed[..., 1]
    return np.stack([0.5 * (left + right), (right - left) / track], axis=-1)


def arc(position: Array, heading: Array, twist: Array, time: Array) -> tuple[Array, Array]:
    """Where unicycles are that drive at constant twists.

    Args:
        position: At the beginning, shape (n, 2) [m].
        heading: At the beginning, shape (n,) [rad].
        twist: Forward speed and yaw rate, shape (n, 2) [m/s], [rad/s].
        time: Since then, shape (k, 1) [s].

    Returns:
        Positions, shape (k, n, 2), and headings, shape (k, n), the latter not wrapped.
    """
    half = 0.5 * time * twist[:, 1]
    # The chord of an arc is its length times sin(half) / half, in the direction of its middle.
    chord = time * twist[:, 0] * np.where(np.abs(half) > 1e-6, sin(half) / np.where(half == 0.0, 1.0, half), 1.0)
    middle = heading + half
    way = np.stack([chord * cos(middle), chord * sin(middle)], axis=-1)
    return position + way, heading + 2.0 * half
