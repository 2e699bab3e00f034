"""What the scene means: spawn, delay, deadline, arrival, collisions, reward; and that equal runs are equal."""

import os
from dataclasses import fields

import numpy as np
import pytest
from dm_control.rl import control
from scenes import TINY, busy_crowd, environment_of, stand, state_of, still, walk

import tasks
from socialnav_mj import metrics
from socialnav_mj.cast import cast_recording
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import GoStraight, Limits
from socialnav_mj.episode import Outcome, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.recordings import load_recording
from socialnav_mj.rollout import rollout
from socialnav_mj.task import ARRIVAL_REWARD, COLLISION_REWARD, PROGRESS_REWARD

DT = 0.2  # control step [s]
CONTACT_DISTANCE = 0.32  # [m]


def drive(environment: control.Environment, steps: int = 10_000) -> list[Array]:
    """Go straight to the goals until the episode ends, at most so many steps; rewards of all steps."""
    controller = GoStraight()
    controller.reset(Limits.of(environment.task.scenario))
    time_step, rewards = environment.reset(), []
    while not time_step.last() and len(rewards) < steps:
        time_step = environment.step(controller.act(time_step.observation))
        rewards.append(time_step.reward)
    return rewards


def wait(environment: control.Environment, steps: int = 10_000) -> list[Array]:
    """Stand still until the episode ends, at most so many steps; rewards of all steps."""
    time_step, rewards = environment.reset(), []
    while not time_step.last() and len(rewards) < steps:
        time_step = environment.step(still(environment))
        rewards.append(time_step.reward)
    return rewards


# Spawn, deadline, end


def test_agent_starts_where_when_and_as_its_person_appears() -> None:
    environment = environment_of(walk([(1, 2), (1, 8)], 1.0, begin=0.5), walk([(9, 9), (5, 9)], 1.0), agents=[1])
    time_step = environment.reset()
    while not time_step.observation["active"].any():
        time_step = environment.step(still(environment))
    task = environment.task
    assert task.spawn_step.tolist() == [3]  # the first control step at or after 0.5 s
    np.testing.assert_allclose(time_step.observation["position"], [[1.0, 2.0]], atol=1e-12)
    np.testing.assert_allclose(time_step.observation["heading"], [np.pi / 2.0], atol=1e-9)
    np.testing.assert_array_equal(time_step.observation["twist"], [[0.0, 0.0]])
    np.testing.assert_allclose(time_step.observation["goal"], [[6.0, 0.0]], atol=1e-9)
    assert time_step.observation["person"].tolist() == [1]


def test_spawn_waits_for_a_standing_person_and_the_deadline_runs_from_the_real_spawn() -> None:
    # Somebody stands 0.2 m beside the start until 1.0 s, control step 5.
    environment = environment_of(walk([(0, 0), (2, 0)], 1.0, begin=0.4), stand((0.0, 0.2), 0.0, 1.0), agents=[1])
    wait(environment)
    task = environment.task
    assert task.cast.agent_appear_step.tolist() == [2]
    assert task.spawn_step.tolist() == [6]
    assert task.cast.agent_allowed_steps.tolist() == [95]  # (15 s + 2 m * 2 s/m) / 0.2 s
    assert task.end_step.tolist() == [6 + 95]
    assert task.outcome.tolist() == [Outcome.TIMED_OUT]
    assert not task.collisions


def test_spawn_waits_until_a_passer_by_leaves_the_clearance() -> None:
    # Away from the start at 0.25 m/s: 0.1 + 0.25 t >= 0.17 + 0.15 + 0.05 from t = 1.08 s on, control step 6.
    environment = environment_of(walk([(0, 0), (5, 0)], 1.0), walk([(-0.1, 0), (-3.0, 0)], 0.25), agents=[1])
    wait(environment, 8)
    assert environment.task.spawn_step.tolist() == [6]


