"""What is true: contacts, their pairs, velocities and impulses, and what happens to an invalid state."""

import os
import pickle
from math import ceil
from pathlib import Path

import mujoco
import numpy as np
import pytest
from dm_control.rl.control import PhysicsError
from scenes import TINY, environment_of, stand, state_of, still, walk

import tasks
from socialnav_mj.config import Robot, Scenario
from socialnav_mj.controllers import GoStraight, Limits
from socialnav_mj.episode import Partner
from socialnav_mj.geometry import Array, quaternion_of_yaw
from socialnav_mj.metrics.severity import WEDGE_FORCE
from socialnav_mj.outcome import OVERTURNED_TILT
from socialnav_mj.physics import Physics
from socialnav_mj.resources import assets_folder
from socialnav_mj.rollout import rollout
from socialnav_mj.scene import build_model
from socialnav_mj.touch import Touch, squeeze_force

TIMESTEP = 0.01  # [s]
CONTACT_DISTANCE = 0.17 + 0.15  # [m]
AWAY = (5.0, 5.0)


def physics_of(
    n_agents: int = 1, n_pedestrians: int = 1, *, slippery: bool = False, robot: str = Robot.model
) -> Physics:
    """A pool with agent i standing at (0, 3 i); slippery: wheels without motor or grip, so that robots slide freely."""
    scenario = Scenario(robot=Robot(model=robot))
    bounds = {"low": np.full(2, -5.0), "high": np.full(2, 5.0)}
    model = build_model(scenario, n_agent_slots=n_agents, n_pedestrian_slots=n_pedestrians, **bounds)
    if slippery:
        model.actuator_gainprm[:] = 0.0
        model.actuator_biasprm[:] = 0.0
        wheels = [g for g in range(model.ngeom) if model.geom(g).name.endswith("_wheel")]
        model.geom_friction[wheels] = 1e-4
    physics = Physics.from_mujoco(model)
    with physics.reset_context():
        for slot in range(n_agents):
            physics.place_agent(slot, np.array([0.0, 3.0 * slot]), 0.0)
        everybody = np.arange(n_pedestrians)
        pose = np.tile(AWAY, (n_pedestrians, 1)), quaternion_of_yaw(np.zeros(n_pedestrians))
        physics.set_pedestrian_pose(everybody, *pose)
        physics.set_pedestrian_contacts(everybody, np.ones(n_pedestrians, dtype=bool))
    return physics


def lead(physics: Physics, positions: Array) -> list[Touch]:
    """Move pedestrian 0 along one position a physics step; touches that began."""
    path = np.full((len(positions), physics.n_pedestrians, 2), np.nan)
    path[:, 0] = positions
    velocity = np.zeros_like(path)
    velocity[:-1] = np.diff(path, axis=0) / TIMESTEP
    physics.set_pedestrian_path(path, velocity)
    physics.step(len(positions))
    return physics.new_touches()


def flicker(physics: Physics, *phases: tuple[bool, int]) -> list[Touch]:
    """Touch the robot or stay away for numbers of steps, one after the other."""
    places = {True: lambda: physics.agent_position()[0] + (CONTACT_DISTANCE - 0.01, 0.0), False: lambda: np.array(AWAY)}
    touches = []
    for touching, steps in phases:
        for _ in range(steps):
            touches += lead(physics, places[touching]()[None])
    return touches


# Touches


