"""Metrics of the paper against values worked out by hand."""

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj import metrics
from socialnav_mj.episode import Episode, Outcome, Partner

EAST = line((0, 0), (4, 0), 20)  # 1 m/s for 4 s: samples every 0.2 m


def standing(where, n_samples):
    return Pedestrian(positions=np.tile(where, (n_samples, 1)))


def test_built_episode_is_valid_and_survives_a_file(tmp_path):
    episode = build_episode(
        [
            Agent(positions=EAST, spawn_step=3, delay_steps=2),
            Agent(positions=line((0, 2), (4, 2), 10), outcome=Outcome.TIMED_OUT, goal=(9, 2)),
            Agent(positions=[(1, 1)], outcome=Outcome.NEVER_SPAWNED, goal=(5, 5)),
        ],
        [Pedestrian(positions=line((2, 0), (2, 3), 15))],
        [Touch(agent=0, partner=0, step=4.5), Touch(agent=0, partner=1, step=3, kind=Partner.AGENT)],
    )
    assert episode.n_agents == 3 and episode.n_pedestrians == 1
    assert episode.agent_active.sum(axis=0).tolist() == [20, 10, 0]
    assert episode.contact_agent.tolist() == [0, 1, 0]
    assert Episode.load(episode.save(tmp_path / "a.npz")).metadata == episode.metadata


def test_straight_run_past_a_standing_person_has_the_values_worked_out_by_hand():
    episode = build_episode(
        [Agent(positions=EAST, goal=(4.5, 0), spawn_step=3, delay_steps=2)], [standing((2, 0.6), 30)]
    )
    values = {name: array[0] for name, array in metrics.per_agent(episode).items()}
    expected = {
        "success": True,
        "arrived": True,
        "timed_out": False,
        "never_spawned": False,
        "completion_time": pytest.approx(4.0),
        "completion_steps": 20,
        "time_under_way": pytest.approx(4.0),
        "completion_censored": False,
        "active_steps": 20,
        "displacement": 4.5,
        "path_length": pytest.approx(4.0),
        "distance_to_displacement": pytest.approx(4.0 / 4.5),
        "average_speed": pytest.approx(1.0),
        # |x - 2| < sqrt(1.2^2 - 0.6^2) = 1.039: x = 1.0, 1.2 ... 3.0
        "intimate_intrusions": 11,
        "intrusion_share": pytest.approx(11 / 20),
        "minimum_distance": pytest.approx(0.6),
        "collisions_pedestrian": 0,
        "collisions_agent": 0,
        "first_partner": metrics.NOBODY,
        "spawn_delay": pytest.approx(0.4),
    }
    assert {name: values[name] for name in expected} == expected


def test_detour_round_a_corner_has_ratio_seven_fifths():
    corner = np.concatenate([line((0, 0), (3, 0), 6), line((3, 0), (3, 4), 8)[1:]])
    episode = build_episode([Agent(positions=corner)])
    assert metrics.distance_to_displacement(episode) == pytest.approx([1.4])
    assert metrics.average_speed(episode) == pytest.approx([7.0 / (14 * 0.2)])


def test_time_out_is_censored_and_keeps_its_speed_and_intrusions():
    episode = build_episode([Agent(positions=EAST, goal=(9, 0), outcome=Outcome.TIMED_OUT)], [standing((2, 0), 21)])
    values = metrics.per_agent(episode)
    assert values["timed_out"].all() and values["completion_censored"].all() and not values["success"].any()
    for name in ("completion_time", "completion_steps", "distance_to_displacement"):
        assert np.isnan(values[name]).all(), name
    assert values["time_under_way"] == pytest.approx([4.0])
    assert values["average_speed"] == pytest.approx([1.0])
    assert values["intimate_intrusions"].tolist() == [11]  # x = 1.0 ... 3.0; at 0.8 the distance is 1.2


@pytest.mark.parametrize("outcome", [Outcome.COLLIDED, Outcome.UNFINISHED])
def test_run_that_was_cut_is_censored_but_no_time_out(outcome):
    episode = build_episode([Agent(positions=EAST, goal=(9, 0), outcome=outcome)])
    assert metrics.completion_censored(episode).tolist() == [True]
    assert metrics.timed_out(episode).tolist() == metrics.success(episode).tolist() == [False]


def test_agent_that_never_spawned_fails_and_has_no_other_value():
    episode = build_episode(
        [Agent(positions=[(0, 0)], outcome=Outcome.NEVER_SPAWNED, goal=(3, 4))], [standing((0, 0), 5)]
    )
    values = metrics.per_agent(episode)
    assert not values["success"].any() and not values["completion_censored"].any() and values["never_spawned"].all()
    assert values["displacement"].tolist() == [5.0] and values["active_steps"].tolist() == [0.0]
    for name in ("time_under_way", "path_length", "average_speed", "intimate_intrusions", "intrusion_share",
                 "minimum_distance", "spawn_delay", "completion_time", "distance_to_displacement"):  # fmt: skip
        assert np.isnan(values[name]).all(), name


