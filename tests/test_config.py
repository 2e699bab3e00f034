"""The configuration: what it derives, what it refuses, and that it survives JSON."""

import json
from typing import Any

import numpy as np
import pytest

from socialnav_mj.config import MIN_CONTACT_DISTANCE, PEDESTRIAN_RADII, ROBOT_RADII, Robot, Scenario


def test_figures_that_follow_from_the_defaults_are_those_of_the_design() -> None:
    scenario = Scenario()
    assert scenario.n_sub_steps == 20
    assert scenario.contact_distance == pytest.approx(0.32)
    assert scenario.max_yaw_rate == pytest.approx(2.618, abs=1e-3)
    assert Scenario(turn_limit="per_second").max_yaw_rate == pytest.approx(0.5236, abs=1e-4)
    assert Scenario(control_timestep=0.4).max_yaw_rate == pytest.approx(1.309, abs=1e-3)


@pytest.mark.parametrize(("distance", "steps"), [(0.0, 75), (1.0, 85), (2.5, 100), (2.501, 101), (10.0, 175)])
def test_deadline_is_15_s_and_2_s_a_metre_rounded_up(distance: float, steps: int) -> None:
    assert Scenario().allowed_steps(distance) == steps


def test_at_least_one_step_is_allowed() -> None:
    assert Scenario(deadline_base=0.0).allowed_steps(0.0) == 1


def test_configuration_survives_json() -> None:
    scenario = Scenario(share=0.7, seed=np.int64(4), robot=Robot(radius=0.2), turn_limit="per_second")
    again = Scenario.from_dict(json.loads(json.dumps(scenario.as_dict())))
    assert again == scenario
    assert type(scenario.seed) is int


def test_changes_are_of_the_scenario_or_of_its_robot() -> None:
    scenario = Scenario(share=0.7, robot=Robot(track=0.3))
    changed = scenario.changed(goal_radius=0.3, robot_radius=0.2)
    assert changed == Scenario(share=0.7, goal_radius=0.3, robot=Robot(track=0.3, radius=0.2))
    assert scenario == Scenario(share=0.7, robot=Robot(track=0.3)) == scenario.changed()
    for name in ("robot", "radius", "robot_colour", "goal"):
        with pytest.raises(
            ValueError, match=rf"^unknown settings {name}; available: share, .*, robot_max_speed, robot_max_yaw_rate$"
        ):
            scenario.changed(**{name: 1.0})


def test_configuration_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        Scenario().share = 0.5  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("share", 0.0, r"numbers in \(0, 1\]"),
        ("share", 1.01, r"numbers in \(0, 1\]"),
        ("share", float("nan"), r"numbers in \(0, 1\]"),
        ("share", "0.1", r"numbers in \(0, 1\]"),
        ("share", True, r"numbers in \(0, 1\]"),
        ("seed", -1, "integers >= 0"),
        ("seed", 1.0, "integers >= 0"),
        ("seed", True, "integers >= 0"),
        ("seed", "1", "integers >= 0"),
        ("turn_limit", "per_minute", "per_step, per_second"),
        ("on_collision", "stop", "continue, retire"),
        ("pedestrian_body", "soft", "rigid, compliant"),
        ("pedestrian_radius", 0.0, r"numbers in \[0\.05, 0\.4\]"),
        ("pedestrian_radius", 0.41, r"numbers in \[0\.05, 0\.4\]"),
        ("pedestrian_radius", 0.079, r"at least 0\.08 with Robot\.radius = 0\.17, or people walk through robots"),
        ("goal_radius", float("inf"), "numbers > 0"),
        ("physics_timestep", None, r"numbers in \(0, 0\.02\]"),
        ("physics_timestep", 0.025, r"numbers in \(0, 0\.02\]"),
        ("control_timestep", 100.0, r"at most 1 s, or a robot at 1\.0 m/s could cross its goal between two"),
        ("control_timestep", 0.09, r"at least 0\.0988 with turn_limit = 'per_step', or a robot may turn at 5\.8 rad/s"),
        ("control_timestep", 0.205, r"whole multiples of physics_timestep = 0\.01"),
        ("control_timestep", 0.001, r"whole multiples of physics_timestep = 0\.01"),
        ("deadline_base", -1.0, "numbers >= 0"),
        ("contact_rearm_time", float("nan"), "numbers >= 0"),
    ],
)
def test_value_that_is_not_allowed_is_named_with_what_is(name: str, value: Any, allowed: str) -> None:
    with pytest.raises(ValueError, match=rf"^{name} = .* is not allowed; allowed: {allowed}$"):
        Scenario(**{name: value})


@pytest.mark.parametrize(
    ("name", "allowed"),
    [
        ("radius", r"numbers in \[0\.1, 0\.4\]"),
        ("wheel_radius", "numbers > 0"),
        ("track", "numbers > 0"),
        ("max_speed", r"numbers in \(0, 2\.0\]"),
    ],
)
@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), "wide", True])
def test_robot_dimension_that_is_not_allowed_is_named(name: str, allowed: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"^Robot\.{name} = .* is not allowed; allowed: {allowed}$"):
        Robot(**{name: value})


@pytest.mark.parametrize(("name", "value"), [("radius", 0.09), ("radius", 2.0), ("max_speed", 2.1)])
def test_robot_that_the_physics_does_not_bear_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"^Robot\.{name} = {value} is not allowed"):
        Robot(**{name: value})


def test_bounds_themselves_are_allowed_and_move_with_what_they_depend_on() -> None:
    for robot in (0.17, *ROBOT_RADII):
        for person in (max(PEDESTRIAN_RADII[0], MIN_CONTACT_DISTANCE - robot), PEDESTRIAN_RADII[1]):
            Scenario(robot=Robot(radius=robot), pedestrian_radius=person)
    Scenario(robot=Robot(radius=0.2), pedestrian_radius=0.05)
    Scenario(control_timestep=1.0)
    Scenario(control_timestep=0.5, robot=Robot(max_speed=2.0))
    Scenario(control_timestep=0.01, turn_limit="per_second")
    with pytest.raises(ValueError, match=r"control_timestep = 0\.6 .* at most 0\.5 s, or a robot at 2\.0 m/s"):
        Scenario(control_timestep=0.6, robot=Robot(max_speed=2.0))


def test_files_of_ordinary_episodes_are_as_before_and_those_of_before_are_read() -> None:
    plain = Scenario().as_dict()
    assert plain["pedestrian"] == "rigid" and not {"pedestrians", "plant", "floor_friction", "pedestrian_body"} & {
        *plain
    }
    assert Scenario.from_dict(plain) == Scenario()
    other = Scenario(pedestrians="weak", plant="unicycle", floor_friction=0.3, pedestrian_body="compliant")
    assert Scenario.from_dict(other.as_dict()) == other
    assert other.as_dict()["pedestrians"] == "weak" and other.as_dict()["pedestrian"] == "compliant"