@pytest.mark.parametrize("control_timestep", [0.1, 0.2])
@pytest.mark.parametrize(("robot", "person"), [(0.17, 0.15), (0.25, 0.15), (0.17, 0.08)])
def test_head_on_touch_of_a_walker_has_the_figures_of_hand_calculation(
    robot: float, person: float, control_timestep: float
) -> None:
    # A robot stands at the origin facing +x; somebody comes from x = 3 m at 1.3 m/s. They touch at the sum of radii.
    sizes = {"robot_radius": robot, "pedestrian_radius": person, "control_timestep": control_timestep}
    environment = environment_of(walk([(0, 0), (10, 0)], 1.0), walk([(3, 0), (-3, 0)], 1.3), agents=[1], **sizes)
    environment.reset()
    while not environment.task.collisions:
        environment.step(still(environment))
    (collision,) = environment.task.collisions
    touch = collision.touch
    time = ceil((3.0 - robot - person) / 1.3 / TIMESTEP) * TIMESTEP  # the first physics step within the distance
    walker = 3.0 - 1.3 * time
    assert touch.kind == Partner.PEDESTRIAN and (collision.agent, collision.partner) == (0, 0)
    assert touch.time == pytest.approx(time, abs=1e-9)
    np.testing.assert_allclose(touch.normal, [1.0, 0.0], atol=1e-4)
    np.testing.assert_allclose(touch.position, [0.5 * (robot + walker - person), 0.0], atol=2e-4)
    np.testing.assert_allclose(touch.agent_velocity, [0.0, 0.0], atol=1e-4)
    np.testing.assert_allclose(touch.partner_velocity, [-1.3, 0.0], atol=1e-9)
    assert (touch.agent_velocity - touch.partner_velocity) @ touch.normal == pytest.approx(1.3, abs=1e-4)
    assert touch.agent_heading == pytest.approx(0.0, abs=1e-6)
    assert touch.partner_heading == pytest.approx(-np.pi, abs=1e-9) or touch.partner_heading == pytest.approx(np.pi)


def test_robot_that_drives_into_a_standing_person_keeps_its_velocity_of_before_the_contact() -> None:
    person = stand((3.0, 0.0), 0.0, 10.0)
    environment = environment_of(walk([(0, 0), (10, 0)], 1.0), person, agents=[1])
    wheel = np.full(environment.action_spec().shape, 0.8 / 0.06)
    environment.reset()
    while not environment.task.collisions:
        environment.step(wheel)
    touch = environment.task.collisions[0].touch
    assert touch.agent_velocity[0] == pytest.approx(0.8, rel=0.01)  # the wheels roll 0.3 % short
    np.testing.assert_allclose(touch.partner_velocity, 0.0, atol=1e-12)
    np.testing.assert_allclose(touch.position, [3.0 - 0.15, 0.0], atol=0.01)


def test_touch_of_two_robots_is_seen_by_both_sides() -> None:
    # Robots 1 m/s towards each other on one line, mirror images: they meet in the middle.
    environment = environment_of(walk([(-3, 0), (3, 0)], 1.0), walk([(3, 0), (-3, 0)], 1.0), agents=[1, 2])
    episode = rollout(environment, GoStraight())
    assert episode.contact_agent[:2].tolist() == [0, 1]
    assert episode.contact_partner[:2].tolist() == [1, 0]
    assert (episode.contact_partner_kind[:2] == Partner.AGENT).all()
    np.testing.assert_allclose(episode.contact_normal[:2], [[1.0, 0.0], [-1.0, 0.0]], atol=1e-3)
    np.testing.assert_allclose(episode.contact_position[:2], 0.0, atol=1e-3)
    np.testing.assert_allclose(episode.contact_agent_velocity[0], -episode.contact_agent_velocity[1], atol=1e-6)
    np.testing.assert_array_equal(episode.contact_agent_velocity[:2], episode.contact_partner_velocity[1::-1])
    assert episode.contact_agent_velocity[0, 0] == pytest.approx(1.0, abs=0.01)
    for column in ("time", "impact_impulse", "impact_force", "duration"):
        first, second = getattr(episode, f"contact_{column}")[:2]
        assert first == second > 0.0


@pytest.mark.parametrize(("apart", "count"), [(1, 1), (19, 1), (20, 2), (40, 2)])
def test_touch_counts_again_only_after_the_rearm_time_apart(apart: int, count: int) -> None:
    touches = flicker(physics_of(), (False, 3), (True, 5), (False, apart), (True, 5))
    assert len(touches) == count
    assert touches[0].time == pytest.approx(0.03)
    if count == 1:
        assert touches[0].last_time == pytest.approx((3 + 5 + apart + 4) * TIMESTEP)
    else:
        assert touches[0].last_time == pytest.approx(0.07)
        assert touches[1].time == pytest.approx((3 + 5 + apart) * TIMESTEP)


def squeeze_of(physics: Physics, *places: Array) -> float:
    """Largest squeeze of any touch while people are led along places, each of shape (k, 2), and k steps more."""
    path = np.stack(places, axis=1)
    path = np.concatenate([path, np.repeat(path[-1:], len(path), axis=0)])
    physics.set_pedestrian_path(path, np.zeros_like(path))
    physics.step(len(path))
    return max((touch.squeeze for touch in physics.new_touches()), default=0.0)