def test_arrival_at_the_spawn_sample_has_no_speed_and_no_share():
    values = metrics.per_agent(build_episode([Agent(positions=[(0, 0)], goal=(0.3, 0))]))
    assert values["success"].all() and values["completion_time"].tolist() == [0.0]
    assert values["path_length"].tolist() == [0.0]
    assert np.isnan(values["average_speed"]).all() and np.isnan(values["intrusion_share"]).all()


@pytest.mark.parametrize(("distance", "steps"), [(1.2, 0), (np.nextafter(1.2, 0), 4), (1.3, 0)])
def test_intrusion_is_strictly_nearer_than_the_limit(distance, steps):
    episode = build_episode([Agent(positions=np.zeros((5, 2)), goal=(3, 0))], [standing((distance, 0), 5)])
    assert metrics.intimate_intrusions(episode).tolist() == [steps]


def test_sample_of_the_end_is_not_an_active_step():
    walker = Pedestrian(positions=[(0.8, 0.1)], first_step=4)
    episode = build_episode([Agent(positions=line((0, 0), (0.8, 0), 4))], [walker])
    assert metrics.intimate_intrusions(episode).tolist() == [0.0]
    assert np.isnan(metrics.minimum_distance(episode)).all()


def test_step_with_several_people_near_counts_once_and_agents_do_not_count():
    agents = [Agent(positions=np.zeros((5, 2)), goal=(3, 0)), Agent(positions=np.full((5, 2), 9.0), goal=(3, 0))]
    beside = Agent(positions=np.full((5, 2), 9.5), goal=(3, 0))
    episode = build_episode([*agents, beside], [standing((0.5, 0), 5), standing((0, -0.7), 5)])
    assert metrics.intimate_intrusions(episode).tolist() == [4.0, 0.0, 0.0]
    assert metrics.minimum_distance(episode)[0] == 0.5


def test_collisions_are_counted_by_partner_and_void_success_of_both_agents():
    agents = [
        Agent(positions=EAST),
        Agent(positions=line((0, 1), (4, 1), 20)),
        Agent(positions=line((0, 5), (4, 5), 20)),
    ]
    touches = [
        Touch(agent=0, partner=1, step=8.35, kind=Partner.AGENT),
        Touch(agent=0, partner=0, step=9.5),
        Touch(agent=0, partner=0, step=12.0),
    ]
    episode = build_episode(agents, [standing((2, 0), 21)], touches)
    assert metrics.collisions(episode).tolist() == [3, 1, 0]
    assert metrics.collisions(episode, Partner.PEDESTRIAN).tolist() == [2, 0, 0]
    assert metrics.collisions(episode, Partner.AGENT).tolist() == [1, 1, 0]
    assert metrics.success(episode).tolist() == [False, False, True]
    assert metrics.arrived(episode).all() and not np.isnan(metrics.completion_time(episode)).any()
    assert metrics.first_partner(episode).tolist() == [Partner.AGENT, Partner.AGENT, metrics.NOBODY]


def test_first_partner_at_the_same_instant_is_the_pedestrian():
    agents = [Agent(positions=EAST), Agent(positions=line((0, 1), (4, 1), 20))]
    touches = [Touch(agent=0, partner=1, step=8, kind=Partner.AGENT), Touch(agent=0, partner=0, step=8)]
    episode = build_episode(agents, [standing((2, 0), 21)], touches)
    assert metrics.first_partner(episode).tolist() == [Partner.PEDESTRIAN, Partner.AGENT]


@pytest.mark.parametrize(("step", "success"), [(20, False), (20 + 1e-9, False), (21, True)])
def test_touch_counts_up_to_the_end_and_not_after(step, success):
    episode = build_episode([Agent(positions=EAST)], [standing((4, 0), 30)], [Touch(agent=0, partner=0, step=step)])
    assert metrics.success(episode).tolist() == [success]


def test_nearest_distance_is_infinite_without_people_and_nan_without_the_agent():
    episode = build_episode(
        [Agent(positions=np.zeros((3, 2)), goal=(3, 0), spawn_step=1)], [Pedestrian(positions=[(3, 4)], first_step=2)]
    )
    assert metrics.nearest_pedestrian_distance(episode)[:, 0] == pytest.approx([np.nan, np.inf, 5, np.inf], nan_ok=True)


def test_episode_without_agents_gives_empty_arrays():
    for name, array in metrics.per_agent(build_episode([], [standing((0, 0), 3)])).items():
        assert array.shape == (0,), name
