"""Features of a view: symmetries, closed forms, hard cases, and the tables of the docstrings."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialnav_mj.features import (
    COLLISION_FLAG,
    FEATURE_SETS,
    GOAL_FLAG,
    N_FLAGS,
    SIGHT,
    Affinity,
    Continuous,
    Risk,
    View,
    absorbing_state,
    closest_approach,
    feature_set,
    mirror_state,
    running_state,
    view_of,
)
from socialnav_mj.observation import observe

BOTH = pytest.mark.parametrize("features", FEATURE_SETS.values(), ids=FEATURE_SETS)
PROXIMITY, CLOSING, TANGENTIAL, RISK = 6, 18, 30, 42


def view(goal=(3.0, 0.0), twist=(0.5, 0.0), people=(), velocities=None) -> View:
    """What one agent sees; velocities are relative and 0 if not given."""
    position = np.array(people, dtype=float).reshape(1, -1, 2)
    velocity = np.zeros_like(position) if velocities is None else np.array(velocities, dtype=float).reshape(1, -1, 2)
    return View(
        goal=np.array([goal], dtype=float),
        twist=np.array([twist], dtype=float),
        position=position,
        velocity=velocity,
        present=np.ones(position.shape[:2], dtype=bool),
    )


def world(seed: int, *, angle: float = 0.0, shift=(0.0, 0.0), side: float = 1.0):
    """Observation of a random scene that is mirrored (side = -1), then turned, then moved."""
    random = np.random.default_rng(seed)
    n, m = 4, 9

    def turned(vector):
        x, y = vector[..., 0], side * vector[..., 1]
        return np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], axis=-1)

    heading = random.uniform(-np.pi, np.pi, n)
    speed = random.uniform(0.0, 1.0, n)
    velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return observe(
        active=np.array([True, True, False, True]),
        person=np.arange(n),
        position=turned(random.uniform(-3.0, 3.0, (n, 2))) + shift,
        heading=side * heading + angle,
        velocity=turned(velocity),
        yaw_rate=side * random.uniform(-2.6, 2.6, n),
        goal=turned(random.uniform(-6.0, 6.0, (n, 2))) + shift,
        pedestrian_position=turned(random.uniform(-3.0, 3.0, (m, 2))) + shift,
        pedestrian_velocity=turned(random.uniform(-1.5, 1.5, (m, 2))),
        pedestrian_slots=np.array([0, 2, 3, 5, 6, 8]),
    )


def features_of(features, observation):
    return features(view_of(observation, np.flatnonzero(observation["active"])))


# Symmetries


@BOTH
@given(
    seed=st.integers(0, 10**6),
    angle=st.floats(-10.0, 10.0),
    shift=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
)
def test_features_do_not_change_when_the_scene_is_turned_and_moved(features, seed, angle, shift):
    expected = features_of(features, world(seed))
    assert expected.shape == (3, features.size)
    moved = features_of(features, world(seed, angle=angle, shift=np.array(shift)))
    np.testing.assert_allclose(moved, expected, atol=1e-9)


@BOTH
@given(seed=st.integers(0, 10**6), angle=st.floats(-3.0, 3.0))
def test_mirror_gives_the_features_of_the_mirrored_scene(features, seed, angle):
    mirrored = features_of(features, world(seed, angle=angle, side=-1.0))
    np.testing.assert_allclose(features.mirror(features_of(features, world(seed))), mirrored, atol=1e-9)


GRID = st.integers(-8, 8).map(lambda k: 0.25 * k)
PLACE = st.tuples(GRID, GRID)
"""Quarter metres hit the sectors' edges, the axes, the rings and the agent's own place exactly."""


@BOTH
@given(goal=PLACE, speed=GRID, turn=GRID, people=st.lists(st.tuples(PLACE, PLACE), max_size=5))
def test_mirror_is_exact_on_every_edge_and_values_are_finite(features, goal, speed, turn, people):
    places, velocities = [p for p, _ in people], [v for _, v in people]
    seen = view(goal, (abs(speed), turn), places, velocities)
    flip = np.array([1.0, -1.0])
    other = View(
        goal=seen.goal * flip,
        twist=seen.twist * flip,
        position=seen.position * flip,
        velocity=seen.velocity * flip,
        present=seen.present,
    )
    values = features(seen)
    assert np.isfinite(values).all() and np.abs(values).max() <= 2.0
    np.testing.assert_array_equal(features.mirror(values), features(other))
    np.testing.assert_array_equal(features.mirror(features.mirror(values)), values)


@BOTH
def test_mirror_keeps_leading_shapes_and_its_input(features):
    values = np.random.default_rng(0).normal(size=(2, 3, features.size))
    before = values.copy()
    assert features.mirror(values).shape == values.shape
    np.testing.assert_array_equal(values, before)
    np.testing.assert_array_equal(features.mirror(values)[1, 2], features.mirror(values[1, 2]))


@BOTH
@given(seed=st.integers(0, 10**6))
def test_order_of_people_and_company_of_other_agents_do_not_matter(features, seed):
    """Rows are independent of each other, and people are a set."""
    observation = world(seed)
    together = features_of(features, observation)
    alone = [features(view_of(observation, np.array([row])))[0] for row in np.flatnonzero(observation["active"])]
    np.testing.assert_array_equal(together, alone)
    order = np.random.default_rng(seed).permutation(9)
    shuffled = {k: v[:, order] if k.startswith("pedestrian_") else v for k, v in observation.items()}
    np.testing.assert_allclose(features_of(features, shuffled), together, atol=1e-12)


# Views


def test_view_is_relative_to_the_agents_own_motion_and_people_are_alike():
    """At 0.5 m/s ahead, somebody walking to the left at 1 m/s moves (-0.5, 1) for the agent, whoever it is."""
    observation = observe(
        active=np.array([True, True]),
        person=np.array([3, 4]),
        position=np.array([[0.0, 0.0], [2.0, 0.0]]),
        heading=np.zeros(2),
        velocity=np.array([[0.5, 0.0], [0.0, 1.0]]),
        yaw_rate=np.zeros(2),
        goal=np.ones((2, 2)),
        pedestrian_position=np.array([[1.0, -1.0], [np.nan, np.nan]]),
        pedestrian_velocity=np.array([[0.0, 1.0], [np.nan, np.nan]]),
        pedestrian_slots=np.array([0]),
    )
    seen = view_of(observation, np.array([0]))
    assert seen.present.tolist() == [[True, True]]  # the empty column and the agent itself are left out
    np.testing.assert_allclose(seen.position[0], [[1.0, -1.0], [2.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(seen.velocity[0], [[-0.5, 1.0], [-0.5, 1.0]], atol=1e-15)


# Closest approach


def test_closest_approach_is_the_closed_form():
    """3 m ahead and 4 m left, coming at 1 m/s along x: at 3 s, 4 m away; receding, standing and meeting likewise."""
    position = np.array([[3.0, 4.0], [3.0, 4.0], [3.0, 4.0], [2.0, 0.0], [0.0, 0.0]])
    velocity = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0], [-0.5, 0.0], [1.0, 1.0]])
    time, miss = closest_approach(position, velocity)
    np.testing.assert_allclose(time, [3.0, 0.0, 0.0, 4.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(miss, [4.0, 5.0, 5.0, 0.0, 0.0], atol=1e-15)


@given(seed=st.integers(0, 10**6))
def test_closest_approach_is_the_least_distance_of_the_straight_motion(seed):
    """Nobody is nearer at any of 2,000 later moments, and the distance at that time is the one given."""
    random = np.random.default_rng(seed)
    position, velocity = random.uniform(-3.0, 3.0, (6, 2)), random.uniform(-1.0, 1.0, (6, 2))
    time, miss = closest_approach(position, velocity)
    moments = np.linspace(0.0, 20.0, 2000)[:, None, None]
    assert (np.linalg.norm(position + velocity * moments, axis=-1) >= miss - 1e-9).all()
    np.testing.assert_allclose(np.linalg.norm(position + velocity * time[:, None], axis=1), miss, atol=1e-12)


# Continuous


def test_continuous_own_part_is_the_closed_form():
    """Goal 3 m ahead and 4 m left, 0.7 m/s, half the largest yaw rate; beyond 10 m the distance saturates."""
    values = Continuous()(view((3.0, 4.0), (0.7, 1.309)))[0]
    np.testing.assert_allclose(values[:6], [0.6, 0.8, 0.5, np.exp(-5.0), 0.7, 0.5], rtol=1e-12)
    assert not values[6:].any()
    assert Continuous()(view((30.0, 40.0)))[0, 2] == 1.0


def test_continuous_person_is_in_its_sector_with_its_motion():
    """2 m to the left is sector 3; (1, -1) m/s closes at 1 m/s and moves to the right, -1 m/s; miss sqrt(2), at 1 s."""
    values = Continuous()(view(people=[(0.0, 2.0)], velocities=[(1.0, -1.0)]))[0]
    expected = np.zeros(48)
    expected[[3, 15, 27]] = np.exp(-1.0), 0.5, -0.5
    expected[39] = np.exp(-1.0 / 2.0 - np.sqrt(2.0) / 0.5)
    np.testing.assert_allclose(values[6:], expected, atol=1e-12)


def test_continuous_shows_the_nearest_but_the_greatest_risk():
    """1 m ahead somebody walks off, 2 m ahead somebody comes at 2 m/s: seen is the first, risk is the second's."""
    values = Continuous()(view(people=[(2.0, 0.0), (1.0, 0.0)], velocities=[(-2.0, 0.0), (3.0, 0.0)]))[0]
    np.testing.assert_allclose(values[PROXIMITY], np.exp(-0.5))
    assert values[CLOSING] == -1.0  # clipped
    np.testing.assert_allclose(values[RISK], np.exp(-0.5))