def approach(start: float, end: float, steps: int = 60) -> Array:
    """Positions along the x axis at constant speed, shape (steps, 2) [m]."""
    return np.stack([np.linspace(start, end, steps), np.zeros(steps)], axis=-1)


def test_robot_that_one_person_shoves_is_not_squeezed_and_between_two_it_is_wedged() -> None:
    aside = np.tile(AWAY, (60, 1))
    assert squeeze_of(physics_of(n_pedestrians=2), approach(0.8, 0.1), aside) == 0.0
    # 0.54 m between two people whose bodies and the robot's take 0.64 m.
    assert squeeze_of(physics_of(n_pedestrians=2), approach(0.8, 0.27), approach(-0.8, -0.27)) > 10.0 * WEDGE_FORCE


def test_robot_pushed_into_a_robot_is_squeezed_by_no_more_than_mass_and_grip_explain() -> None:
    physics = physics_of(n_agents=2)
    physics.place_agent(1, np.array([-0.4, 0.0]), 0.0)
    squeeze = squeeze_of(physics, approach(0.8, 0.1))
    assert 10.0 < squeeze < WEDGE_FORCE  # the grip of the second robot's wheels alone is up to 63 N


def test_squeeze_is_what_cancels() -> None:
    east, north = np.array([3.0, 0.0, 0.0]), np.array([0.0, 4.0, 0.0])
    assert squeeze_force(np.stack([east, 2.0 * east])) == 0.0
    assert squeeze_force(np.stack([east, -east])) == pytest.approx(3.0)
    assert squeeze_force(np.stack([2.0 * east, -east])) == pytest.approx(3.0)
    assert squeeze_force(np.stack([east, north])) == pytest.approx(0.5 * (3.0 + 4.0 - 5.0))


@pytest.mark.parametrize("direction", [0.0, 0.25 * np.pi, 0.5 * np.pi, 0.75 * np.pi, np.pi, 1.5 * np.pi])
def test_robot_that_is_let_go_at_a_tilt_rights_itself_or_ends_beyond_the_limit(direction: float) -> None:
    # The wheels are spheres of 0.06 m 0.12 m beside the middle, the casters of 0.02 m ahead and behind.
    centres = np.array([[0.0, 0.12, 0.06], [0.0, -0.12, 0.06], [0.12, 0.0, 0.02], [-0.12, 0.0, 0.02]])
    radii = np.array([0.06, 0.06, 0.02, 0.02])
    for tilt, falls in ((60.0, False), (85.0, True)):
        physics, half = physics_of(), 0.5 * np.radians(tilt)
        turn = np.array([np.cos(half), np.sin(half) * np.cos(direction), np.sin(half) * np.sin(direction), 0.0])
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, turn)
        physics.data.qpos[2] = -((centres @ matrix.reshape(3, 3).T)[:, 2] - radii).min()
        physics.data.qpos[3:7], physics.data.qvel[:] = turn, 0.0
        physics.step(200)
        assert (physics.agent_tilt()[0] > OVERTURNED_TILT) is np.bool_(falls)
        assert falls or physics.agent_tilt()[0] < 0.01


def test_normal_points_from_the_agent_whatever_order_mujoco_names_the_bodies_in(tmp_path: Path) -> None:
    # MuJoCo names the simpler geom first: sphere, capsule, cylinder. With a cylinder the person comes first.
    sphere, cylinder = 'type="sphere" size="0.17"', 'type="cylinder" size="0.17 0.05"'
    text, file = (assets_folder() / "robot.xml").read_text(), tmp_path / "drum.xml"
    assert sphere in text
    file.write_text(text.replace(sphere, cylinder))
    for model in (Robot.model, str(file)):
        (touch,) = flicker(physics_of(robot=model), (True, 3))
        assert touch.agent == 0 and touch.kind == Partner.PEDESTRIAN
        np.testing.assert_allclose(touch.normal, [1.0, 0.0], atol=1e-6)
        assert touch.impact_impulse > 0.0


