"""A few wild episodes in every run of the tests, a hundred in the slow ones; `python -m tests.wild` runs any number."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scenes import environment_of, still, walk
from wild import WatchedPhysics, broken_rules, main, run_wild, stopped_speed, summary, thrown_out

from socialnav_mj.config import MIN_CONTACT_DISTANCE
from socialnav_mj.environment import Environment

wild_run = cache(run_wild)


@pytest.mark.parametrize("seed", [0, 67, 82, 168])
def test_wild_episode_breaks_no_rule(seed: int) -> None:
    run = wild_run(seed)
    assert run.broken == []
    assert "1 episodes, " in summary([run]) and "0 episodes broke a rule" in summary([run])


def test_jumping_crowd_of_people_who_yield_leaves_the_numbers_finite() -> None:
    run = run_wild(
        0, pedestrian_body="compliant"
    )  # somebody who is driven along a jump throws a robot out of the numbers
    assert run.broken == [] and len(run.episode.contact_time)


@pytest.mark.slow
def test_hundred_wild_episodes_break_no_rule() -> None:
    assert main(["--episodes", "100", "--seed", "10000", "--jobs", "-1"]) == 0


def test_broken_rules_are_told() -> None:
    run, other = wild_run(168), wild_run(82)
    assert len(run.episode.contact_time)
    assert broken_rules(run, run.episode) == []
    assert broken_rules(run, other.episode) == ["a second run has another state hash"]
    assert "a robot at 99.00 m/s" in broken_rules(replace(run, speed=99.0), run.episode)[0]
    assert "a robot at 99.00 m/s" in broken_rules(replace(run, thrown_speed=99.0), run.episode)[0]
    assert "3 bodies went through a robot" in broken_rules(replace(run, tunnels=3), run.episode)[0]
    assert broken_rules(replace(run, squeezed_tunnels=3), run.episode) == []
    assert "slots" in broken_rules(replace(run, lost_slots=1), run.episode)[0]
    forces = np.full_like(run.episode.contact_impact_impulse, np.inf)
    endless = replace(run, episode=replace(run.episode, contact_impact_impulse=forces))
    assert broken_rules(endless, run.episode) == ["a contact force is not finite and >= 0"]
    told = summary([run, replace(other, broken=["it fell apart"])])
    assert "1 episodes broke a rule" in told and "seed 82" in told.splitlines()[-1] and "it fell apart" in told


@pytest.mark.parametrize("solid", [True, False])
def test_person_who_walks_through_a_robot_is_seen(solid: bool) -> None:
    environment = environment_of(walk([(0, 0), (10, 0)], 1.0), walk([(1.5, 0.01), (-9, 0.01)], 1.0), agents=[1])
    physics = WatchedPhysics.from_mujoco(environment.physics.model.ptr)
    physics.watch(environment.task)
    watched = Environment(physics, environment.task, control_timestep=0.2)
    watched.reset()
    if not solid:
        physics.model.geom_contype[physics.model.geom("agent_000/bumper").id] = 0
        physics.model.geom_conaffinity[physics.model.geom("agent_000/bumper").id] = 0
    for _ in range(15):
        watched.step(still(watched))
    assert bool(physics.tunnels) is not solid
    assert physics.lost_slots == 0


@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi])
@pytest.mark.parametrize(("robot", "person"), [(0.17, 0.08), (0.1, 0.15), (0.2, 0.05), (0.17, 0.15)])
def test_person_slower_than_the_stopped_speed_pushes_a_robot_and_a_much_faster_one_goes_through(
    robot: float, person: float, heading: float
) -> None:
    assert robot + person >= MIN_CONTACT_DISTANCE
    towards = 10.0 * np.array([np.cos(heading), np.sin(heading)])
    for factor in (0.97, 1.35):
        speed = factor * stopped_speed(robot + person, 0.01)
        environment = environment_of(
            walk([(0, 0), towards], 1.0),
            walk([(2, 0), (-9, 0)], speed),
            agents=[1],
            robot_radius=robot,
            pedestrian_radius=person,
        )
        time_step = environment.reset()
        for _ in range(int(2.5 / speed / 0.2) + 1):
            if not time_step.last():  # an overturned robot is taken out
                time_step = environment.step(still(environment))
        ahead = environment.physics.agent_position()[0, 0] < environment.physics.data.mocap_pos[0, 0]
        assert (ahead and not time_step.last()) == (factor < 1.0), speed


def test_two_bodies_throw_a_robot_out_faster_than_one_and_less_so_in_smaller_steps() -> None:
    assert thrown_out(0.01) == pytest.approx(29.6, abs=0.1) and thrown_out(0.001) == pytest.approx(15.6, abs=0.1)