def test_continuous_sees_up_to_its_sight_and_no_risk_beyond_its_horizon():
    far, near = Continuous()(view(people=[(SIGHT, 0.0)]))[0], Continuous()(view(people=[(SIGHT - 1e-6, 0.0)]))[0]
    assert not far[6:].any() and near[PROXIMITY] > 0.0
    slow = Continuous()(view(people=[(2.0, 0.0)], velocities=[(-0.5, 0.0)]))[0]  # 4 s away
    quick = Continuous()(view(people=[(2.0, 0.0)], velocities=[(-0.51, 0.0)]))[0]
    assert slow[CLOSING] == 0.25 and slow[RISK] == 0.0 and quick[RISK] > 0.13


# Risk


def test_risk_own_part_follows_the_table():
    """Sizes of the bearing change at 1/8, 1/4 and 1/2 pi; sectors are centred; the ninth means nearer than 1 m."""
    risk = Risk()
    for angle, size, sector in ((0.0, 0, 0), (0.3, 0, 0), (0.5, 1, 1), (1.2, 2, 2), (-1.2, 2, 6), (3.0, 3, 4)):
        values = risk(view((5.0 * np.cos(angle), 5.0 * np.sin(angle))))[0]
        assert np.flatnonzero(values[:13]).tolist() == [size, 4 + sector], angle
    assert np.flatnonzero(risk(view((0.9, 0.0)))[0, :13]).tolist() == [0, 12]
    assert np.flatnonzero(risk(view((1.0, 0.0)))[0, :13]).tolist() == [0, 4]
    turns = [(-2.0, 13), (-0.8, 14), (-0.3, 14), (-0.2, 15), (0.0, 15), (0.2, 15), (0.3, 16), (0.8, 16), (2.0, 17)]
    for turn, index in turns:
        assert np.flatnonzero(risk(view(twist=(0.5, turn)))[0, 13:18]).tolist() == [index - 13], turn
    for speed, index in [(0.0, 0), (0.1, 1), (0.29, 1), (0.5, 3), (0.89, 4), (0.9, 5), (1.0, 5)]:
        assert np.flatnonzero(risk(view(twist=(speed, 0.0)))[0, 74:]).tolist() == [index], speed


