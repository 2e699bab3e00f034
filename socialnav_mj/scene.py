"""Assembly of the MJCF scene: the arena, a pool of robots, a pool of pedestrians."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from socialnav_mj.config import Robot, Scenario
from socialnav_mj.geometry import Array
from socialnav_mj.resources import assets_folder
from socialnav_mj.robot_files import read_robot

AGENT_PREFIX = "agent_"
PEDESTRIAN_PREFIX = "pedestrian_"
REARM_TIME = "contact_rearm_time"
"""Name of the model's number that says how long two bodies must be apart before a touch counts as new [s]."""
AGENT_SLOTS = "agent_slots"
"""Name of the model's number of slots for robots; a pool that grows has fewer robots at first."""
UNICYCLE = "unicycle"
"""Name of the number that a model has whose robots follow their commands exactly."""
PERSON_MASS = 75.0
"""Of a person who yields: the effective mass behind a lower leg, ISO/TS 15066 table A.3, an adult's [kg]."""
_TOLERANCE = 1e-6


def agent_name(slot: int) -> str:
    """Prefix of all names of one robot.

    Args:
        slot: Place in the pool of robots, from 0.

    Returns:
        "agent_003/" for slot 3.
    """
    return f"{AGENT_PREFIX}{slot:03d}/"


def pedestrian_name(slot: int) -> str:
    """Prefix of all names of one pedestrian.

    Args:
        slot: Place in the pool of pedestrians, from 0.

    Returns:
        "pedestrian_003/" for slot 3.
    """
    return f"{PEDESTRIAN_PREFIX}{slot:03d}/"


def build_model(
    scenario: Scenario,
    *,
    n_agent_slots: int,
    n_pedestrian_slots: int,
    low: Array,
    high: Array,
    n_robots: int | None = None,
    is_drawn: bool = True,
) -> mujoco.MjModel:
    """Compile the arena with a pool of robots and a pool of pedestrians, apart from one another on the floor.

    Args:
        scenario: Gives the robot and its limits, kind and radius of people, the physics time step and the re-arm time
            of contacts.
        n_agent_slots: Robots that can be in the scene at once, >= 1.
        n_pedestrian_slots: People in the pool, >= 1.
        low: Least coordinates of the recorded crowd, shape (2,) [m].
        high: Greatest coordinates, shape (2,) [m].
        n_robots: Robots in the pool, for the first of the slots; for all of them by default.
        is_drawn: Whether robots and people have the parts that are for the eye alone. They touch nothing and weigh
            nothing, but every step works out where they are.

    Returns:
        The model. Robots are compiled with gravity compensation, so that parked ones need no floor.

    Raises:
        FileNotFoundError: If the robot's MJCF file does not exist.
        ValueError: If the MJCF file contradicts the robot's configuration.
    """
    assets = assets_folder()
    arena = mujoco.MjSpec.from_file(str(assets / "arena.xml"))
    arena.option.timestep = scenario.physics_timestep
    arena.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    arena.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    _aim_cameras(arena, low=low, high=high)

    # What a slot needs that is in use, and when touches count: a copy of the physics has only the model to read.
    arena.nuser_geom = 2
    _note_contacts(arena)
    count = n_agent_slots if n_robots is None else n_robots
    robot, person = _robot(scenario, assets, is_drawn=is_drawn), _person(scenario, assets, is_drawn=is_drawn)
    _attach_pool(arena, robot, prefix=AGENT_PREFIX, count=count, row=0)
    _attach_pool(arena, person, prefix=PEDESTRIAN_PREFIX, count=n_pedestrian_slots, row=1)
    arena.add_numeric(name=REARM_TIME, data=[scenario.contact_rearm_time], size=1)
    arena.add_numeric(name=AGENT_SLOTS, data=[n_agent_slots], size=1)
    if scenario.plant == "unicycle":
        arena.add_numeric(name=UNICYCLE, data=[1.0], size=1)
    model = arena.compile()
    _check_robot(model, scenario.robot)
    return model


