"""Metrics against what nobody here wrote (PedPy), closed forms, and the physics' contacts against geometry."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pedpy
import pytest
from episodes import Agent, Pedestrian, build_episode, line
from hypothesis import given, settings
from hypothesis import strategies as st

import tasks
from socialnav_mj import metrics
from socialnav_mj.controllers import GoStraight
from socialnav_mj.episode import Partner
from socialnav_mj.human import human_episode
from socialnav_mj.metrics.contacts import geometric_contacts
from socialnav_mj.metrics.kinematics import acceleration, speed
from socialnav_mj.metrics.pairs import pairs
from socialnav_mj.metrics.time_to_collision import disc_contact_time
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.rollout import rollout

DT, CONTACT = 0.2, 0.32
GRAZE = 0.02
"""How far apart logged poses may be in a touch: between two samples bodies turn, are pushed and tilt [m]."""
finite = st.floats(-5, 5)


def wave(t, phase):
    """A smooth walk [m]."""
    return np.stack([0.8 * t + 0.3 * np.sin(1.1 * t + phase), 0.7 * np.sin(0.9 * t + 2 * phase)], axis=-1)


def pedpy_data(tracks, frame_rate):
    rows = [(i, k, *p) for i, track in enumerate(tracks) for k, p in enumerate(track) if np.isfinite(p[0])]
    frame = pd.DataFrame(rows, columns=["id", "frame", "x", "y"])
    return pedpy.TrajectoryData(data=frame, frame_rate=frame_rate)


def test_speed_is_pedpys():
    """PedPy centres its differences; on a log twice as fine, at frame step 1, they are ours to the last digits."""
    fine = [wave(0.5 * DT * np.arange(81), phase) for phase in (0.0, 1.0, 2.5)]
    episode = build_episode([Agent(positions=track[::2]) for track in fine])
    theirs = pedpy.compute_individual_speed(traj_data=pedpy_data(fine, 2 / DT), frame_step=1)
    ours = speed(episode)
    between = theirs[theirs["frame"] % 2 == 1]  # between two of our samples
    assert len(between) == 3 * 40
    np.testing.assert_allclose(ours[(between["frame"] - 1) // 2, between["id"]], between["speed"], atol=1e-9)


def test_acceleration_is_pedpys():
    """PedPy 1.5 takes the second difference of a frame and the two before it (its page says: on both sides)."""
    tracks = [wave(DT * np.arange(41), phase) for phase in (0.0, 1.0, 2.5)]
    episode = build_episode([Agent(positions=track) for track in tracks])
    theirs = pedpy.compute_individual_acceleration(traj_data=pedpy_data(tracks, 1 / DT), frame_step=1)
    assert len(theirs) == 3 * 39
    ours = acceleration(episode)[theirs["frame"] - 2, theirs["id"]]
    np.testing.assert_allclose(ours, theirs["acceleration"], atol=1e-9)


def test_neighbour_distances_are_pedpys():
    agents = [wave(DT * np.arange(40), phase) for phase in (0.0, 1.0)]
    people = [wave(DT * np.arange(40), phase) + np.array([0, 1]) for phase in (2.0, 3.0, 4.0)]
    episode = build_episode([Agent(positions=a) for a in agents], [Pedestrian(positions=p) for p in people])
    everybody = [(i, k, j) for i in range(2) for k in range(40) for j in range(2, 5)]
    neighbourhood = pd.DataFrame(everybody, columns=["id", "frame", "neighbor_id"])
    data = pedpy_data([*agents, *people], 1 / DT)
    theirs = pedpy.compute_neighbor_distance(traj_data=data, neighborhood=neighbourhood)
    nearest = theirs.groupby(["frame", "id"])["distance"].min().unstack().to_numpy()
    np.testing.assert_allclose(metrics.nearest_pedestrian_distance(episode), nearest, atol=1e-9)
    assert metrics.minimum_distance(episode) == pytest.approx(nearest[:-1].min(axis=0), abs=1e-9)
    assert metrics.mean_distance(episode) == pytest.approx(nearest[:-1].mean(axis=0), abs=1e-9)


@settings(max_examples=200, deadline=None)
@given(offset=st.tuples(finite, finite), velocity=st.tuples(finite, finite), radius=st.floats(0.05, 1.0))
def test_time_to_collision_is_the_first_root_of_the_distance(offset, velocity, radius):
    x, v = np.array(offset), np.array(velocity)
    found = float(disc_contact_time(x, v, radius))
    if x @ x <= radius**2:
        assert found == 0.0
        return
    roots = np.roots([v @ v, 2 * x @ v, x @ x - radius**2]) if v @ v > 1e-6 else np.zeros(0)
    real = [r.real for r in roots if abs(r.imag) < 1e-9 and r.real >= 0]
    if math.isinf(found):
        # A root may come from rounding alone where the discs just graze.
        closest = np.linalg.norm(x + max(0.0, -(x @ v) / max(v @ v, 1e-12)) * v)
        assert not real or closest == pytest.approx(radius, abs=1e-6)
    else:
        assert np.linalg.norm(x + found * v) == pytest.approx(radius, abs=1e-6)
        assert not real or found == pytest.approx(min(real), rel=1e-5, abs=1e-6)


@given(distance=st.floats(0.5, 20), closing=st.floats(0.05, 3))
def test_time_to_collision_of_a_head_on_approach_is_gap_over_closing_speed(distance, closing):
    time = disc_contact_time(np.array([distance, 0.0]), np.array([-closing, 0.0]), CONTACT)
    assert float(time) == pytest.approx((distance - CONTACT) / closing)


@given(a=st.floats(0.5, 10), b=st.floats(0, 10), n=st.integers(2, 30))
def test_spl_of_a_detour_round_a_corner_is_hypotenuse_over_legs(a, b, n):
    way = np.concatenate([line((0, 0), (a, 0), n), line((a, 0), (a, b), n)[1:]])
    episode = build_episode([Agent(positions=way)])
    assert metrics.path_length(episode) == pytest.approx([a + b])
    assert metrics.spl(episode) == pytest.approx([math.hypot(a, b) / (a + b)])


@given(angle=st.floats(-3.1, 3.1), n=st.integers(1, 20))
def test_irregularity_of_a_straight_drive_off_a_far_goal_is_the_angle(angle, n):
    way = line((0, 0), (1e-3 * math.cos(angle), 1e-3 * math.sin(angle)), n)
    episode = build_episode([Agent(positions=way, goal=(1e3, 0))])
    assert metrics.path_irregularity(episode) == pytest.approx([abs(angle)], abs=1e-5)


def test_failures_to_progress_of_a_standing_agent_are_one_every_ten_seconds():
    stand, creep = np.zeros((153, 2)), line((0, 0), (0.049 * 30.4, 0), 152)
    episode = build_episode([Agent(positions=stand, goal=(9, 0)), Agent(positions=creep, goal=(9, 0))])
    assert metrics.failures_to_progress(episode).tolist() == [3, 3]  # 30.4 s; 0.49 m in 10 s is not enough
    quick = build_episode([Agent(positions=line((0, 0), (0.051 * 30.4, 0), 152), goal=(9, 0))])
    assert metrics.failures_to_progress(quick).tolist() == [0]


@pytest.fixture(scope="module")
def crowd():
    """The first 25 s of plaza, everybody who enters by then."""
    whole = load_recording("plaza")
    keep = [i for i, t in enumerate(whole.times) if t[0] < 25.0]
    return Recording(
        name="plaza_25s",
        variant=whole.variant,
        frame_rate=whole.frame_rate,
        ids=whole.ids[keep],
        times=tuple(whole.times[i] for i in keep),
        positions=tuple(whole.positions[i] for i in keep),
        checksum=whole.checksum,
    )


@pytest.fixture(scope="module")
def driven(crowd):
    """A third of that crowd replaced by robots that drive straight into whatever is there."""
    return rollout(tasks.load("scenario_2", {"dataset": crowd}), GoStraight())


def test_logged_contacts_are_the_geometric_ones_but_for_people_who_appear_on_robots_and_grazes(driven):
    person = driven.contact_partner_kind == Partner.PEDESTRIAN
    logged = np.zeros((driven.n_agents, driven.n_pedestrians), dtype=bool)
    logged[driven.contact_agent[person], driven.contact_partner[person]] = True
    geometric = geometric_contacts(driven)
    assert (logged & geometric).sum() >= 10
    near = pairs(driven)
    first = np.isfinite(driven.pedestrian_heading).argmax(axis=0)
    for agent, pedestrian in np.argwhere(geometric != logged):
        own = (near.agent == agent) & (near.pedestrian == pedestrian)
        distance, steps = near.distance[own], near.step[own]
        closest = min(distance.min(), *_swept(near.offset[own]))
        appeared_on_it = steps[0] == first[pedestrian] and distance[0] <= CONTACT
        if geometric[agent, pedestrian]:
            assert appeared_on_it or closest > CONTACT - GRAZE, (agent, pedestrian, closest)
        else:
            assert closest < CONTACT + GRAZE, (agent, pedestrian, closest)


def _swept(offset):
    """Least distance between samples, straight lines, on a fine grid."""
    share = np.linspace(0, 1, 21)[:, None, None]
    between = (1 - share) * offset[:-1] + share * offset[1:]
    return np.linalg.norm(between, axis=-1).min(axis=0)


def test_contacts_of_the_human_row_are_the_geometric_ones_but_for_people_who_appear_in_touch(crowd):
    episode = human_episode(crowd, tasks.load("scenario_2", {"dataset": crowd}).task.scenario)
    person = episode.contact_partner_kind == Partner.PEDESTRIAN
    logged = np.zeros((episode.n_agents, episode.n_pedestrians), dtype=bool)
    logged[episode.contact_agent[person], episode.contact_partner[person]] = True
    near = pairs(episode)
    for agent, pedestrian in np.argwhere(geometric_contacts(episode) != logged):
        own = (near.agent == agent) & (near.pedestrian == pedestrian)
        closest = min(near.distance[own].min(), *_swept(near.offset[own]))
        assert near.distance[own][0] <= CONTACT or abs(closest - CONTACT) < GRAZE, (agent, pedestrian, closest)


def test_speeds_of_recorded_people_are_pedpys_within_the_change_of_a_step(crowd):
    """PedPy's central differences over 0.4 s against the recording's own derivative, at a step's distance."""
    episode = human_episode(crowd, tasks.load("scenario_2", {"dataset": crowd}).task.scenario)
    data = pedpy_data(np.moveaxis(episode.agent_position, 1, 0), 1 / DT)
    theirs = pedpy.compute_individual_speed(traj_data=data, frame_step=1)
    ours = speed(episode)[theirs["frame"], theirs["id"]]
    difference = np.abs(ours - theirs["speed"].to_numpy())
    assert np.median(difference) < 0.02 and np.percentile(difference, 95) < 0.2


def test_metrics_do_not_change_when_an_equal_episode_follows_another():
    """The pairs of the last episode are remembered; another object must never get them."""
    one = build_episode([Agent(positions=line((0, 0), (4, 0), 20))], [Pedestrian(positions=np.tile((2, 1), (21, 1)))])
    two = replace(one, pedestrian_position=one.pedestrian_position + 1.0)
    before = metrics.minimum_distance(one), metrics.minimum_distance(two)
    after = metrics.minimum_distance(two), metrics.minimum_distance(one)
    assert before[0] == after[1] == pytest.approx(1.0) and before[1] == after[0] == pytest.approx(2.0)