@pytest.mark.parametrize(
    ("place", "velocity", "expected"),
    [
        ((0.79, 0.0), (-1.0, 0.0), [18 + 2]),  # inner ring, comes straight: high
        ((0.8, 0.0), (-1.0, 0.0), [18 + 24 + 2]),  # outer ring
        ((1.3, 0.0), (-1.0, 0.0), []),  # beyond both
        ((1.0, 0.0), (1.0, 0.0), [18 + 24]),  # walks off: low
        ((1.0, 0.0), (0.0, 0.0), [18 + 24]),  # stands: low
        ((1.0, 0.0), (-0.25, 0.0), [18 + 24]),  # comes in 4 s: low
        ((1.0, 0.0), (-0.26, 0.0), [18 + 24 + 2]),  # comes in less
        ((0.6, 0.6), (-1.0, 0.0), [18 + 24 + 3 + 1]),  # passes at 0.6 m: medium, first sector to the left
        ((0.49, 0.0), (1.0, 0.0), [18, 66]),  # nearer than 0.5 m
        ((-0.4, 0.0), (0.0, 0.0), [18 + 12, 66 + 4]),  # behind
    ],
)
def test_risk_of_one_person_is_the_cell_of_the_table(place, velocity, expected):
    values = Risk()(view(people=[place], velocities=[velocity]))[0]
    assert (18 + np.flatnonzero(values[18:74])).tolist() == expected


