"""`dynamic_window`: arcs, and what is chosen among them."""

import numpy as np
import pytest

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits
from socialnav_mj.controllers.dynamic_window import DynamicWindow, arcs
from socialnav_mj.geometry import twist_of_wheel_speed
from socialnav_mj.observation import observe

LIMITS = Limits.of(Scenario())


def twist_of(people=(), velocities=None, *, goal=(6.0, 0.0), speed=1.0, **settings):
    people = np.array(people, dtype=float).reshape(-1, 2)
    controller = DynamicWindow(**settings)
    controller.reset(LIMITS)
    seen = observe(
        active=np.array([True]),
        person=np.array([7]),
        position=np.zeros((1, 2)),
        heading=np.zeros(1),
        velocity=np.array([[speed, 0.0]]),
        yaw_rate=np.zeros(1),
        goal=np.array([goal], dtype=float),
        pedestrian_position=people,
        pedestrian_velocity=np.zeros_like(people) if velocities is None else np.array(velocities, dtype=float),
        pedestrian_slots=np.arange(len(people)),
    )
    return twist_of_wheel_speed(controller.act(seen), wheel_radius=LIMITS.wheel_radius, track=LIMITS.track)[0]


def test_arcs_are_those_of_a_fine_integration():
    speed, turn = np.array([0.0, 1.0, 0.7, 0.5]), np.array([2.0, 0.0, 1.3, -2.6])
    place, heading = arcs(speed, turn, steps=3)
    dt, at, facing = 1e-4, np.zeros((4, 2)), np.zeros(4)
    for _ in range(6000):
        middle = facing + 0.5 * dt * turn
        at += dt * speed[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1)
        facing += dt * turn
    np.testing.assert_allclose(place[:, -1], at, atol=1e-6)
    np.testing.assert_allclose(heading[:, -1], facing, atol=1e-9)


def test_free_way_is_driven_straight_at_full_speed():
    assert twist_of() == pytest.approx([1.0, 0.0], abs=1e-9)


def test_speed_stays_within_what_the_motors_reach_in_a_step():
    assert twist_of(speed=0.0)[0] == pytest.approx(LIMITS.motion.acceleration * 0.2)


def test_somebody_who_stands_ahead_is_driven_around_and_a_wall_of_people_is_braked_for():
    assert abs(twist_of([(1.2, 0.05)])[1]) > 0.2
    wall = [(0.62, y) for y in np.linspace(-1.5, 1.5, 11)]
    assert twist_of(wall)[0] < 0.7


def test_who_will_have_left_is_not_in_the_way():
    """Crossing 1 m ahead, to the side, at 1.5 m/s: gone before the robot is there."""
    assert twist_of([(1.2, 0.3)], [(0.0, 1.5)]) == pytest.approx([1.0, 0.0], abs=1e-9)


def test_who_is_too_near_already_may_be_left():
    """0.35 m behind, within the margin: straight on is allowed."""
    speed, _ = twist_of([(-0.35, 0.0)])
    assert speed > 0.5


@pytest.mark.parametrize("name", ["heading_weight", "clearance_weight", "speed_weight", "margin"])
def test_impossible_settings_are_refused(name):
    for value in (-0.1, float("inf"), "x"):
        with pytest.raises(ValueError, match=f"{name} = .* is not allowed; allowed: numbers >= 0"):
            DynamicWindow(**{name: value})
