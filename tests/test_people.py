"""People who yield: on their tracks while they meet nobody, with a limited force when they do."""

import numpy as np
import pytest
from scenes import busy_crowd, environment_of, stand, state_of, still, walk

from socialnav_mj import metrics
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import GoStraight
from socialnav_mj.geometry import Array, quaternion_of_yaw
from socialnav_mj.metrics.severity import WEDGE_FORCE
from socialnav_mj.people import CATCH_UP_SPEED, PARKING_DEPTH, PUSHING_FORCE
from socialnav_mj.physics import Physics
from socialnav_mj.rollout import rollout
from socialnav_mj.scene import build_model
from socialnav_mj.touch import Touch

TIMESTEP = 0.01
SOUTH = walk([(0, 0), (0, -9)], 1.0)


def scene(n_agents: int = 1, n_pedestrians: int = 1, *, pedestrian_body: str = "compliant") -> Physics:
    """Robots at (0, 3 i); people in contact with the world 5 m away."""
    scenario = Scenario(pedestrian_body=pedestrian_body)
    bounds = {"low": np.full(2, -5.0), "high": np.full(2, 5.0)}
    physics = Physics.from_mujoco(
        build_model(scenario, n_agent_slots=n_agents, n_pedestrian_slots=n_pedestrians, **bounds)
    )
    everybody = np.arange(n_pedestrians)
    with physics.reset_context():
        for slot in range(n_agents):
            physics.place_agent(slot, np.array([0.0, 3.0 * slot]), 0.0)
        where = np.stack([np.full(n_pedestrians, 5.0), 5.0 + everybody], axis=1)
        physics.set_pedestrian_pose(everybody, where, quaternion_of_yaw(np.zeros(n_pedestrians)))
        physics.set_pedestrian_contacts(everybody, np.ones(n_pedestrians, dtype=bool))
    return physics


def lead(physics: Physics, *tracks: Array) -> list[Touch]:
    """Move people along tracks, a position of (2,) each physics step; who begins elsewhere is put there first."""
    path = np.stack(tracks, axis=1)
    velocity = np.gradient(path, TIMESTEP, axis=0)
    everybody = np.arange(len(tracks))
    physics.park_pedestrians(everybody)
    physics.set_pedestrian_pose(everybody, path[0], quaternion_of_yaw(np.zeros(len(tracks))), velocity[0])
    physics.set_pedestrian_contacts(everybody, np.ones(len(tracks), dtype=bool))
    physics.set_pedestrian_path(path, velocity)
    physics.step(len(path))
    return physics.new_touches()


def along(start: float, speed: float, steps: int = 200) -> Array:
    """Along the x axis."""
    return np.stack([start + speed * TIMESTEP * np.arange(steps), np.zeros(steps)], axis=-1)


@pytest.mark.parametrize("control_timestep", [0.01, 0.2])
def test_who_meets_nobody_is_within_a_millimetre_of_the_recording(control_timestep: float) -> None:
    # The robot drives away from all others.
    crowd = [SOUTH, *busy_crowd(12, seed=3), walk([(0, 4), (3, 4), (3, 5), (0, 5)], 1.6, begin=0.5)]
    crowd[1:] = [type(w)(w.times, w.positions + np.array([0.0, 6.0])) for w in crowd[1:]]
    sizes = {"pedestrian_body": "compliant", "control_timestep": control_timestep, "turn_limit": "per_second"}
    environment = environment_of(*crowd, agents=[1], **sizes)
    environment.reset()
    task, worst = environment.task, 0.0
    for _ in range(round(8.0 / control_timestep)):
        time_step = environment.step(still(environment))
        if time_step.last():
            break
        recorded, there = task.crowd.crowd(task.step), task.people.present
        lag = np.linalg.norm(task.people.position[there] - recorded.position[there], axis=1)
        worst = max(worst, float(lag.max(initial=0.0)))
    assert 0.0 < worst < 1e-3
    assert not task.collisions


