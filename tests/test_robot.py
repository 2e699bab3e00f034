"""What the robot, the pedestrian and the arena do as bodies, held with tolerances near the measured figures."""

from math import atan2, cos, degrees, hypot, log, pi, sin, sqrt
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import unit_vector

from socialnav_mj.config import Robot, Scenario
from socialnav_mj.geometry import quaternion_of_yaw, wrap_angle, yaw_of_quaternion
from socialnav_mj.resources import assets_folder

Array = NDArray[np.float64]

TIMESTEP = 0.01  # [s]
MAX_YAW_RATE = pi / 6.0 / 0.2  # [rad/s]
CONTROLS = ("forward", "yaw")
TIPPING_ANGLE = degrees(atan2(0.12 / sqrt(2.0), 0.08))  # wheels and casters on a diamond, centre of mass: 47 degrees
WALKER, RUNNER = 1.3, 2.5  # [m/s]
SERVO_FORCE, SERVO_GAIN = 32.0, 80.0  # [N], [N s/m]


class World:
    """A compiled arena with agents and pedestrians; the pedestrians wait far away until they are moved."""

    def __init__(self, n_agents: int = 1, n_pedestrians: int = 0, *, robot: str = "robot") -> None:
        """Attach copies of the models to the arena, as the scene does."""
        spec = mujoco.MjSpec.from_file(str(assets_folder() / "arena.xml"))
        for name, prefix, count in ((robot, "agent", n_agents), ("pedestrian", "pedestrian", n_pedestrians)):
            for index in range(count):
                child = mujoco.MjSpec.from_file(str(assets_folder() / f"{name}.xml"))
                spec.attach(child, prefix=f"{prefix}_{index:03d}/", frame=spec.worldbody.add_frame())
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        self.root = self.data.qpos[: 9 * n_agents].reshape(n_agents, 9)  # x y z, quaternion, two wheels
        self.speeds = self.data.qvel[: 8 * n_agents].reshape(n_agents, 8)
        self.twist = self.data.ctrl.reshape(n_agents, 2)
        self.data.mocap_pos[:, 0] = 100.0 + np.arange(n_pedestrians)
        mujoco.mj_forward(self.model, self.data)

    def place(self, agent: int, x: float, y: float, heading: float) -> None:
        """Put an agent down."""
        self.root[agent, :3] = x, y, 0.0
        self.root[agent, 3:7] = quaternion_of_yaw(heading)

    def step(self) -> None:
        """One physics step."""
        mujoco.mj_step(self.model, self.data)

    def drive(self, forward: float, yaw_rate: float, duration: float) -> Array:
        """Hold a twist with agent 0; rows of time, x, y, heading, forward speed, yaw rate, tilt [degrees]."""
        self.twist[0] = forward, yaw_rate
        rows = []
        for _ in range(round(duration / TIMESTEP)):
            self.step()
            heading = float(yaw_of_quaternion(self.root[0, 3:7]))
            speed = self.speeds[0, 0] * cos(heading) + self.speeds[0, 1] * sin(heading)
            rows.append(
                (self.data.time, *self.root[0, :2], heading, speed, self.speeds[0, 5], float(np.max(self.tilt())))
            )
        return np.array(rows)

    def tilt(self) -> Array:
        """Angle between each agent's mast and the vertical, shape (n_agents,) [degrees]."""
        upright: Array = 1.0 - 2.0 * (self.root[:, 4] ** 2 + self.root[:, 5] ** 2)
        return np.degrees(np.arccos(np.clip(upright, -1.0, 1.0)))

    def touching(self) -> set[tuple[str, str]]:
        """Names of the geoms in contact, sorted within a pair."""
        names = [[self.model.geom(g).name for g in pair] for pair in self.data.contact.geom]
        return {(min(pair), max(pair)) for pair in names}


def rolling(twist: tuple[float, float] = (0.0, 0.0), n_pedestrians: int = 0) -> World:
    """A world whose agent has settled for half a second and driven the twist for one and a half."""
    world = World(1, n_pedestrians)
    world.drive(0.0, 0.0, 0.5)
    world.drive(*twist, 1.5)
    return world