@given(seed=st.integers(0, 10**6))
def test_risk_is_binary_and_every_group_holds_one(seed):
    values = features_of(Risk(), world(seed))
    assert set(np.unique(values)) <= {0.0, 1.0}
    for begin, end in ((0, 4), (4, 13), (13, 18), (74, 80)):
        assert (values[:, begin:end].sum(axis=1) == 1.0).all()
    assert (values[:, 18:66].reshape(-1, 16, 3).sum(axis=2) <= 1.0).all()


def test_risk_cell_takes_the_greatest_of_its_people():
    values = Risk()(view(people=[(1.0, 0.0), (1.1, 0.0)], velocities=[(1.0, 0.0), (-1.0, 0.0)]))[0]
    assert (18 + np.flatnonzero(values[18:74])).tolist() == [18 + 24 + 2]


# Hard cases and states


@BOTH
def test_nobody_and_no_agent_are_allowed(features):
    alone = features(view())
    empty = {k: v[:0] if k in ("goal", "twist") else v for k, v in vars(view()).items()}
    none = features(View(**{**empty, "position": np.zeros((0, 0, 2)), "velocity": np.zeros((0, 0, 2))}))
    assert alone.shape == (1, features.size) and np.isfinite(alone).all()
    assert none.shape == (0, features.size)


@BOTH
def test_absent_people_do_not_count_whatever_their_entries(features):
    seen = view(people=[(1.0, 0.5), (0.7, 0.0)], velocities=[(-1.0, 0.0), (-1.0, 0.0)])
    absent = View(**{**vars(seen), "present": np.zeros((1, 2), dtype=bool)})
    np.testing.assert_array_equal(features(absent), features(view()))


@BOTH
def test_states_carry_lowered_flags_under_way_and_one_raised_at_the_end(features):
    values = features(view(people=[(1.0, 0.5)]))
    state = running_state(values)
    assert state.shape == (1, features.size + N_FLAGS) and not state[:, -N_FLAGS:].any()
    np.testing.assert_array_equal(state[:, :-N_FLAGS], values)
    goal, collision = absorbing_state(features.size, GOAL_FLAG), absorbing_state(features.size, COLLISION_FLAG)
    assert goal.sum() == collision.sum() == 1.0 and goal[-2] == collision[-1] == 1.0
    for flagged in (goal, collision):
        np.testing.assert_array_equal(mirror_state(features, flagged), flagged)
    np.testing.assert_array_equal(mirror_state(features, state)[0, :-2], features.mirror(values)[0])


def test_affinity_map_counts_and_averages_the_people_of_a_cell():
    """Two ahead at 2 m, who close at 1 and 3 m/s; one 3 m to the left, who crosses forwards at 1 m/s; one too far."""
    people = [(2.0, 0.0), (2.0, 0.01), (0.0, 3.0), (7.0, 0.0)]
    values = Affinity()(view(people=people, velocities=[(-1.0, 0.0), (-3.0, 0.0), (1.0, 0.0), (-1.0, 0.0)]))[0]
    expected = np.zeros(78)
    expected[:6] = 1.0, 0.0, 0.3, np.exp(-3.0), 0.5, 0.0
    expected[14], expected[22 + 2] = 2 / 3, 1 / 2
    expected[38] = 1.0  # mean closing speed 2 m/s
    expected[70 + 2] = -0.5
    np.testing.assert_allclose(values, expected, atol=0.01)
    np.testing.assert_array_equal(np.flatnonzero(values[6:]) + 6, [14, 24, 38, 62, 72])


def test_feature_sets_are_found_by_name_and_errors_name_them():
    assert feature_set("risk").size == 80 and feature_set("continuous").size == 54
    with pytest.raises(
        ValueError, match="unknown feature set 'rsk'; available: continuous, companions, risk, sam, people"
    ):
        feature_set("rsk")


@BOTH
def test_docstring_table_covers_every_index_once(features):
    """The rows of the table, read as index ranges, are 0 ... size - 1."""
    rows = re.findall(r"^    \| (\d[^|]*)\|", type(features).__doc__, flags=re.MULTILINE)
    indices = []
    for row in rows:
        numbers = [int(number) for number in re.findall(r"\d+", row)]
        if "k" in row:
            many = features.n_people if features.name == "people" else features.n_sectors
            indices += range(numbers[0], numbers[0] + many)
        else:
            indices += range(numbers[0], numbers[-1] + 1)
    assert indices == list(range(features.size)) == list(range(features(view()).shape[1]))