def test_robot_between_two_people_is_squeezed_by_what_people_push_with() -> None:
    # They come from both sides and would walk through each other; the robot is struck from the left and right.
    def held(pedestrian_body: str) -> tuple[list[Touch], Physics]:
        physics = scene(1, 2, pedestrian_body=pedestrian_body)
        return lead(physics, along(-0.8, 0.5, 400), along(0.8, -0.5, 400)), physics

    rigid, _ = held("rigid")
    assert max(touch.squeeze for touch in rigid) > 10.0 * WEDGE_FORCE
    touches, physics = held("compliant")
    assert len(touches) == 2
    for touch in touches:
        # Two people of 75 kg who meet at 0.5 m/s in 0.05 s: 2 m v / tau = 1500 N; 37 000 N before.
        assert touch.squeeze < 3.0 * WEDGE_FORCE
        mean = touch.push_impulse / touch.push_duration
        assert mean == pytest.approx(PUSHING_FORCE, rel=0.1)
        assert touch.push_force < 1.5 * PUSHING_FORCE
        assert touch.held_back > 0.5  # they would have come 2 m farther
    assert np.abs(physics.pedestrian_velocity()).max() < 0.1
    assert all(touch.held_back == 0.0 for touch in rigid)


def test_walker_and_robot_exchange_momentum_and_the_touch_tells_the_bodies_own_velocity() -> None:
    physics = scene()
    physics.model.actuator_gainprm[:] = physics.model.actuator_biasprm[:] = 0.0
    wheels = [g for g in range(physics.model.ngeom) if physics.model.geom(g).name.endswith("_wheel")]
    physics.model.geom_friction[wheels] = 1e-4  # nothing but the walker moves the robot
    (touch,) = lead(physics, along(-1.0, 1.0, 75))  # 0.07 s after the touch
    np.testing.assert_allclose(touch.partner_velocity, [1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(touch.agent_velocity, 0.0, atol=1e-3)
    impulse = touch.impact_impulse + touch.push_impulse
    assert impulse == pytest.approx(8.0 * physics.agent_velocity()[0, 0], rel=0.01)
    # Two bodies of 8 and 75 kg at 1 m/s, and what the walker pushes meanwhile.
    assert 7.23 < impulse < 7.23 + 0.07 * PUSHING_FORCE
    lost = 75.0 * (1.0 - physics.pedestrian_velocity()[0, 0])
    assert impulse - 0.07 * PUSHING_FORCE - 0.1 < lost < impulse


def test_who_was_held_back_comes_back_at_no_more_than_a_brisk_walk() -> None:
    physics, steps = scene(), 600
    track = along(2.0, 1.0, steps) + np.array([0.0, 4.0])
    lead(physics, track[:2])
    physics.data.qpos[physics._index.pedestrian_qpos[0, 0]] -= 1.0
    velocity, distance = [], []
    for k in range(2, steps):
        physics.set_pedestrian_path(track[k : k + 1, None], np.full((1, 1, 2), (1.0, 0.0)))
        distance.append(track[k, 0] - physics.pedestrian_position()[0, 0])
        physics.step(1)
        velocity.append(physics.pedestrian_velocity()[0, 0])
    assert distance[0] == pytest.approx(1.0, abs=1e-6)
    assert 1.0 + 0.9 * CATCH_UP_SPEED < max(velocity) <= 1.0 + CATCH_UP_SPEED
    assert np.diff(velocity).max() <= PUSHING_FORCE / 75.0 * TIMESTEP + 1e-9
    assert min(distance) > -0.05 and abs(distance[-1]) < 0.01


def test_parked_people_wait_below_the_floor_and_come_with_the_recorded_velocity() -> None:
    physics, person = scene(), np.array([0])
    physics.park_pedestrians(person)
    physics.step(10)
    height = physics.named.data.xpos["pedestrian_000/pedestrian", 2]
    assert height == -PARKING_DEPTH and not physics.pedestrian_velocity().any()
    pose = np.array([[1.0, 2.0]]), quaternion_of_yaw(np.array([0.5 * np.pi]))
    physics.set_pedestrian_pose(person, *pose, np.array([[0.3, 0.4]]))
    physics.refresh_poses()
    np.testing.assert_allclose(physics.pedestrian_position(), pose[0], atol=1e-12)
    np.testing.assert_array_equal(physics.pedestrian_velocity(), [[0.3, 0.4]])
    np.testing.assert_allclose(physics.named.data.xpos["pedestrian_000/pedestrian"], [1.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        physics.named.data.xmat["pedestrian_000/pedestrian"].reshape(3, 3)[:, 0], [0, 1, 0], atol=1e-9
    )
    # Told again where the recording has it, who is there is turned and not moved.
    physics.set_pedestrian_pose(person, np.array([[7.0, 7.0]]), pose[1])
    np.testing.assert_allclose(physics.pedestrian_position(), pose[0], atol=1e-12)


def test_person_who_appears_on_a_robot_passes_through_it_undisturbed() -> None:
    person = walk([(0.1, 0.0), (3.0, 0.0)], 1.0, begin=1.0)
    environment = environment_of(walk([(0, 0), (9, 0)], 1.0), person, agents=[1], pedestrian_body="compliant")
    environment.reset()
    for _ in range(15):
        environment.step(still(environment))
    assert environment.task.ghosts.overlaps == {(0, 0)} and not environment.task.collisions
    np.testing.assert_allclose(environment.task.people.position[0], [0.1 + 2.0, 0.0], atol=1e-3)


def test_episode_and_observation_tell_where_the_bodies_are() -> None:
    # A robot that stands, between a walker and somebody who walks the other way: both are held.
    crowd = walk([(0, 0), (9, 0)], 1.0), walk([(-2, 0), (8, 0)], 1.0), walk([(2, 0), (-8, 0)], 1.0)
    environment = environment_of(*crowd, agents=[1], pedestrian_body="compliant")
    environment.reset()
    for _ in range(15):
        seen = environment.step(still(environment)).observation
    people = environment.task.people
    recorded = environment.task.crowd.crowd(15)
    assert np.linalg.norm(people.position - recorded.position, axis=1).min() > 0.5
    assert np.linalg.norm(people.velocity, axis=1).max() < 0.1
    gaps = np.linalg.norm(seen["pedestrian_position"][0][seen["pedestrian_mask"][0]], axis=-1)
    np.testing.assert_allclose(gaps, np.linalg.norm(people.position - environment.physics.agent_position()[0], axis=1))
    episode = rollout(environment_of(*crowd, agents=[1], pedestrian_body="compliant"), GoStraight())
    rigid = rollout(environment_of(*crowd, agents=[1]), GoStraight())
    k = 8  # the walker from behind is slower than the robot; the other one is met at 1 s
    both = min(len(episode.time), len(rigid.time))
    offset = np.linalg.norm(episode.pedestrian_position[:both] - rigid.pedestrian_position[:both], axis=-1)
    assert np.nanmax(offset[:4]) < 1e-3 < np.nanmax(offset[k:])
    assert metrics.largest_held_back(episode)[0] > 0.0 and metrics.largest_held_back(rigid).tolist() == [0.0]


def test_equal_configurations_give_equal_bits_and_another_kind_of_people_other_ones() -> None:
    crowd, agents = busy_crowd(8, seed=1), [2, 5, 6]
    episodes = [
        rollout(environment_of(*crowd, agents=agents, pedestrian_body=kind), GoStraight())
        for kind in ("compliant", "compliant", "rigid")
    ]
    hashes = [episode.metadata["state_hash"] for episode in episodes]
    assert hashes[0] == hashes[1] != hashes[2]
    np.testing.assert_array_equal(episodes[0].pedestrian_position, episodes[1].pedestrian_position)
    assert len(episodes[0].contact_time)


def test_copy_of_the_physics_goes_on_alike() -> None:
    crowd = walk([(0, 0), (9, 0)], 1.0), walk([(2, 0), (-8, 0)], 1.0), stand((3, 3), 0.0, 9.0)
    one, two = (environment_of(*crowd, agents=[1], pedestrian_body="compliant") for _ in range(2))
    for environment in (one, two):
        environment.reset()
        for _ in range(8):
            environment.step(still(environment))
    two._physics = two.physics.copy(share_model=False)
    for _ in range(5):
        for environment in (one, two):
            environment.step(still(environment))
    np.testing.assert_array_equal(state_of(one), state_of(two))