def test_spawn_waits_for_an_agent_in_the_place_and_keeps_the_order() -> None:
    # Two people appear at once, 0.3 m apart; robots need 2 * 0.17 + 0.05 m.
    environment = environment_of(walk([(0, 0), (6, 0)], 1.0), walk([(0, 0.3), (6, 0.3)], 1.0), agents=[1, 2])
    drive(environment, 10)
    first, second = environment.task.spawn_step
    assert first == 0 and 1 <= second <= 5
    environment.reset()
    assert environment.task.slot_agent.tolist() == [0, -1]


def test_agent_arrives_within_the_goal_radius_and_leaves() -> None:
    environment = environment_of(walk([(0, 0), (3, 0)], 1.0), walk([(9, 9), (5, 9)], 1.0), agents=[1])
    rewards = drive(environment)
    task = environment.task
    assert task.outcome.tolist() == [Outcome.ARRIVED]
    assert task.end_step.tolist() == [len(rewards)]
    last = np.linalg.norm(task.sample.position[0] - (3.0, 0.0))
    assert 0.5 - 1.0 * DT <= last <= 0.5  # at most one step's way inside
    assert task.sample.agent.tolist() == [0] and task.slot_agent.tolist() == [-1]
    assert environment.physics.data.qpos[2] < -1.0


def test_collision_lets_the_agent_go_on_or_takes_it_out() -> None:
    crowd = (walk([(0, 0), (4, 0)], 1.0), walk([(4, 0), (-4, 0)], 1.0))
    for on_collision, outcome in (("continue", Outcome.ARRIVED), ("retire", Outcome.COLLIDED)):
        environment = environment_of(*crowd, agents=[1], on_collision=on_collision)
        drive(environment)
        task = environment.task
        assert len(task.collisions) >= 1
        assert task.outcome.tolist() == [outcome]
        if outcome == Outcome.COLLIDED:
            assert task.end_step[0] == np.ceil(task.collisions[0].touch.time / DT)


def test_both_agents_of_a_collision_are_taken_out_and_charged() -> None:
    crowd = (walk([(-2, 0), (2, 0)], 1.0), walk([(2, 0), (-2, 0)], 1.0))
    environment = environment_of(*crowd, agents=[1, 2], on_collision="retire")
    rewards = drive(environment)
    assert environment.task.outcome.tolist() == [Outcome.COLLIDED] * 2
    assert len(environment.task.collisions) == 1
    assert (rewards[-1] < COLLISION_REWARD + 1.0).all()


def test_slot_is_used_again_by_an_agent_with_no_memory_of_the_first() -> None:
    # The same way twice, 24 s apart: the second run has to be the first one again.
    way = [(0, 0), (3, 1)]
    environment = environment_of(walk(way, 1.0), walk(way, 1.0, begin=24.0), agents=[1, 2])
    assert environment.task.cast.n_agent_slots == 1
    controller = GoStraight()
    controller.reset(Limits.of(environment.task.scenario))
    time_step, runs = environment.reset(), {1: [], 2: []}
    while not time_step.last():
        seen = time_step.observation
        if seen["active"][0]:
            runs[int(seen["person"][0])].append(np.concatenate([seen["position"][0], seen["twist"][0]]))
        time_step = environment.step(controller.act(seen))
    assert environment.task.outcome.tolist() == [Outcome.ARRIVED] * 2
    assert environment.task.spawn_step.tolist() == [0, 120]
    np.testing.assert_allclose(runs[1], runs[2], atol=1e-9)  # the tracks' headings differ by rounding


def test_agent_waits_for_a_slot_when_all_are_held_by_delayed_agents() -> None:
    # Slots are for the deadlines without delay, 95 steps here. The first agent spawns 6 steps late and stands until
    # its deadline; the second appears in step 96 when the only slot is still taken, and loses nothing but time.
    first = walk([(0, 0), (2, 0)], 1.0)
    second = walk([(5, 5), (7, 5)], 1.0, begin=96 * DT)
    environment = environment_of(first, second, stand((0.0, 0.2), 0.0, 1.0), agents=[1, 2])
    assert environment.task.cast.n_agent_slots == 1
    wait(environment)
    assert environment.task.spawn_step.tolist() == [6, 6 + 95 + 1]
    assert environment.task.end_step.tolist() == [6 + 95, 6 + 95 + 1 + 95]