def test_each_pair_is_counted_by_itself() -> None:
    physics = physics_of(n_agents=2, n_pedestrians=1)
    near = CONTACT_DISTANCE - 0.01
    touches = lead(physics, np.array([(near, 0.0), (near, 3.0)] * 2))
    assert [(t.agent, t.partner, t.kind) for t in touches] == [(0, 0, Partner.PEDESTRIAN), (1, 0, Partner.PEDESTRIAN)]


def test_reused_slots_do_not_inherit_touches() -> None:
    physics, person = physics_of(), np.array([0])
    assert len(flicker(physics, (True, 5))) == 1
    physics.park_agent(0)
    physics.place_agent(0, np.zeros(2), 0.0)
    assert len(flicker(physics, (True, 5))) == 1
    physics.park_pedestrians(person)
    physics.set_pedestrian_pose(person, np.array([AWAY]), quaternion_of_yaw(np.zeros(1)))
    assert len(flicker(physics, (True, 5))) == 0  # contact-free
    physics.set_pedestrian_contacts(person, np.ones(1, dtype=bool))
    assert len(flicker(physics, (True, 5))) == 1


def test_parked_robot_is_as_new_when_it_is_placed_again() -> None:
    physics = physics_of()
    fresh = physics.get_state()
    physics.set_twist(np.array([[1.0, 2.0]]))
    physics.step(50)
    assert physics.agent_velocity().any() and physics.data.qacc_warmstart.any()
    physics.park_agent(0)
    physics.place_agent(0, np.zeros(2), 0.0)
    np.testing.assert_array_equal(physics.get_state(), fresh)
    assert not physics.data.qacc_warmstart.any() and not physics.data.ctrl.any()


# Impulse