def unicycle(pose: Array, twists: Array) -> Array:
    """Poses of an ideal unicycle after each step of a sequence of twists, by exact arcs; shape (n, 3)."""
    poses = []
    for forward, yaw_rate in twists:
        half = 0.5 * yaw_rate * TIMESTEP
        chord = forward * TIMESTEP * np.sinc(half / pi)
        pose = pose + np.array([chord * cos(pose[2] + half), chord * sin(pose[2] + half), 2.0 * half])
        poses.append(pose)
    return np.array(poses)


@pytest.mark.parametrize("name", ["robot.xml", "pedestrian.xml", "arena.xml"])
def test_model_file_alone_loads(name: str) -> None:
    mujoco.MjModel.from_xml_path(str(assets_folder() / name))


def test_elements_have_the_names_that_the_scene_uses() -> None:
    model = World(2, 1).model
    for name in ("agent_000", "agent_001"):
        assert model.body(f"{name}/robot").jntadr == model.joint(f"{name}/root").id
        for geom in ("bumper", "left_wheel", "right_wheel", "front_caster", "rear_caster"):
            assert model.geom(f"{name}/{geom}").group == 3
        assert model.camera(f"{name}/follow").bodyid == model.body(f"{name}/robot").id
    assert model.body("pedestrian_000/pedestrian").mocapid == 0
    assert model.geom("pedestrian_000/body").type == mujoco.mjtGeom.mjGEOM_CAPSULE
    assert [model.actuator(i).name for i in range(4)] == [f"agent_00{i}/{kind}" for i in (0, 1) for kind in CONTROLS]
    assert [model.tendon(i).name for i in range(4)] == [f"agent_00{i}/{kind}" for i in (0, 1) for kind in CONTROLS]
    assert {"top", "oblique"} <= {model.camera(i).name for i in range(model.ncam)}
    for material in ("self", "effector", "target"):
        np.testing.assert_array_equal(model.material(material).rgba, model.material(f"{material}_default").rgba)
        model.material(f"{material}_highlight")


def test_contact_bits_let_each_kind_touch_only_its_partners() -> None:
    world = World(2, 2)
    world.place(0, 0.0, 0.0, 0.3)
    world.place(1, 0.25, 0.0, -1.0)
    world.data.mocap_pos[:] = [[0.0, 0.25, 0.0], [0.0, 0.3, 0.0]]
    mujoco.mj_forward(world.model, world.data)
    floor = {(f"agent_00{i}/{g}", "floor") for i in (0, 1) for g in ("left_wheel", "right_wheel")}
    floor |= {(f"agent_00{i}/{g}", "floor") for i in (0, 1) for g in ("front_caster", "rear_caster")}
    bumpers = {("agent_000/bumper", "agent_001/bumper")}
    people = {("agent_000/bumper", f"pedestrian_00{i}/body") for i in (0, 1)}
    assert world.touching() - floor == bumpers | people
    assert world.touching() <= floor | bumpers | people
    drawn = world.model.geom_group == 1
    assert not world.model.geom_contype[drawn].any() and not world.model.geom_conaffinity[drawn].any()


def test_contact_parameters_are_the_intended_mix() -> None:
    world = rolling(n_pedestrians=1)
    world.data.mocap_pos[0] = [*(world.root[0, :2] + [0.3, 0.0]), 0.0]
    mujoco.mj_forward(world.model, world.data)
    expected = {"wheel": (3, 0.8, 0.04), "caster": (1, None, 0.04), "body": (3, 0.3, 0.05)}
    seen = set()
    for contact in world.data.contact:
        name = next(k for k in expected for g in contact.geom if world.model.geom(g).name.endswith(k))
        dimension, friction, time_constant = expected[name]
        seen.add(name)
        assert contact.dim == dimension
        assert friction is None or contact.friction[0] == pytest.approx(friction)
        assert contact.solref == pytest.approx([time_constant, 1.0])
    assert seen == set(expected)