def test_person_who_appears_on_a_robot_collides_only_after_having_been_clear() -> None:
    # Appears at (0.1, 0) on the robot at 1 s, walks to x = 1.1 until 2 s, and comes back: 0.32 m at 2.78 s.
    person = walk([(0.1, 0.0), (1.1, 0.0), (-3.0, 0.0)], 1.0, begin=1.0)
    environment = environment_of(walk([(0, 0), (9, 0)], 1.0), person, agents=[1])
    environment.reset()
    for _ in range(13):  # until 2.6 s
        environment.step(still(environment))
        np.testing.assert_allclose(environment.physics.agent_position(), 0.0, atol=1e-4)
    assert not environment.task.collisions
    for _ in range(10):
        environment.step(still(environment))
    (collision,) = environment.task.collisions
    assert collision.touch.time == pytest.approx(2.79, abs=0.011)
    assert environment.task.ghosts.overlaps == {(0, 0)}


def test_ghost_counts_once_for_every_robot_that_it_overlaps_and_nobody_else_does() -> None:
    # Appears at 1 s between two robots 0.4 m apart, 0.2 m from each, and leaves across.
    ghost = walk([(0.0, 0.2), (-3.0, 0.2)], 1.0, begin=1.0)
    robots = walk([(0, 0), (9, 0)], 1.0), walk([(0, 0.4), (9, 0.4)], 1.0), walk([(0, 3), (9, 3)], 1.0)
    environment = environment_of(*robots, ghost, walk([(1, -2), (1, 8)], 1.0), agents=[1, 2, 3])
    wait(environment, 30)
    assert environment.task.ghosts.overlaps == {(0, 0), (1, 0)}
    environment.reset()
    assert environment.task.ghosts.overlaps == set()


def test_overlap_with_a_ghost_is_recorded_and_takes_success_only_where_ghosts_count() -> None:
    # The robot is at x = 0.8 m or so at 1 s; the ghost begins there and goes away sideways.
    crowd = walk([(0, 0), (4, 0)], 1.0), walk([(0.9, 0.1), (0.9, 3.0)], 1.0, begin=1.0)
    episode = rollout(environment_of(*crowd, agents=[1]), GoStraight())
    assert episode.agent_ghost_overlaps.tolist() == [1] and not len(episode.contact_time)
    assert metrics.success(episode).tolist() == [True]
    assert metrics.success_if_ghosts_count(episode).tolist() == [False]
    alone = rollout(environment_of(crowd[0], walk([(0.9, 1.1), (0.9, 3.0)], 1.0, begin=1.0), agents=[1]), GoStraight())
    assert alone.agent_ghost_overlaps.tolist() == [0]
    assert metrics.success_if_ghosts_count(alone).tolist() == [True]


def test_person_who_appears_on_a_robot_and_leaves_has_never_touched_it() -> None:
    person = walk([(0.1, 0.0), (3.0, 0.0)], 1.0, begin=1.0)
    environment = environment_of(walk([(0, 0), (9, 0)], 1.0), person, agents=[1])
    wait(environment, 30)
    assert not environment.task.collisions
    assert environment.task.ghosts.overlaps == {(0, 0)}


def test_new_person_in_a_used_slot_touches_anew() -> None:
    # One goes away through the robot's front until 2 s; another appears 0.2 s later, 0.4 m ahead, and walks in.
    leaves = walk([(1.5, 0.0), (0.3, 0.0)], 1.0, begin=0.8)
    comes = walk([(-0.5, 0.0), (3.0, 0.0)], 1.0, begin=2.2)
    environment = environment_of(walk([(0, 0), (9, 0)], 1.0), leaves, comes, agents=[1])
    assert environment.task.cast.n_pedestrian_slots == 1
    wait(environment, 20)
    assert [c.partner for c in environment.task.collisions] == [0, 1]
    gap = environment.task.collisions[1].touch.time - environment.task.collisions[0].touch.last_time
    assert gap < 0.6