def test_parked_robots_sleep_and_the_others_stay_awake_and_listen() -> None:
    """A robot that stands still for 5 s obeys its command at once, and a walker's touch; a parked one costs nothing."""
    physics = physics_of(2)
    physics.park_agent(1)
    awake = physics.data.ptr.tree_awake
    trees = physics.model.ptr.body_treeid[[physics.model.body(f"agent_00{slot}/robot").id for slot in (0, 1)]]
    physics.step(500)
    assert awake[trees].tolist() == [1, 0]
    physics.set_twist(np.array([[1.0, 0.0], [0.0, 0.0]]))
    physics.step()
    assert physics.agent_velocity()[0, 0] > 0.01
    physics.place_agent(1, np.array([0.0, 3.0]), 0.0)
    physics.set_twist(np.array([[0.0, 0.0], [1.0, 0.0]]))
    physics.step(200)
    assert awake[trees].tolist() == [1, 1]
    assert physics.agent_velocity()[1, 0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_sleep_changes_no_bit_of_an_episode(share: float) -> None:
    hashes = []
    for is_on in (True, False):
        environment = tasks.load("scenario_1", task_kwargs={"share": share, "dataset": TINY})
        if not is_on:
            environment.physics.model.ptr.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        hashes.append(rollout(environment, GoStraight()).metadata["state_hash"])
    assert hashes[0] == hashes[1]


def test_impulse_is_the_momentum_that_a_walker_gives_to_a_free_robot() -> None:
    physics = physics_of(slippery=True)
    positions = np.stack([1.0 - 1.3 * TIMESTEP * np.arange(200), np.zeros(200)], axis=-1)
    (touch,) = lead(physics, positions)
    speed = float(-physics.agent_velocity()[0, 0])
    assert speed > 1.2  # the walker goes on, and the robot with it
    # 8 kg; the floor takes a thousandth while the robot rocks on its casters.
    assert touch.impact_impulse + touch.push_impulse == pytest.approx(8.0 * speed, rel=0.003)
    assert touch.impact_force * TIMESTEP < touch.impact_impulse < touch.impact_force * 0.1


def test_force_belongs_to_the_impact_for_a_tenth_of_a_second_and_to_the_push_after_it() -> None:
    (touch,) = flicker(physics_of(), (True, 10))
    assert touch.push_duration == touch.push_impulse == touch.push_force == 0.0 < touch.impact_force
    (longer,) = flicker(physics_of(), (True, 25))
    assert (longer.impact_impulse, longer.impact_force) == (touch.impact_impulse, touch.impact_force)
    assert longer.push_duration == pytest.approx(15 * TIMESTEP)
    assert longer.push_force * TIMESTEP < longer.push_impulse <= longer.push_force * longer.push_duration
    # Time apart is no time of pushing, though the touch goes on.
    (parted,) = flicker(physics_of(), (True, 12), (False, 10), (True, 3))
    assert parted.push_duration == pytest.approx(5 * TIMESTEP)
    assert parted.last_time - parted.time == pytest.approx(24 * TIMESTEP)


def test_peak_is_told_with_its_time_wherever_it_was() -> None:
    physics = physics_of()
    near, deep = CONTACT_DISTANCE - 0.001, CONTACT_DISTANCE - 0.03
    for at in (4, 14):
        places = np.full((20, 2), (near, 0.0))
        places[at, 0] = deep  # a jump for one step
        physics.place_agent(0, np.zeros(2), 0.0)
        (touch,) = lead(physics, places)
        assert touch.peak_time == pytest.approx(at * TIMESTEP)
        assert (touch.impact_force > touch.push_force) is (at < 10)
        lead(physics, np.full((30, 2), AWAY))


def test_impulse_between_two_free_robots_is_equal_and_opposite() -> None:
    physics = physics_of(n_agents=2, slippery=True)
    with physics.reset_context():
        physics.place_agent(0, np.array([-0.5, 0.0]), 0.0)
        physics.place_agent(1, np.array([0.5, 0.0]), 0.0)
        physics.data.qvel[0] = 1.0  # the first one slides at 1 m/s
    physics.step(150)
    (touch,) = physics.new_touches()
    first, second = physics.agent_velocity()[:, 0]
    assert first + second == pytest.approx(1.0, abs=0.005)  # momentum
    assert touch.impact_impulse + touch.push_impulse == pytest.approx(8.0 * second, rel=0.003)
    assert first**2 + second**2 < 1.0  # energy
    np.testing.assert_allclose(touch.agent_velocity, [1.0, 0.0], atol=0.01)
    np.testing.assert_allclose(touch.partner_velocity, 0.0, atol=0.01)


# Getters, poses


def test_getters_return_arrays_that_the_caller_owns() -> None:
    physics = physics_of(n_agents=2)
    before = physics.get_state()
    for name in ("position", "heading", "velocity", "yaw_rate", "tilt"):
        value = getattr(physics, f"agent_{name}")()
        assert len(value) == 2
        value[...] = 7.0
    np.testing.assert_array_equal(physics.get_state(), before)


def test_getters_agree_with_the_named_bodies_after_a_control_step() -> None:
    environment = environment_of(walk([(0, 0), (10, 4)], 1.0), walk([(3, 0), (3, 9)], 1.0), agents=[1])
    environment.reset()
    for _ in range(7):
        environment.step(np.array([[9.0, 12.0]]))
    named = environment.physics.named.data
    np.testing.assert_allclose(named.xpos["agent_000/robot", :2], environment.physics.agent_position()[0], atol=1e-12)
    np.testing.assert_allclose(named.xpos["pedestrian_000/pedestrian", :2], [3.0, 7 * 0.2], atol=1e-12)
    heading = environment.physics.agent_heading()[0]
    forward = named.xmat["agent_000/robot"].reshape(3, 3)[:2, 0]
    np.testing.assert_allclose(forward, [np.cos(heading), np.sin(heading)], atol=1e-4)


def test_pedestrian_moves_at_every_physics_step() -> None:
    """A walker's contact force is smooth; a jump each control step would give peaks of kilonewtons."""
    physics = physics_of()
    positions = np.stack([1.0 - 1.3 * TIMESTEP * np.arange(150), np.zeros(150)], axis=-1)
    (touch,) = lead(physics, positions)
    assert max(touch.impact_force, touch.push_force) < 500.0


def test_path_of_the_wrong_length_is_refused() -> None:
    physics = physics_of()
    physics.set_pedestrian_path(np.zeros((3, 1, 2)), np.zeros((3, 1, 2)))
    with pytest.raises(ValueError, match="3 positions for 20 physics steps"):
        physics.step(20)


def test_touches_of_before_a_reset_are_forgotten() -> None:
    physics = physics_of()
    physics.set_pedestrian_pose(np.array([0]), np.array([[0.3, 0.0]]), quaternion_of_yaw(np.zeros(1)))
    physics.step(3)
    physics.reset()
    assert physics.new_touches() == []


def test_new_physics_and_reset_have_every_slot_parked() -> None:
    physics = physics_of(n_agents=3, n_pedestrians=2)
    physics.step(10)
    fresh = Physics.from_mujoco(physics.model.ptr)
    for parked in (fresh, physics):
        parked.reset()
        assert not parked.model.geom_contype.any() and not parked.model.geom_conaffinity[1:].any()
        assert (parked.data.qpos[2::9] < -1.0).all() and (parked.data.mocap_pos[:, 2] < -1.0).all()
    before = physics.data.qpos.copy()
    physics.step(100)
    np.testing.assert_array_equal(physics.data.qpos, before)  # they need no floor
    assert physics.data.ncon == 0


def test_copy_goes_on_as_the_original_and_its_slots_can_be_used_again() -> None:
    original = physics_of(n_agents=2)
    original.park_agent(1)
    original.set_twist(np.array([[0.5, 1.0], [0.0, 0.0]]))
    original.step(20)
    for copy in (original.copy(), pickle.loads(pickle.dumps(original))):
        np.testing.assert_array_equal(copy.get_state(), original.get_state())
        copy.place_agent(1, np.array([0.0, 3.0]), 0.0)
        copy.step(50)
        assert abs(copy.data.qpos[9 + 2]) < 0.001  # stands on the floor
        assert original.data.qpos[9 + 2] < -1.0
        assert len(flicker(copy, (True, 5), (False, 19), (True, 5))) == 1


# Invalid states


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12])
@pytest.mark.parametrize("field", ["qvel", "qpos"])
def test_invalid_state_names_time_and_robot(field: str, value: float) -> None:
    physics = physics_of(n_agents=3)
    physics.step(50)
    width = {"qvel": 8, "qpos": 9}[field]
    getattr(physics.data, field)[2 * width + 1] = value
    with pytest.raises(PhysicsError, match=rf"^at 0\.50 s: .*BAD{field.upper()}.*; first invalid in agent_002$"):
        physics.step(20)


