"""The recorded people's own row: contacts and arrivals by closed form, and by a second counting."""

import math

import numpy as np
import pytest
from scenes import Walk, busy_crowd, environment_of, stand, walk

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode, Outcome, Partner
from socialnav_mj.human import _runs, human_episode
from socialnav_mj.metrics import per_agent

DT, H = 0.2, 0.01  # control and physics step [s]
EAST = walk([(-3, 0), (3, 0)], 1.0)
NORTH = walk([(0, -3), (0, 3)], 1.0, begin=0.2)
"""Crosses the way of EAST 0.2 s after it: their distance is at least 0.2 / sqrt(2) = 0.14 m."""


def human(*walks: Walk, agents=(1,), **kwargs) -> Episode:
    task = environment_of(*walks, agents=agents, **kwargs).task
    return human_episode(task.recording, task.scenario, scenario_name="made")


def test_crossing_tracks_touch_when_where_and_as_fast_as_the_closed_form_says():
    """With s = t - 3 s the distance is sqrt(s^2 + (s - 0.2)^2), below 0.32 m for -0.103 < s < 0.303."""
    episode = human(EAST, NORTH)
    assert episode.contact_partner_kind.tolist() == [Partner.PEDESTRIAN] and episode.contact_agent.tolist() == [0]
    np.testing.assert_allclose(episode.contact_time, [2.90], atol=1e-9)
    np.testing.assert_allclose(episode.contact_duration, [0.41], atol=1e-9)  # 2.90, 2.91, ... 3.30 s
    np.testing.assert_allclose(episode.contact_position, [[-0.05, -0.15]], atol=1e-9)
    np.testing.assert_allclose(episode.contact_normal, [[0.1 / math.sqrt(0.1), -0.3 / math.sqrt(0.1)]], atol=1e-7)
    np.testing.assert_allclose(episode.contact_agent_velocity, [[1.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(episode.contact_partner_velocity, [[0.0, 1.0]], atol=1e-9)
    np.testing.assert_allclose(episode.contact_closing_speed, [0.4 / math.sqrt(0.1)], rtol=1e-6)
    np.testing.assert_allclose(episode.contact_agent_heading, [0.0], atol=1e-9)
    assert np.isnan(episode.contact_impact_impulse).all() and np.isnan(episode.contact_impact_force).all()


def test_two_replaced_people_stand_in_two_mirrored_rows():
    episode = human(EAST, NORTH, stand((9, 9), 0.0, 1.0), agents=[1, 2])
    assert episode.contact_agent.tolist() == [0, 1] and episode.contact_partner.tolist() == [1, 0]
    assert (episode.contact_partner_kind == Partner.AGENT).all()
    one, two = ({name: getattr(episode, f"contact_{name}")[k] for name in NAMES} for k in (0, 1))
    np.testing.assert_array_equal(one["normal"], -two["normal"])
    np.testing.assert_array_equal(one["agent_velocity"], two["partner_velocity"])
    np.testing.assert_array_equal(one["partner_velocity"], two["agent_velocity"])
    assert one["time"] == two["time"] and one["duration"] == two["duration"]


NAMES = ("time", "duration", "normal", "agent_velocity", "partner_velocity")


@pytest.mark.parametrize(("radius", "touches"), [(0.19, 1), (0.183, 1), (0.182, 0)])
def test_people_touch_only_nearer_than_the_sum_of_the_radii(radius, touches):
    """The robot's radius is 0.1 m here; the two come as near as 0.4 / sqrt(2) = 0.2828 m."""
    later = walk([(0, -3), (0, 3)], 1.0, begin=0.4)
    assert len(human(EAST, later, robot_radius=0.1, pedestrian_radius=radius).contact_time) == touches


def test_replayed_people_alone_give_no_rows():
    assert not len(human(walk([(8, 8), (4, 8)], 1.0), EAST, NORTH, agents=[1]).contact_time)


def test_overlap_at_the_appearance_does_not_count_until_the_pair_was_apart():
    """Side by side: 0.1 m apart at the start, 0.6 m in between, 0.1 m at the end of 3 s."""
    times = np.arange(4.0)
    straight = np.stack([times, np.zeros(4)], axis=-1)
    beside = np.stack([times, [0.1, 0.6, 0.6, 0.1]], axis=-1)
    episode = human(Walk(times, 3.0 * straight), Walk(times, beside * [3.0, 1.0]))
    assert len(episode.contact_time) == 1 and 2.0 < episode.contact_time[0] < 3.0
    apart = human(Walk(times[:2], 3.0 * straight[:2]), Walk(times[:2], beside[:2] * [3.0, 1.0]))
    assert not len(apart.contact_time)


def test_arrival_follows_the_agents_rule_and_metrics_are_the_same_code():
    """6 m at 1 m/s: within 0.5 m of the goal from 5.5 s on, so at the sample of 5.6 s."""
    episode = human(EAST, NORTH)
    assert episode.agent_end_time[0] == pytest.approx(5.6) and episode.agent_outcome.tolist() == [Outcome.ARRIVED]
    np.testing.assert_array_equal(np.flatnonzero(episode.agent_policy[:, 0] == 0), np.arange(28))
    np.testing.assert_array_equal(episode.agent_policy[28:, 0], -1)
    np.testing.assert_allclose(episode.agent_position[:29, 0, 0], DT * np.arange(29) - 3.0, atol=1e-9)
    assert np.isnan(episode.agent_wheel_speed).all() and np.isnan(episode.agent_deadline).all()
    values = {name: value[0] for name, value in per_agent(episode).items()}
    assert values["completion_steps"] == 28 and values["completion_time"] == pytest.approx(5.6)
    assert values["distance_to_displacement"] == pytest.approx(5.6 / 6.0)
    assert values["average_speed"] == pytest.approx(1.0)
    assert (values["success"], values["collisions_pedestrian"], values["spawn_delay"]) == (False, 1, 0.0)
    # sqrt(s^2 + (s - 0.2)^2) < 1.2 m for -0.743 < s < 0.943: samples 2.4, 2.6, ... 3.8 s.
    assert values["intimate_intrusions"] == 8


def test_touch_after_the_arrival_is_not_counted():
    """Somebody stands 0.2 m beside the goal: nearer than 0.32 m only after the arrival at 0.4 m from the goal."""
    assert not len(human(EAST, stand((3.0, 0.2), 0.0, 6.0)).contact_time)


def test_pedestrian_who_appears_on_the_replaced_person_is_a_ghost_and_one_who_was_there_is_not():
    """At 2.2 s the person is at x = -1.8; who appeared with it, or before it, is no ghost."""
    person = walk([(-3, 0), (3, 0)], 1.0, begin=1.0)
    appears = walk([(-1.7, 0.1), (-1.7, 3.0)], 1.0, begin=2.2)
    was_there = stand((-2.9, 0.2), 0.0, 2.0)
    with_it = walk([(-3, -0.3), (3, -0.3)], 1.0, begin=1.0)
    episode = human(person, appears)
    assert episode.agent_ghost_overlaps.tolist() == [1] and not len(episode.contact_time)
    values = per_agent(episode)
    assert values["success"].tolist() == [True] and values["success_if_ghosts_count"].tolist() == [False]
    for other in (was_there, with_it):
        assert human(person, other).agent_ghost_overlaps.tolist() == [0]


def test_replayed_and_replaced_people_are_those_of_the_robots_episode():
    environment = environment_of(*busy_crowd(), agents=[2, 5, 7])
    episode = human_episode(environment.task.recording, environment.task.scenario)
    cast = environment.task.cast
    assert episode.agent_person.tolist() == [2, 5, 7]
    np.testing.assert_array_equal(episode.pedestrian_person, cast.pedestrian_person)
    np.testing.assert_array_equal(episode.agent_goal, cast.agent_goal)
    np.testing.assert_array_equal(episode.agent_appear_time, cast.agent_appear_step * DT)


def counted_touches(episode: Episode, recording, scenario: Scenario) -> dict[tuple[int, int, int], int]:
    """Touches of each (agent, kind, partner), by a walk through time with one state for each pair."""
    crowd = [(Partner.AGENT, j, person) for j, person in enumerate(episode.agent_person)]
    crowd += [(Partner.PEDESTRIAN, j, person) for j, person in enumerate(episode.pedestrian_person)]
    ids = recording.ids.tolist()
    result: dict[tuple[int, int, int], int] = {}
    for i, person in enumerate(episode.agent_person):
        for kind, j, other in crowd:
            if other == person:
                continue
            touching, apart_for, first = False, 0, True
            for k in range(len(episode.time)):
                there = episode.agent_policy[k, i] >= 0
                if kind == Partner.AGENT:
                    there &= episode.agent_policy[k, j] >= 0
                else:
                    there &= np.isfinite(episode.pedestrian_heading[k, j])
                if not there:
                    continue
                for time in k * DT + H * np.arange(20):
                    x = recording.person(ids.index(person)).at([time])[0][0]
                    y = recording.person(ids.index(other)).at([time])[0][0]
                    near = math.dist(x, y) <= scenario.contact_distance
                    if near and not touching and (first or apart_for >= 20):
                        if not first:
                            result[i, int(kind), j] = result.get((i, int(kind), j), 0) + 1
                        touching = True
                    if near:
                        apart_for = 0
                    else:
                        apart_for += 1
                        touching = touching and apart_for < 20
                    first = False
    return result


def test_touches_of_a_crowd_are_those_of_a_second_counting():
    environment = environment_of(*busy_crowd(9, seed=3, side=3.0), agents=[1, 4, 8])
    task = environment.task
    episode = human_episode(task.recording, task.scenario)
    rows = zip(episode.contact_agent, episode.contact_partner_kind, episode.contact_partner, strict=True)
    found: dict[tuple[int, int, int], int] = {}
    for agent, kind, partner in rows:
        key = int(agent), int(kind), int(partner)
        found[key] = found.get(key, 0) + 1
    assert found == counted_touches(episode, task.recording, task.scenario)
    assert len(found) >= 3


@pytest.mark.parametrize(
    ("touching", "runs"),
    [
        ("", []),
        ("....", []),
        ("##..", [(0, 2)]),
        (".##.#.", [(1, 5)]),  # apart for less than 3
        (".#...#", [(1, 2), (5, 6)]),
        ("#..#..#", [(0, 7)]),
    ],
)
def test_runs_that_part_for_less_than_the_rearm_time_are_one(touching, runs):
    assert _runs(np.array([c == "#" for c in touching], dtype=bool), merge=3) == runs


def test_equal_recordings_give_equal_hashes_and_others_do_not():
    one, two, other = human(EAST, NORTH), human(EAST, NORTH), human(NORTH, EAST)
    assert one.metadata["state_hash"] == two.metadata["state_hash"] != other.metadata["state_hash"]
    assert one.metadata["controller"] == "human" and one.policies == ("human",)