@pytest.mark.parametrize("on_collision", ["continue", "retire"])
@pytest.mark.parametrize("seed", range(3))
def test_rules_of_entering_and_leaving_hold_in_every_crowd(seed: int, on_collision: str) -> None:
    environment = environment_of(*busy_crowd(12, seed), agents=[2, 3, 5, 8, 9, 11], on_collision=on_collision)
    task, cast, physics = environment.task, environment.task.cast, environment.physics
    random, spec = np.random.default_rng(seed), environment.action_spec()
    time_step, spawned = environment.reset(), set()
    while not time_step.last():
        agents = task.slot_agent
        under_way = agents[agents >= 0]
        assert len(set(under_way)) == len(under_way)
        np.testing.assert_array_equal(np.sort(under_way), np.flatnonzero((task.spawn_step >= 0) & (task.outcome < 0)))
        people = task.recording.at([task.time])
        replayed = people.present[0].copy()
        replayed[cast.agent_index] = False
        position = physics.agent_position()
        for slot in np.flatnonzero(agents >= 0):
            if int(agents[slot]) not in spawned:
                spawned.add(int(agents[slot]))
                np.testing.assert_array_equal(position[slot], cast.agent_start[agents[slot]])
                gaps = np.linalg.norm(people.position[0, replayed] - position[slot], axis=1)
                assert (gaps >= 0.37 - 1e-9).all()
                others = (agents >= 0) & (np.arange(len(agents)) != slot)
                assert (np.linalg.norm(position[others] - position[slot], axis=1) >= 0.39 - 1e-9).all()
        time_step = environment.step(random.uniform(spec.minimum, spec.maximum, spec.shape))
    assert spawned == set(range(cast.n_agents))
    assert (task.spawn_step >= cast.agent_appear_step).all()
    lasted = task.end_step - task.spawn_step
    assert (lasted <= cast.agent_allowed_steps).all()
    np.testing.assert_array_equal(
        lasted[task.outcome == Outcome.TIMED_OUT], cast.agent_allowed_steps[task.outcome == 1]
    )
    assert task.collisions
    for collision in task.collisions:
        parties = [collision.agent] + [collision.partner] * (collision.touch.kind == Partner.AGENT)
        for agent in parties:
            assert task.spawn_step[agent] * DT <= collision.touch.time <= task.end_step[agent] * DT
        if collision.touch.kind == Partner.PEDESTRIAN:
            track = task.recording.person(int(cast.pedestrian_index[collision.partner]))
            apart = np.linalg.norm(track.at([collision.touch.time])[0][0] - collision.touch.position)
            assert apart <= 0.15 + 0.02  # the touch is on the person's surface
    struck = {a for c in task.collisions for a in [c.agent] + [c.partner] * (c.touch.kind == Partner.AGENT)}
    taken_out = set(np.flatnonzero(task.outcome == Outcome.COLLIDED).tolist())
    assert taken_out == (struck if on_collision == "retire" else set())


# Reward


def test_progress_telescopes_to_the_distance_gained() -> None:
    environment = environment_of(*busy_crowd(6), agents=[1, 2, 3])
    task = environment.task
    rewards = np.sum(drive(environment), axis=0)
    assert (task.outcome >= 0).all()
    assert rewards.shape == (task.cast.n_agent_slots,)
    start = np.linalg.norm(task.cast.agent_goal - task.cast.agent_start, axis=1)
    arrived = task.outcome == Outcome.ARRIVED
    assert arrived.any()
    collisions = sum(1 if c.touch.kind == 0 else 2 for c in task.collisions)
    assert collisions
    # All slots together: who was in which does not matter. Arrived ones end 0.3 to 0.5 m from their goals.
    bonus = ARRIVAL_REWARD * arrived.sum() + COLLISION_REWARD * collisions
    final = (PROGRESS_REWARD * start.sum() + bonus - rewards.sum()) / PROGRESS_REWARD
    assert arrived.all()
    assert 0.3 * len(start) <= final <= 0.5 * len(start)