def test_invalid_acceleration_names_the_robot() -> None:
    physics = physics_of(n_agents=3)
    physics.step(10)
    physics.data.qfrc_applied[8 + 3] = 1e15
    with pytest.raises(PhysicsError, match=r"^at 0\.10 s: .*BADQACC.*; first invalid in agent_001$"):
        physics.step(20)


def test_environment_can_be_reset_after_an_invalid_state() -> None:
    environment = tasks.load("scenario_4", {"dataset": TINY})
    environment.reset()
    fresh = state_of(environment)
    environment.step(still(environment))
    environment.physics.data.qvel[3] = np.nan
    with pytest.raises(PhysicsError, match=r"^at 0\.20 s: .*agent_000"):
        environment.step(still(environment))
    environment.reset()
    np.testing.assert_array_equal(state_of(environment), fresh)
    environment.step(still(environment))


# A whole crowd


@pytest.mark.skipif("SOCIALNAV_MJ_DATA" not in os.environ, reason="needs the UCY recordings, see SOCIALNAV_MJ_DATA")
@pytest.mark.parametrize("scenario", ["scenario_2", "scenario_4"])
def test_nobody_is_ejected_or_tipped_in_a_recorded_crowd(scenario: str) -> None:
    """students003 begins with 30 people at once; robots that go straight to their goals hit many of them."""
    environment = tasks.load(scenario, {"dataset": "students003", "time_limit": 40.0})
    controller = GoStraight()
    controller.reset(Limits.of(environment.task.scenario))
    time_step = environment.reset()
    speed = tilt = 0.0
    while not time_step.last():
        time_step = environment.step(controller.act(time_step.observation))
        speed = max(speed, float(np.hypot(*environment.physics.agent_velocity().T).max()))
        tilt = max(tilt, float(environment.physics.agent_tilt().max()))
    assert len(environment.task.collisions) > 10
    assert speed < 4.0  # [m/s]; measured 1.8
    assert np.degrees(tilt) < 10.0  # measured 4 degrees; 47 would tip it
    assert not environment.physics.data.warning.number.any()
