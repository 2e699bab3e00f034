"""Robots by name or file: their limits hold in the physics, and models with other names and without servos are read."""

from pathlib import Path

import numpy as np
import pytest

import socialnav_mj
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits, make_controller
from socialnav_mj.resources import assets_folder
from socialnav_mj.robot_files import read_robot, robot_settings, shipped_robots

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
# mass [kg], largest speed [m/s] and yaw rate [rad/s] of each, as the sources in their files say.
SHIPPED = {"turtlebot4": (3.945, 0.46, 1.90), "jackal": (18.431, 2.0, np.pi / 6.0 / 0.2)}

OTHER = """
<mujoco>
  <worldbody>
    <body name="base"><freejoint/>
      <inertial pos="0 0 0.08" mass="7.4" diaginertia="0.0663 0.0663 0.0833"/>
      <geom name="hull" type="sphere" size="0.17" pos="0 0 0.1" mass="0" contype="2" conaffinity="6" condim="3"
            solref="0.05 1"/>
      <geom type="sphere" size="0.02" pos="0.12 0 0.02" mass="0" contype="1" conaffinity="0" condim="1" priority="1"/>
      <geom type="sphere" size="0.02" pos="-0.12 0 0.02" mass="0" contype="1" conaffinity="0" condim="1" priority="1"/>
      <body pos="0 0.12 0.06"><joint name="wl" axis="0 1 0" armature="0.004"/>
        <geom type="sphere" size="0.06" mass="0.3" contype="1" conaffinity="0" friction="0.8" priority="1"/></body>
      <body pos="0 -0.12 0.06"><joint name="wr" axis="0 1 0" armature="0.004"/>
        <geom type="sphere" size="0.06" mass="0.3" contype="1" conaffinity="0" friction="0.8" priority="1"/></body>
    </body>
  </worldbody>
  <actuator><motor name="m1" joint="wl"/><motor name="m2" joint="wr"/></actuator>
</mujoco>
"""
SAID = """
max_speed = 0.7
max_yaw_rate = 1.5
[names]
robot = "base"
bumper = "hull"
left_wheel = "wl"
right_wheel = "wr"
[drive]
forward_gain = 80
forward_force = 32
yaw_gain = 8
yaw_torque = 4
"""


def driven(robot: str, speed: float, yaw_rate: float) -> np.ndarray:
    """Twist of the only agent after 2 s of one command, in free space."""
    environment = socialnav_mj.load("scenario_1", dataset=TINY, robot=robot)
    limits = Limits.of(environment.task.scenario)
    time_step = environment.reset()
    while not time_step.observation["active"].any():
        time_step = environment.step(np.zeros(environment.action_spec().shape))
    for _ in range(10):
        time_step = environment.step(limits.wheel_speed(np.array([[speed, yaw_rate]])))
    return np.asarray(time_step.observation["twist"][0])


def test_shipped_robots_are_those_with_a_source_for_every_number() -> None:
    assert set(shipped_robots()) == set(SHIPPED)
    for name in SHIPPED:
        text = (assets_folder() / "robots" / f"{name}.toml").read_text()
        numbers = [line for line in text.splitlines() if " = " in line and not line.startswith(("#", "model"))]
        assert len(numbers) == 5 and all("#" in line and "[" in line for line in numbers)


@pytest.mark.parametrize("name", SHIPPED)
def test_limits_of_shipped_robots_hold_in_the_physics(name: str) -> None:
    mass, speed, yaw_rate = SHIPPED[name]
    environment = socialnav_mj.load("scenario_1", dataset=TINY, robot=name)
    model = environment.physics.model
    assert model.body_subtreemass[model.body("agent_000/robot").id] == pytest.approx(mass)
    assert environment.task.scenario.max_yaw_rate == pytest.approx(yaw_rate)
    # Far beyond what it can: the wheels roll a little short, see tests/test_robot.py.
    assert driven(name, 0.0, 99.0)[1] == pytest.approx(yaw_rate, rel=0.02)
    assert driven(name, min(speed, 0.46), 0.0)[0] == pytest.approx(min(speed, 0.46), rel=0.02)


def test_policies_and_planners_act_within_the_robots_limits() -> None:
    environment = socialnav_mj.load("scenario_4", dataset=TINY, robot="turtlebot4")
    limits = Limits.of(environment.task.scenario)
    highest = limits.wheel_speed(np.array([[0.46, 1.9]])).max()
    for spec in ("replay_irl", "orca"):
        controller, time_step = make_controller(spec), environment.reset()
        controller.reset(limits)
        for _ in range(12):
            action = controller.act(time_step.observation)
            assert np.abs(action).max() <= highest + 1e-9
            time_step = environment.step(action)


def test_model_with_other_names_and_motors_is_driven_by_servos_of_its_toml(tmp_path: Path) -> None:
    (tmp_path / "mine.xml").write_text(OTHER)
    (tmp_path / "mine.toml").write_text(SAID)
    path = str(tmp_path / "mine.xml")
    file = read_robot(path)
    assert (file.robot.model, file.robot.max_speed, file.robot.radius) == (path, 0.7, 0.17)
    assert driven(path, 0.7, 0.0)[0] == pytest.approx(0.7, rel=0.02)
    assert driven(path, 0.0, 9.0)[1] == pytest.approx(1.5, rel=0.03)
    (tmp_path / "mine.toml").write_text(SAID.replace('"hull"', '"hat"'))
    with pytest.raises(ValueError, match="there is no bumper named 'hat'"):
        socialnav_mj.load("scenario_1", dataset=TINY, robot=path)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("max_speed = 9.0", "Robot.max_speed = 9.0 is not allowed"),
        ("colour = 1", "colour is unknown; available: model, radius"),
        ("x", "is no TOML"),
        ("[names]\nwheel = 'a'", "is not allowed; allowed: robot, bumper, left_wheel, right_wheel"),
        ("[drive]\nforward_gain = 1", "[drive] lacks forward_force, yaw_gain, yaw_torque"),
    ],
)
def test_wrong_robot_files_are_refused(text: str, named: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(ValueError, match=r".") as caught:
        read_robot(tmp_path / "mine.xml")
    assert named in str(caught.value)


def test_unknown_robot_says_what_there_is_and_a_drives_limit_joins_the_turn_limit() -> None:
    with pytest.raises(FileNotFoundError, match="no robot 'rover': available are jackal, turtlebot4, or the path of"):
        robot_settings("rover")
    slow = Scenario().changed(robot_max_yaw_rate=1.0)
    assert slow.max_yaw_rate == 1.0 and slow.changed(turn_limit="per_second").max_yaw_rate == pytest.approx(np.pi / 6)
    assert Scenario.from_dict(slow.as_dict()) == slow
