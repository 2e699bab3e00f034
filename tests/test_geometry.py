"""Angles, frames and the wheel mapping."""

import numpy as np
import pytest
from scenes import unit_vector

from socialnav_mj.geometry import (
    quaternion_of_yaw,
    to_agent_frame,
    twist_of_wheel_speed,
    wheel_speed_of_twist,
    wrap_angle,
    yaw_of_quaternion,
)

WHEELS = {"wheel_radius": 0.06, "track": 0.24}


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (3.0, 3.0), (4.0, 4.0 - 2.0 * np.pi), (-4.0, 2.0 * np.pi - 4.0), (np.pi, -np.pi), (-np.pi, -np.pi)],
)
def test_angle_is_wrapped_by_hand_calculation(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-12)
    assert wrap_angle(angle + 6.0 * np.pi) == pytest.approx(wrapped, abs=1e-12) or abs(wrapped) == np.pi


def test_wrapped_angle_points_the_same_way_and_stays_within_pi() -> None:
    angle = np.concatenate(
        [np.linspace(-50.0, 50.0, 1001), np.nextafter([np.pi, np.pi, -np.pi, -np.pi], [4, 3, -4, -3])]
    )
    wrapped = wrap_angle(angle)
    assert wrapped.shape == angle.shape and (np.abs(wrapped) <= np.pi).all()
    np.testing.assert_allclose(unit_vector(wrapped), unit_vector(angle), atol=1e-12)


def test_agent_frame_has_ahead_first_and_left_second() -> None:
    north = np.pi / 2.0
    np.testing.assert_allclose(to_agent_frame([0.0, 2.0], north), [2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(to_agent_frame([-3.0, 0.0], north), [0.0, 3.0], atol=1e-12)


@pytest.mark.parametrize(
    "shapes", [((2,), ()), ((5, 2), (5,)), ((4, 3, 2), (4, 1)), ((1, 3, 2), (4, 1)), ((1, 0, 2), (4, 1))]
)
def test_agent_frame_is_the_rotation_matrix_for_every_shape(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    random = np.random.default_rng(0)
    vector, heading = random.normal(size=shapes[0]), random.uniform(-4.0, 4.0, shapes[1])
    ahead, left = unit_vector(heading), unit_vector(heading + np.pi / 2.0)
    expected = np.stack([(vector * ahead).sum(axis=-1), (vector * left).sum(axis=-1)], axis=-1)
    given = vector.copy()
    np.testing.assert_allclose(to_agent_frame(vector, heading), expected, atol=1e-12)
    np.testing.assert_array_equal(vector, given)


def test_agent_frame_takes_lists_integers_and_strided_arrays() -> None:
    strided = np.arange(12.0).reshape(2, 3, 2)[:, ::2, ::-1]
    np.testing.assert_allclose(to_agent_frame(strided, 0.0), strided, atol=1e-12)
    np.testing.assert_allclose(to_agent_frame([[1, 2]], [np.pi]), [[-1.0, -2.0]], atol=1e-12)


def test_yaw_survives_the_quaternion() -> None:
    yaw = np.linspace(-3.1, 3.1, 63)
    quaternion = quaternion_of_yaw(yaw)
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=-1), 1.0)
    np.testing.assert_allclose(yaw_of_quaternion(quaternion), yaw, atol=1e-12)
    np.testing.assert_allclose(yaw_of_quaternion(-quaternion), yaw, atol=1e-12)
    np.testing.assert_allclose(quaternion_of_yaw(np.pi / 2.0), [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])


def test_yaw_of_a_tilted_body_is_where_its_x_axis_points() -> None:
    # Yaw 0.7, then pitch 0.3 about the body's own y axis, by quaternion product.
    c, s = np.cos(0.35), np.sin(0.35)
    p, q = np.cos(0.15), np.sin(0.15)
    assert yaw_of_quaternion([c * p, -s * q, c * q, s * p]) == pytest.approx(0.7)


def test_wheel_speeds_have_the_figures_of_hand_calculation() -> None:
    # 0.6 m/s ahead: 10 rad/s each. 1 rad/s in place: 0.12 m/s at the wheels, 2 rad/s, the right one forwards.
    np.testing.assert_allclose(wheel_speed_of_twist([0.6, 0.0], **WHEELS), [10.0, 10.0])
    np.testing.assert_allclose(wheel_speed_of_twist([0.0, 1.0], **WHEELS), [-2.0, 2.0])
    np.testing.assert_allclose(wheel_speed_of_twist([0.6, 1.0], **WHEELS), [8.0, 12.0])


def test_twist_and_wheel_speed_are_inverse() -> None:
    twist = np.random.default_rng(1).normal(size=(4, 5, 2))
    np.testing.assert_allclose(twist_of_wheel_speed(wheel_speed_of_twist(twist, **WHEELS), **WHEELS), twist, atol=1e-12)