def _attach_pool(arena: mujoco.MjSpec, member: mujoco.MjSpec, *, prefix: str, count: int, row: int) -> None:
    """Attach copies of a robot or person, apart on the floor: in one heap 86 robots have 4600 contacts to be solved.

    What an attachment costs grows with the scene, so that tens and hundreds of them are put together first; their
    names are made of a digit each. The model is the same as if they were attached one by one.

    Args:
        arena: Gets them.
        member: Whose names begin with "/"; is not changed.
        prefix: Of all names; three digits follow it.
        count: How many.
        row: Where they stand: those of another row are 2 m away.
    """
    blocks = [member]
    while len(blocks) < 3 and count >= 10 ** len(blocks):
        ten = mujoco.MjSpec()
        for k in range(10):
            place = ten.worldbody.add_frame(pos=[2.0 * 10 ** (len(blocks) - 1) * k, 0.0, 0.0])
            ten.attach(blocks[-1].copy(), prefix=f"{k}", frame=place)
        blocks.append(ten)
    slot = 0
    for power in reversed(range(len(blocks))):
        size = 10**power
        while slot + size <= count:
            place = arena.worldbody.add_frame(pos=[2.0 * slot, 2.0 * row, 0.0])
            arena.attach(blocks[power].copy(), prefix=f"{prefix}{slot // size:0{3 - power}d}", frame=place)
            slot += size


def _robot(scenario: Scenario, assets: Path, *, is_drawn: bool) -> mujoco.MjSpec:
    """A robot for the pool."""
    robot = robot_spec(_robot_file(scenario.robot, assets), scenario.robot)
    if not is_drawn:
        _delete_visuals(robot)
    robot.geom("bumper").size[0] = scenario.robot.radius
    if scenario.floor_friction is not None:
        for wheel in ("left_wheel", "right_wheel"):
            robot.geom(wheel).friction[0] = scenario.floor_friction
    robot.actuator("forward").ctrlrange = [0.0, scenario.robot.max_speed]
    robot.actuator("yaw").ctrlrange = [-scenario.max_yaw_rate, scenario.max_yaw_rate]
    for body in robot.bodies[1:]:
        body.gravcomp = 1.0
    robot.body("robot").sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER  # the physics lets parked ones sleep
    return _member(robot)


