"""People who give way to robots: off their tracks for them alone, and back."""

import numpy as np
import pytest
from scenes import TINY, busy_crowd, environment_of, stand, state_of, still, walk

from socialnav_mj import suite
from socialnav_mj.controllers import GoStraight
from socialnav_mj.controllers.stand_still import StandStill
from socialnav_mj.elementary import exp
from socialnav_mj.geometry import Array, quaternion_of_yaw
from socialnav_mj.reaction import (
    CLEARANCE,
    HORIZON,
    MAX_ACCELERATION,
    MAX_SPEED,
    SCREENING_TIME,
    STRENGTH,
    UNSEEN,
    Deviation,
    Movers,
    deviate,
    push,
)
from socialnav_mj.rollout import rollout

LEVELS = tuple(STRENGTH)


def movers(*rows: tuple[float, ...]) -> Movers:
    """Bodies of (x, y, vx, vy)."""
    values = np.array(rows, dtype=float).reshape(-1, 4)
    return Movers(position=values[:, :2], velocity=values[:, 2:])


def energy(people: Movers, others: Movers, distance: float) -> float:
    """exp(-tau / tau_0) / tau^2 of the first person and the first other, by the root of a quadratic."""
    x, v = people.position[0] - others.position[0], people.velocity[0] - others.velocity[0]
    a, b, c = v @ v, 2.0 * x @ v, x @ x - distance**2
    tau = (-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    return float(exp(-tau / SCREENING_TIME) / tau**2)


@pytest.mark.parametrize("state", [(0.0, 0.0, 1.2, 0.0), (0.1, 0.15, 1.2, 0.1), (0.0, -0.2, 0.7, 0.0)])
def test_push_is_the_gradient_of_the_energy(state) -> None:
    robot, distance, h = movers((3.0, 0.0, -0.4, 0.0)), 0.42, 1e-6
    found = push(movers(state), robot, distance=distance)[0]
    slope = []
    for step in ((h, 0.0), (0.0, h)):
        high, low = (movers((state[0] + s * step[0], state[1] + s * step[1], *state[2:])) for s in (1.0, -1.0))
        slope.append((energy(high, robot, distance) - energy(low, robot, distance)) / (2.0 * h))
    np.testing.assert_allclose(found, [-value for value in slope], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    "state",
    [
        (0.0, 0.0, 0.0, 0.0),  # stands, and the robot passes by
        (0.0, 1.0, 1.0, 0.0),  # passes at a metre
        (0.0, 0.0, -1.0, 0.0),  # walks away as fast as the robot comes
        (3.0 - 1.0 * (HORIZON + 0.5), 0.0, 0.0, 0.0),  # too far for the horizon
    ],
)
def test_nobody_is_pushed_who_meets_no_robot_soon(state) -> None:
    robot = movers((3.0, 0.9, -1.0, 0.0)) if state[:2] == (0.0, 0.0) and state[2] == 0.0 else movers((3, 0, -1, 0))
    assert push(movers(state), robot, distance=0.42).tolist() == [[0.0, 0.0]]


def test_push_turns_with_the_scene_and_out_of_sight_counts_less() -> None:
    person, robot = (0.0, 0.0, 1.0, 0.0), (2.0, 0.2, -0.5, 0.0)
    plain = push(movers(person), movers(robot), distance=0.42)[0]
    turned = push(movers((0, 0, 0, 1)), movers((-0.2, 2.0, 0, -0.5)), distance=0.42)[0]
    np.testing.assert_allclose(turned, [-plain[1], plain[0]], rtol=1e-12)
    for yaw, factor in ((0.0, 1.0), (0.5 * np.pi, 1.0), (np.pi, UNSEEN)):
        seen = push(movers(person), movers(robot), distance=0.42, facing=quaternion_of_yaw([yaw]))[0]
        np.testing.assert_allclose(seen, factor * plain, rtol=1e-12)


def walked(
    people: list[tuple[float, ...]], robots: list[tuple[float, ...]], *, strength: float = 1.5, steps: int = 60
) -> tuple[Array, Array]:
    """Offsets and drifts, (steps + 1, m, 2), of people (x, y, vx, vy), who and robots keep their velocities."""
    recorded, machine = movers(*people), movers(*robots)
    deviation = Deviation.none(len(people))
    offsets, drifts = [deviation.offset], [deviation.drift]
    facing = quaternion_of_yaw(np.arctan2(recorded.velocity[:, 1], recorded.velocity[:, 0]))
    for k in range(steps):
        there = Movers(position=recorded.position + 0.2 * k * recorded.velocity, velocity=recorded.velocity)
        robot = Movers(position=machine.position + 0.2 * k * machine.velocity, velocity=machine.velocity)
        deviation = deviate(
            deviation,
            people=Movers(position=there.position + deviation.offset, velocity=there.velocity + deviation.drift),
            recorded=there,
            following=there.position + 0.2 * recorded.velocity,
            facing=facing,
            robots=robot,
            strength=strength,
            timestep=0.2,
            distance=0.32,
            body=0.3,
        )
        offsets.append(deviation.offset)
        drifts.append(deviation.drift)
    return np.array(offsets), np.array(drifts)


def test_walker_passes_a_standing_robot_and_is_back_on_its_track_exactly() -> None:
    offset, drift = walked([(-5.0, 0.05, 1.2, 0.0)], [(0.0, 0.0, 0.0, 0.0)], steps=100)
    place = np.array([-5.0, 0.05]) + 0.2 * np.arange(101)[:, None] * (1.2, 0.0) + offset[:, 0]
    gap = np.linalg.norm(place, axis=1)
    assert 0.32 < gap.min() < 0.32 + 3.0 * CLEARANCE
    assert np.abs(offset[:, 0, 1]).max() > 0.2
    assert offset[-1].tolist() == drift[-1].tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize("strength", [*STRENGTH.values(), 50.0])
def test_deviation_keeps_to_a_persons_acceleration_and_speed(strength) -> None:
    people = [(-3.0, 0.1, 1.3, 0.0), (2.0, 2.0, 0.0, 0.0), (0.0, 4.0, 0.0, -2.4)]
    _, drift = walked(people, [(0.0, 0.0, -0.3, 0.0), (0.0, -1.0, 0.0, 1.0), (4, 2, -1, 0)], strength=strength)
    change = np.linalg.norm(np.diff(drift, axis=0), axis=-1)
    assert change[change > 0.0].size and change.max() <= 0.2 * MAX_ACCELERATION + 1e-9
    velocity = np.array(people)[:, 2:]
    limit = np.maximum(np.linalg.norm(velocity, axis=1), MAX_SPEED)
    assert (np.linalg.norm(drift + velocity, axis=-1) <= limit + 1e-9).all()


def test_stronger_people_leave_more_room_and_weak_ones_some() -> None:
    gaps = []
    for strength in (0.0, *STRENGTH.values()):
        offset, _ = walked([(-5.0, 0.05, 1.2, 0.0)], [(0.0, 0.0, 0.0, 0.0)], strength=strength)
        place = np.array([-5.0, 0.05]) + 0.2 * np.arange(61)[:, None] * (1.2, 0.0) + offset[:, 0]
        gaps.append(np.linalg.norm(place, axis=1).min())
    assert gaps[0] < 0.15 < gaps[1] < gaps[2]


def test_nobody_walks_into_another_person_because_of_a_deviation() -> None:
    # A row of people abreast who walk at a row of robots: who steps aside has neighbours on both sides.
    people = [(-4.0, 0.45 * k, 1.2, 0.0) for k in range(5)]
    robots = [(0.0, 0.45 * k + 0.1, -0.5, 0.0) for k in range(5)]
    offset, _ = walked(people, robots)
    start = np.array(people)[:, :2]
    for k in range(len(offset)):
        place = start + offset[k]
        gap = np.linalg.norm(place[:, None] - place, axis=-1)[np.triu_indices(5, 1)]
        assert gap.min() >= 0.3 - 0.02
    assert np.abs(offset).max() > 0.2


def test_people_who_overlap_in_the_recording_stay_as_they_are_recorded() -> None:
    # Arm in arm, 0.2 m apart; a robot comes from ahead of one of them. They part, or stay as near, but come no nearer.
    offset, _ = walked([(-4.0, 0.0, 1.2, 0.0), (-4.0, 0.2, 1.2, 0.0)], [(0.0, -0.15, -0.3, 0.0)])
    gap = np.linalg.norm(np.array([0.0, -0.2]) + offset[:, 0] - offset[:, 1], axis=-1)
    assert gap.min() >= 0.2 - 1e-6 and np.abs(offset[:, 1]).max() > 0.0


@pytest.mark.parametrize("level", LEVELS)
def test_recording_is_reproduced_bit_for_bit_where_robots_are_far_away(level) -> None:
    far = walk([(90, 90), (99, 90)], 1.0)
    environments = [environment_of(*busy_crowd(12), far, agents=[13], pedestrians=p) for p in ("replay", level)]
    for environment in environments:
        environment.reset()
    time_step = None
    while time_step is None or not time_step.last():
        time_step, _ = [environment.step(still(environment)) for environment in environments]
        one, two = (environment.task.people for environment in environments)
        for name in ("position", "velocity", "quaternion"):
            assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
        assert np.array_equal(state_of(environments[0]), state_of(environments[1]))


def test_person_steps_aside_for_a_robot_that_stands_and_the_record_tells_by_how_much() -> None:
    crowd = walk([(0, 0), (9, 0)], 1.0), walk([(4, 0.1), (-6, 0.1)], 1.2)
    blind, aware = (
        rollout(environment_of(*crowd, agents=[1], pedestrians=p), StandStill()) for p in ("replay", "yielding")
    )
    assert len(blind.contact_time) == 1 and not len(aware.contact_time)
    assert blind.pedestrian_deviation is None
    off = np.linalg.norm(aware.pedestrian_deviation[:, 0], axis=-1)
    assert 0.2 < np.nanmax(off) < 1.0
    both = min(len(blind.time), len(aware.time))
    track = aware.pedestrian_position[:both] - aware.pedestrian_deviation[:both]
    np.testing.assert_allclose(track, blind.pedestrian_position[:both], atol=1e-12)


@pytest.mark.parametrize("body", ["rigid", "compliant"])
def test_bodies_go_where_people_want_without_a_jump(body) -> None:
    crowd = walk([(0, 0), (9, 0)], 1.0), walk([(4, 0.1), (-6, 0.1)], 1.2), stand((-2, 1), 0.0, 9.0)
    environment = environment_of(*crowd, agents=[1], pedestrians="yielding", pedestrian_body=body)
    environment.reset()
    before = environment.task.people
    for _ in range(30):
        environment.step(still(environment))
        now = environment.task.people
        moved = np.linalg.norm(now.position - before.position, axis=1) / 0.2
        assert np.nanmax(moved) < 2.0
        mean = 0.5 * (now.velocity + before.velocity)
        np.testing.assert_allclose((now.position - before.position) / 0.2, mean, atol=0.06)
        bodies = environment.physics.pedestrian_position()
        np.testing.assert_allclose(bodies[now.present], now.position[now.present], atol=1e-9)
        before = now
    wanted = environment.task.crowd.crowd(30)
    np.testing.assert_allclose(now.position, wanted.position, atol=0.01)


def test_equal_configurations_give_equal_bits_and_a_second_episode_of_an_environment_too() -> None:
    crowd, agents = busy_crowd(8, seed=1), [2, 5, 6]
    environment = environment_of(*crowd, agents=agents, pedestrians="yielding")
    hashes = [rollout(environment, GoStraight()).metadata["state_hash"] for _ in range(2)]
    again = rollout(environment_of(*crowd, agents=agents, pedestrians="yielding"), GoStraight())
    replay = rollout(environment_of(*crowd, agents=agents), GoStraight())
    assert hashes[0] == hashes[1] == again.metadata["state_hash"] != replay.metadata["state_hash"]


def test_tasks_take_the_level() -> None:
    assert suite.load("scenario_1", {"dataset": TINY, "pedestrians": "weak"}).task.scenario.pedestrians == "weak"
    with pytest.raises(ValueError, match="pedestrians = 'shy' is not allowed; allowed: replay, weak, yielding"):
        suite.load("scenario_1", {"dataset": TINY, "pedestrians": "shy"})