def test_reward_of_each_step_is_progress_arrival_and_collision() -> None:
    environment = environment_of(walk([(0, 0), (3, 0)], 1.0), walk([(3, 0), (-3, 0)], 1.0), agents=[1])
    task, controller = environment.task, GoStraight()
    controller.reset(Limits.of(task.scenario))
    time_step, distance, seen, arrival = environment.reset(), 3.0, 0, False
    while not time_step.last():
        time_step = environment.step(controller.act(time_step.observation))
        now = float(np.linalg.norm(task.sample.position[0] - (3.0, 0.0)))
        arrival = now <= 0.5
        expected = (distance - now) + 5.0 * arrival - 5.0 * (len(task.collisions) - seen)
        np.testing.assert_allclose(time_step.reward, [expected], atol=1e-12)
        distance, seen = now, len(task.collisions)
    assert arrival and seen


def test_standing_agent_gains_nothing_and_times_out_with_discount_zero() -> None:
    environment = environment_of(walk([(0, 0), (1.5, 0)], 1.0), walk([(9, 9), (5, 9)], 1.0), agents=[1])
    rewards = wait(environment)
    assert environment.task.outcome.tolist() == [Outcome.TIMED_OUT]
    assert len(rewards) == 90  # (15 s + 1.5 m * 2 s/m) / 0.2 s
    assert np.abs(np.sum(rewards)) < 1e-4


def test_discount_is_zero_at_the_end_and_one_when_time_is_cut() -> None:
    crowd = (walk([(0, 0), (3, 0)], 1.0), walk([(9, 9), (5, 9)], 1.0))
    for time_limit, discount, steps in ((float("inf"), 0.0, 105), (2.0, 1.0, 10)):
        environment = environment_of(*crowd, agents=[1], time_limit=time_limit)
        time_step, count = environment.reset(), 0
        while not time_step.last():
            time_step = environment.step(still(environment))
            count += 1
        assert (time_step.discount, count) == (discount, steps)


# Actions


def test_action_outside_the_limits_is_held_within_them() -> None:
    far = (walk([(0, 0), (50, 0)], 1.0), walk([(9, 9), (5, 9)], 1.0))
    for turn_limit, yaw_rate in (("per_step", np.pi / 6.0 / DT), ("per_second", np.pi / 6.0)):
        environment = environment_of(*far, agents=[1], turn_limit=turn_limit)
        for action, twist in (([-50.0, 50.0], (0.0, yaw_rate)), ([60.0, 60.0], (1.0, 0.0)), ([-9.0, -9.0], (0.0, 0.0))):
            environment.reset()
            for _ in range(15):
                time_step = environment.step(np.array([action]))
            np.testing.assert_allclose(time_step.observation["twist"], [twist], rtol=0.01, atol=2e-3)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_action_that_is_not_finite_is_refused_with_slot_and_time(value: float) -> None:
    environment = tasks.load("scenario_4", {"dataset": TINY})
    environment.reset()
    environment.step(still(environment))
    before, action = state_of(environment), still(environment)
    action[1, 0] = value
    with pytest.raises(
        ValueError, match=rf"^action\[1\] = \[ *{value} +0\. *\] of an active agent at 0\.20 s; expected"
    ):
        environment.step(action)
    np.testing.assert_array_equal(state_of(environment), before)


def test_action_of_an_empty_slot_is_ignored() -> None:
    environment, states = tasks.load("scenario_4", {"dataset": TINY}), []
    for value in (0.0, np.nan):
        environment.reset()
        empty = environment.task.slot_agent < 0
        assert empty.any()
        environment.step(np.where(empty[:, None], value, still(environment)))
        states.append(state_of(environment))
    np.testing.assert_array_equal(*states)