@pytest.mark.parametrize("direction", [0.0, 1.0, 2.5])
def test_bodies_touch_at_the_sum_of_their_radii(direction: float) -> None:
    world = rolling(n_pedestrians=1)
    reach = Scenario().contact_distance
    for distance, expected in ((reach + 0.001, False), (reach - 0.001, True)):
        world.data.mocap_pos[0, :2] = world.root[0, :2] + distance * unit_vector(direction)
        world.data.mocap_pos[0, 2] = 0.0
        mujoco.mj_forward(world.model, world.data)
        assert (("agent_000/bumper", "pedestrian_000/body") in world.touching()) is expected
    (contact,) = [c for c in world.data.contact if world.model.geom("pedestrian_000/body").id in c.geom]
    assert abs(contact.frame[2]) < 1e-6  # a horizontal push
    assert contact.dist == pytest.approx(-0.001, abs=1e-6)


def test_dimensions_agree_with_the_configuration() -> None:
    model, robot = World(1, 1).model, Robot()
    assert model.geom("agent_000/bumper").size[0] == robot.radius
    assert model.geom("pedestrian_000/body").size[0] == Scenario().pedestrian_radius
    for side, sign in (("left", 1.0), ("right", -1.0)):
        np.testing.assert_allclose(
            model.body(f"agent_000/{side}_wheel").pos, [0.0, sign * 0.5 * robot.track, robot.wheel_radius]
        )
        assert model.geom(f"agent_000/{side}_wheel").size[0] == robot.wheel_radius
        tyre = model.site(f"agent_000/{side}_tyre").size  # radius, half width
        assert tyre[0] == robot.wheel_radius
        assert hypot(tyre[0], 0.5 * robot.track + tyre[1]) < robot.radius
    half, turn = 0.5 * robot.wheel_radius, robot.wheel_radius / robot.track
    np.testing.assert_allclose(model.wrap_prm, [half, half, -turn, turn])
    np.testing.assert_allclose(model.actuator_ctrlrange, [[0.0, 1.0], [-MAX_YAW_RATE, MAX_YAW_RATE]], atol=1e-3)


def test_mass_is_8_kg_and_sits_above_the_axle() -> None:
    world = World(1)
    body = world.model.body("agent_000/robot").id
    assert world.model.body_subtreemass[body] == pytest.approx(8.0)
    np.testing.assert_allclose(world.data.subtree_com[body], [0.0, 0.0, 0.08], atol=1e-4)


def test_models_have_few_geoms() -> None:
    assert World(1).model.ngeom - 1 <= 10
    assert World(0, 1).model.ngeom - 1 <= 6


def test_robot_at_rest_does_not_drift() -> None:
    world = rolling()
    rows = world.drive(0.0, 0.0, 10.0)
    assert np.ptp(rows[:, 1:3], axis=0).max() < 1e-5  # [m]
    assert np.ptp(rows[:, 3]) < 1e-6
    assert -0.001 < world.root[0, 2] < 0.0  # sinks in by less than a millimetre
    load = [
        world.data.efc_force[contact.efc_address]
        for contact in world.data.contact
        if contact.dim == 1  # casters
    ]
    assert sum(load) == pytest.approx(0.5 * 8.0 * 9.81, rel=0.03)  # wheels keep the other half