def _person(scenario: Scenario, assets: Path, *, is_drawn: bool) -> mujoco.MjSpec:
    """A person for the pool; one who yields is in a body that slides along x and y and bears a person's mass."""
    person = mujoco.MjSpec.from_file(str(assets / "pedestrian.xml"))
    if not is_drawn:
        _delete_visuals(person)
    person.geom("body").size[0] = scenario.pedestrian_radius
    if scenario.pedestrian_body == "rigid":
        return _member(person)
    person.body("pedestrian").mocap = False
    whole = mujoco.MjSpec()
    # The inertia is never felt: the body does not turn, but the person in it, by its quaternion.
    mass = {"explicitinertial": True, "mass": PERSON_MASS, "ipos": [0.0, 0.0, 0.9], "inertia": [10.0, 10.0, 1.0]}
    carrier = whole.worldbody.add_body(name="/carrier", **mass)
    for axis, way in (("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0])):
        carrier.add_joint(name=f"/{axis}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=way)
    carrier.sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
    return _member(person, whole, carrier)


def _delete_visuals(spec: mujoco.MjSpec) -> None:
    """Delete what is for the eye alone, unless something in the model measures or pulls there."""
    trial = spec.copy()
    for attempt in (trial, spec):
        seen = [geom for geom in attempt.geoms if geom.mass == 0.0 and not (geom.contype or geom.conaffinity)]
        for part in (*seen, *attempt.sites, *attempt.cameras, *attempt.lights):
            attempt.delete(part)
        try:
            trial.compile()
        except ValueError:  # it refers to one of them
            return


def _member(spec: mujoco.MjSpec, whole: mujoco.MjSpec | None = None, body: Any = None) -> mujoco.MjSpec:
    """What is attached many times: with "/" before all names, and without the classes, which are most of its memory."""
    _note_contacts(spec)
    _forget_classes(spec)
    whole = mujoco.MjSpec() if whole is None else whole
    whole.attach(spec, prefix="/", frame=(body or whole.worldbody).add_frame())
    return whole


def _note_contacts(spec: mujoco.MjSpec) -> None:
    for geom in spec.geoms:
        geom.userdata = [geom.contype, geom.conaffinity]


def _forget_classes(spec: mujoco.MjSpec) -> None:
    """Delete the default classes of a model that has been read: its elements have taken their values already."""
    parts = (spec.geoms, spec.sites, spec.joints, spec.cameras, spec.lights, spec.actuators)
    names = set()
    for part in (part for kind in parts for part in kind):
        names.add(part.classname.name)
        part.classname = spec.default
    for name in sorted(names - {spec.default.name}):
        if (unused := spec.find_default(name)) is not None:
            spec.delete(unused)


def _robot_file(robot: Robot, assets: Path) -> Path:
    path = assets / robot.model
    if not path.is_file():
        raise FileNotFoundError(f"Robot.model = {robot.model!r}: there is no file {path}")
    return path


def robot_spec(path: Path, robot: Robot) -> mujoco.MjSpec:
    """Read the model of a robot, with the names and servos that its TOML says, if there is one beside it.

    Args:
        path: Of the MJCF file.
        robot: Its dimensions, by which servos are made.

    Returns:
        A model whose parts go by our names.

    Raises:
        ValueError: If the model has no such part.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    if not path.with_suffix(".toml").is_file():
        return spec
    file = read_robot(path)
    for part, name in file.names.items():
        found = {"robot": spec.body, "bumper": spec.geom}.get(part, spec.joint)(name)
        if found is None:
            raise ValueError(f"{path}: there is no {part} named {name!r}, as {path.with_suffix('.toml').name} says")
        found.name = part
        if part == "robot":
            for joint in found.joints:
                joint.name = "root"  # the free joint; a robot has no other one there
        if part.endswith("wheel"):
            found.parent.geoms[0].name = part
    if file.drive:
        for actuator in spec.actuators:
            spec.delete(actuator)
        turn = robot.wheel_radius / robot.track
        for name, coefficients, gain, most in (
            ("forward", (0.5 * robot.wheel_radius,) * 2, file.drive["forward_gain"], file.drive["forward_force"]),
            ("yaw", (-turn, turn), file.drive["yaw_gain"], file.drive["yaw_torque"]),
        ):
            tendon = spec.add_tendon(name=name)
            for wheel, coefficient in zip(("left_wheel", "right_wheel"), coefficients, strict=True):
                tendon.wrap_joint(wheel, coefficient)
            servo = spec.add_actuator(
                name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON, forcerange=[-most, most], forcelimited=True
            )
            servo.set_to_velocity(kv=gain)
            servo.ctrllimited = True
    return spec


def _check_robot(model: mujoco.MjModel, robot: Robot) -> None:
    """Compare the wheels and tendons of the MJCF file with the configuration that maps wheel speeds to twists."""
    prefix = agent_name(0)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    left = data.joint(prefix + "left_wheel").xanchor
    right = data.joint(prefix + "right_wheel").xanchor
    half = {"forward": (0.5, 0.5), "yaw": (-1.0 / robot.track, 1.0 / robot.track)}
    found = {
        "track": (float(np.linalg.norm(left - right)), robot.track),
        "wheel_radius": (float(model.geom(prefix + "left_wheel").size[0]), robot.wheel_radius),
    }
    for tendon, (left_gain, right_gain) in half.items():
        address = model.tendon_adr[model.tendon(prefix + tendon).id]
        coefficients = dict(
            zip(model.wrap_objid[address : address + 2], model.wrap_prm[address : address + 2], strict=True)
        )
        for wheel, gain in (("left_wheel", left_gain), ("right_wheel", right_gain)):
            joint = model.joint(prefix + wheel).id
            found[f"{tendon} tendon's {wheel} coefficient"] = (coefficients[joint], gain * robot.wheel_radius)
    for name, (given, wanted) in found.items():
        if abs(given - wanted) > _TOLERANCE:
            raise ValueError(f"{robot.model}: {name} is {given:.6g}, but the Robot configuration says {wanted:.6g}")


def _aim_cameras(arena: mujoco.MjSpec, *, low: Array, high: Array) -> None:
    """Centre floor, light and cameras on the crowd, with a view of all of it."""
    centre, size = 0.5 * (low + high), max(float(np.max(high - low)), 1.0)
    arena.stat.center = [*centre, 0.0]
    arena.stat.extent = size
    arena.geom("floor").pos[:2] = centre
    arena.light("sun").pos[:2] += centre
    arena.camera("top").pos[:2] = centre
    arena.camera("top").fovy = 1.1 * size  # orthographic: the height of the view [m]
    oblique = arena.camera("oblique")
    distance = 0.6 * size / np.tan(np.radians(0.5 * oblique.fovy))
    oblique.pos = np.array([*centre, 0.0]) + oblique.pos / np.linalg.norm(oblique.pos) * distance