@pytest.mark.parametrize("shape", [(6,), (1, 2), (3, 3), (2,)])
def test_action_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    environment = tasks.load("scenario_4", {"dataset": TINY})
    environment.reset()
    with pytest.raises(ValueError, match=r"expected \(3, 2\) = \(n_agents, \(left, right\)\)"):
        environment.step(np.zeros(shape))


# Determinism


def play(environment: control.Environment, steps: int) -> list[bytes]:
    """State, observation and reward of a run with random actions of a fixed seed."""
    random, spec = np.random.default_rng(3), environment.action_spec()
    time_step, found = environment.reset(), []
    for _ in range(steps):
        if time_step.last():
            break
        time_step = environment.step(random.uniform(spec.minimum, spec.maximum, spec.shape))
        found.append(state_of(environment).tobytes() + time_step.reward.tobytes())
        found += [value.tobytes() for value in time_step.observation.values()]
    return found


@pytest.mark.parametrize("on_collision", ["continue", "retire"])
def test_equal_configurations_give_equal_bits(on_collision: str) -> None:
    crowd, agents = busy_crowd(), [1, 3, 4, 6, 7]
    first = environment_of(*crowd, agents=agents, on_collision=on_collision)
    second = environment_of(*crowd, agents=agents, on_collision=on_collision)
    assert play(first, 150) == play(second, 150)
    assert len(first.task.collisions) > 3
    # Once more, in the environment that was used, from its end.
    collisions = [(c.agent, c.partner, c.touch.time, c.touch.impact_impulse) for c in first.task.collisions]
    assert play(first, 150) == play(second, 150)
    assert collisions == [(c.agent, c.partner, c.touch.time, c.touch.impact_impulse) for c in first.task.collisions]


@pytest.mark.parametrize("steps", [1, 30])
def test_reset_in_the_middle_equals_a_fresh_environment(steps: int) -> None:
    crowd, agents = busy_crowd(), [1, 3, 4, 6, 7]
    fresh, used = environment_of(*crowd, agents=agents), environment_of(*crowd, agents=agents)
    play(used, steps)
    assert used.task.step == steps
    used.reset()
    fresh.reset()
    np.testing.assert_array_equal(state_of(used), state_of(fresh))
    assert play(used, 40) == play(fresh, 40)


# The draw


def test_scenarios_of_one_seed_are_nested() -> None:
    for seed in range(4):
        cast = [tasks.load(name, {"dataset": TINY, "seed": seed}).task.cast for name in tasks.ALL_TASKS]
        drawn = [set(c.agent_person.tolist()) for c in cast]
        assert drawn[0] <= drawn[1] <= drawn[2] <= drawn[3]
        assert [len(d) for d in drawn] == [1, 1, 2, 3]  # floor(share * 3 + 1/2), at least one
        assert all(set(c.pedestrian_person.tolist()) | d == {1, 2, 3} for c, d in zip(cast, drawn, strict=True))


@pytest.mark.skipif("SOCIALNAV_MJ_DATA" not in os.environ, reason="needs the UCY recordings, see SOCIALNAV_MJ_DATA")
def test_students003_is_replaced_by_the_shares_of_the_paper_without_those_who_stay() -> None:
    previous: set[int] = set()
    recording = load_recording("students003")
    for share, count in zip(tasks.SHARES.values(), (43, 130, 304, 391), strict=True):
        cast = cast_recording(recording, Scenario(share=share, seed=5))
        drawn = set(cast.agent_person.tolist())
        assert len(drawn) == count and previous < drawn
        moved = np.linalg.norm(cast.agent_goal - cast.agent_start, axis=1)
        assert (moved >= 1.0).all()
        assert len(drawn) + cast.n_pedestrians == 434
        previous = drawn


def test_sample_cannot_be_written_to() -> None:
    environment = environment_of(*busy_crowd(), agents=[2, 3, 5, 7])
    environment.reset()
    for _ in range(20):  # agents have come in one after the other
        environment.step(still(environment))
    sample = environment.task.sample
    assert (sample.agent >= 0).any()
    for field in fields(sample):
        with pytest.raises(ValueError, match="read-only"):
            getattr(sample, field.name)[:] = 0