@pytest.mark.parametrize("forward", [0.0, 0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("yaw_rate", [-MAX_YAW_RATE, -0.5, 0.0, 1.5, MAX_YAW_RATE])
def test_held_twist_is_tracked(forward: float, yaw_rate: float) -> None:
    world = rolling((forward, yaw_rate))
    start = np.array([*world.root[0, :2], float(yaw_of_quaternion(world.root[0, 3:7]))])
    rows = world.drive(forward, yaw_rate, 2.0)
    # 0.3 % is the wheels' sinking; the rest is the tyres' creep under the sideways load forward * yaw_rate.
    load = forward * abs(yaw_rate)  # [m/s^2]
    assert abs(rows[:, 4].mean() - forward) < 0.0005 + 0.004 * forward + 0.006 * load
    assert abs(rows[:, 5].mean() - yaw_rate) < 0.0005 + 0.004 * abs(yaw_rate) + 0.004 * load
    ideal = unicycle(start, np.tile([forward, yaw_rate], (len(rows), 1)))
    error = np.hypot(*(rows[:, 1:3] - ideal[:, :2]).T)
    assert error.max() < 0.002 + 0.008 * forward + 0.025 * load
    assert rows[:, 6].max() < 0.2


def test_changing_twist_is_followed_within_the_servo_lag() -> None:
    world = rolling((0.5, 0.0))
    start = np.array([*world.root[0, :2], 0.0])
    times = 0.2 * np.arange(40)
    twists = np.stack([0.5 + 0.4 * np.sin(times), 1.2 * np.sin(1.7 * times)], axis=-1)
    ideal = unicycle(start, np.repeat(twists, 20, axis=0))
    rows = np.concatenate([world.drive(forward, yaw_rate, 0.2) for forward, yaw_rate in twists])
    error = np.hypot(*(rows[:, 1:3] - ideal[:, :2]).T)
    assert error.max() < 0.16  # 0.13 s of lag at 0.9 m/s is 0.12 m
    assert np.abs(wrap_angle(rows[:, 3] - ideal[:, 2])).max() < 0.12


def test_speed_rises_as_fast_as_the_servo_and_the_grip_allow() -> None:
    rows = rolling().drive(1.0, 0.0, 2.0)
    elapsed = rows[:, 0] - rows[0, 0] + TIMESTEP
    rise = elapsed[np.argmax(rows[:, 4] > 0.9)]
    inertia = 8.0 + 2.0 * (0.004 + 5.4e-4) / 0.06**2  # wheels and rotors, seen from the floor [kg]
    knee = 1.0 - SERVO_FORCE / SERVO_GAIN  # the servo leaves its limit there [m/s]
    ideal = knee * inertia / SERVO_FORCE + inertia / SERVO_GAIN * log((1.0 - knee) / 0.1)
    assert ideal <= rise < 1.3 * ideal
    assert rows[:, 4].max() < 1.001


def test_robot_stops_from_1_m_per_s_within_a_quarter_of_a_metre() -> None:
    world = rolling((1.0, 0.0))
    start = world.root[0, 0]
    rows = world.drive(0.0, 0.0, 2.0)
    inertia = 8.0 + 2.0 * (0.004 + 5.4e-4) / 0.06**2
    knee = SERVO_FORCE / SERVO_GAIN
    ideal = (1.0 - knee**2) * inertia / (2.0 * SERVO_FORCE) + knee * inertia / SERVO_GAIN
    assert 0.99 * ideal < rows[-1, 1] - start < 1.25 * ideal
    assert rows[:, 4].min() > -0.001  # does not roll back
    assert rows[:, 6].max() < 0.2


@pytest.mark.parametrize(("yaw_rate", "overshoot"), [(0.5, 0.13), (1.5, 0.07), (MAX_YAW_RATE, 0.035)])
def test_yaw_step_is_fast_and_hardly_overshoots(yaw_rate: float, overshoot: float) -> None:
    rows = rolling().drive(0.0, yaw_rate, 1.0)
    elapsed = rows[:, 0] - rows[0, 0] + TIMESTEP
    assert elapsed[np.argmax(rows[:, 5] > 0.9 * yaw_rate)] <= 0.1
    assert rows[:, 5].max() < (1.0 + overshoot) * yaw_rate
    assert np.hypot(rows[:, 1], rows[:, 2]).max() < 1e-6


def test_control_range_limits_the_twist_and_lets_the_limit_through() -> None:
    assert rolling().drive(5.0, 0.0, 2.0)[-1, 4] == pytest.approx(1.0, rel=0.005)
    assert rolling().drive(-5.0, 0.0, 1.0)[-1, 4] == pytest.approx(0.0, abs=1e-6)
    for sign in (-1.0, 1.0):
        assert rolling().drive(0.0, sign * 9.0, 2.0)[-1, 5] == pytest.approx(sign * MAX_YAW_RATE, rel=0.005)


@pytest.mark.parametrize("forward", [0.0, 0.6, 1.0])
def test_left_and_right_turns_are_mirror_images(forward: float) -> None:
    left, right = (World(1).drive(forward, sign * 1.7, 3.0) for sign in (1.0, -1.0))
    mirror = np.array([1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0])
    np.testing.assert_allclose(left[:, :6], (right * mirror)[:, :6], atol=1e-8)


def hit(forward: float, walker_speed: float, offset: float) -> tuple[float, float, float]:
    """Largest tilt [degrees] and speed [m/s] of a robot that somebody walks into, and where it ends sideways [m]."""
    world = rolling((forward, 0.0), n_pedestrians=1)
    start, tilt, speed = float(world.root[0, 0]), 0.0, 0.0
    start -= np.sign(walker_speed) * 1.2
    for step in range(200):
        world.data.mocap_pos[0] = start + walker_speed * step * TIMESTEP, offset, 0.0
        world.step()
        tilt = max(tilt, float(world.tilt()[0]))
        speed = max(speed, float(np.hypot(*world.speeds[0, :2])))
    return tilt, speed, float(world.root[0, 1])


@pytest.mark.parametrize("offset", [0.0, 0.03, 0.1, 0.2])
@pytest.mark.parametrize(("forward", "walker_speed"), [(1.0, -WALKER), (0.0, RUNNER)], ids=["head-on", "from behind"])
def test_robot_that_is_hit_does_not_tip(forward: float, walker_speed: float, offset: float) -> None:
    tilt, speed, sideways = hit(forward, walker_speed, offset)
    assert tilt < 0.3 * TIPPING_ANGLE
    assert speed < 1.25 * abs(walker_speed)
    if offset:
        mirrored = hit(forward, walker_speed, -offset)
        assert mirrored[2] == pytest.approx(-sideways, abs=0.02)
        if forward == 0.0:
            assert sideways < 0.0  # pushed aside; a driving robot is turned as well


def test_nobody_is_thrown_out_of_a_crowd_or_left_lying() -> None:
    """As dense as students003 (33 people and 24 robots in 14 x 14 m), but blind: they walk into everything."""
    n_agents, n_pedestrians, side = 24, 33, 14.0
    world, random = World(n_agents, n_pedestrians), np.random.default_rng(0)
    for index in range(n_agents):
        world.place(index, 2.0 * (index % 6) + 1.5, 3.0 * (index // 6) + 1.5, random.uniform(-pi, pi))
    goal = random.uniform(1.0, side - 1.0, (n_agents, 2))
    origin = random.uniform(0.0, side, (n_pedestrians, 2))
    velocity = random.uniform(0.3, 1.6, (n_pedestrians, 1)) * unit_vector(random.uniform(-pi, pi, n_pedestrians))
    tilt = speed = 0.0
    hits = 0
    for step in range(1500):
        if step % 20 == 0:
            away = goal - world.root[:, :2]
            turn = wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - yaw_of_quaternion(world.root[:, 3:7]))
            world.twist[:] = np.stack([np.clip(np.cos(turn), 0.0, 1.0), 2.0 * turn], axis=-1)
        # To and fro between walls, so that nobody jumps (a triangle wave of the straight path).
        path = origin + velocity * step * TIMESTEP
        world.data.mocap_pos[:, :2] = side - np.abs(path % (2.0 * side) - side)
        world.data.mocap_pos[:, 2] = 0.0
        world.step()
        tilt = max(tilt, float(world.tilt().max()))
        speed = max(speed, float(np.hypot(*world.speeds[:, :2].T).max()))
        hits += int((world.data.contact.geom != world.model.geom("floor").id).all(axis=1).sum())
    assert hits > 500  # contacts between bodies, counted every step
    assert not world.data.warning.number.any()
    assert speed < 4.0  # MuJoCo's default solref throws robots out at up to 17 m/s
    assert tilt < TIPPING_ANGLE
    assert world.tilt().max() < 0.5 * TIPPING_ANGLE
