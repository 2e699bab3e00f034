"""Planning: formulas beside numpy's, roll-outs beside the physics, loops beside arrays, memory, behaviour."""

import json

import numpy as np
import pytest
from scenes import environment_of, stand, walk
from test_controllers import LIMITS, observation, twist_of
from test_protocol import Walks, actions

from socialnav_mj.controllers import Limits, controller_config, controller_of, make_controller
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.planning import loops
from socialnav_mj.controllers.planning.arrays import NOT_WANTED, plan_costs
from socialnav_mj.controllers.planning.entrances import Entrances
from socialnav_mj.controllers.planning.foresight import MOST_NEIGHBOURS, Foresight
from socialnav_mj.controllers.planning.planner import PRESETS, WEIGHTS
from socialnav_mj.controllers.planning.search import KEPT, SAMPLES, library, search
from socialnav_mj.controllers.planning.terms import Crowd, terms_of
from socialnav_mj.controllers.planning.tracks import Tracks
from socialnav_mj.controllers.prediction import LAGS, STEP, Prediction, constant_velocity, load_prediction
from socialnav_mj.metrics.outcomes import success
from socialnav_mj.metrics.proximity import nearest_pedestrian_distance
from socialnav_mj.rollout import rollout

TERMS = terms_of(LIMITS, steps=16)
NO_ENTRANCES = 3 * [np.zeros((1, 0))]
EMPTY = Crowd(np.zeros((1, 17, 0)), np.zeros((1, 17, 0)), *3 * [np.zeros((1, 0))], *NO_ENTRANCES)


def crowd_at(places, velocities=None, clearance=6.0, zone=0.0, contact=0.32):
    """A crowd of one agent: others at places, with velocities."""
    places = np.asarray(places, dtype=float)
    velocities = np.zeros_like(places) if velocities is None else np.asarray(velocities, dtype=float)
    path = places + STEP * np.arange(17)[:, None, None] * velocities
    numbers = [np.full((1, len(places)), value) for value in (contact, clearance, zone)]
    return Crowd(path[None, ..., 0], path[None, ..., 1], *numbers, *NO_ENTRANCES)


def cost_of(plan, crowd=EMPTY, goal=(5.0, 0.0), speed=1.0):
    """Cost and clearance cost of one plan."""
    cost, clearance = plan_costs(
        np.array([[plan]], dtype=float), np.array([speed]), np.zeros(1), np.array([goal]), crowd, TERMS
    )
    return cost.item(), clearance.item()


# Formulas


def test_sines_and_bearings_are_numpys_to_the_stated_accuracy():
    angle = np.linspace(-4.0, 4.0, 1001)
    np.testing.assert_allclose(loops.sine_cosine(angle), [np.sin(angle), np.cos(angle)], atol=2e-9)
    small = np.linspace(-1.0, 1.0, 1001)
    np.testing.assert_allclose(loops.small_sine_cosine(small), [np.sin(small), np.cos(small)], atol=1e-9)
    angle = np.linspace(-np.pi, np.pi, 1001)
    np.testing.assert_allclose(loops.bearing(3.0 * np.sin(angle), 3.0 * np.cos(angle)), angle, atol=3e-8)
    assert loops.bearing(0.0, 0.0) == 0.0


@pytest.mark.parametrize(
    ("ends", "distance"),
    [
        ((-1.0, 1.0, 1.0, 1.0), 1.0),  # passes above
        ((1.0, 0.0, 2.0, 0.0), 1.0),  # goes away
        ((2.0, 2.0, 0.0, 1.0), 1.0),  # arrives at its nearest
        ((3.0, 4.0, 3.0, 4.0), 5.0),  # stands
    ],
)
def test_closest_is_the_distance_of_the_origin_from_a_segment(ends, distance):
    assert loops.closest(*ends) == pytest.approx(distance, abs=1e-9)


@pytest.mark.parametrize(("gap", "cost"), [(0.23, 0.0), (0.105, 0.25), (-0.02, 1.0), (-0.27, 4.0), (-0.32, 4.0)])
def test_lacking_clearance_is_the_square_of_the_missing_share(gap, cost):
    assert loops.lacking(0.32 + gap, 0.32, 0.23, TERMS) == pytest.approx(cost, abs=1e-12)


# What plans cost


def test_a_free_way_costs_its_time():
    """2.5 m at 1 m/s to the goal's edge 0.5 m before it; 5 m takes longer than the horizon, at full speed 4.5 s."""
    assert cost_of((0.0, 1.0, 1.0, 0.0, 1.0), goal=(3.0, 0.0))[0] == pytest.approx(2.5, abs=1e-6)
    assert cost_of((0.0, 1.0, 1.0, 0.0, 1.0))[0] == pytest.approx(4.5, abs=1e-6)
    # Standing for the whole horizon, faced away by 1 rad: 3.2 + 4.5 s + .15 s/rad, the robot stopping within .22 m.
    cost, _ = cost_of((1.0, 0.0, 9.0, 0.0, 1.0), speed=0.0)
    assert cost == pytest.approx(3.2 + 4.5 + 0.15, abs=1e-6)


def test_a_person_in_the_way_costs_clearance_and_time_within_the_zone():
    """Straight through somebody 1 m ahead, met in the fifth step, at .8 s: weight 6, 2^2, decayed by exp(-.8 / 2)."""
    plan = (0.0, 1.0, 1.0, 0.0, 1.0)
    cost, clearance = cost_of(plan, crowd_at([(1.0, 0.0)]))
    lack = 0.32 + 0.23 + 0.12 * 0.8
    expected = 6.0 * min(lack / (0.25 + 0.12 * 0.8), 2.0) ** 2 * np.exp(-0.4)
    assert clearance == pytest.approx(expected, rel=1e-6) and cost == pytest.approx(4.5 + clearance)
    cost, clearance = cost_of(plan, crowd_at([(1.0, 1.0)], clearance=0.0, zone=1.0))
    assert clearance == 0.0 and 0.8 < cost - 4.5 < 1.9  # 1.7 s within 1.3 m, most of it within 1 m


def test_clearance_is_half_the_sum_and_half_the_worst_of_others():
    plan, places = (0.0, 1.0, 1.0, 0.0, 1.0), [(1.0, 0.4), (2.0, -0.5)]
    both = cost_of(plan, crowd_at(places))[1]
    single = [cost_of(plan, crowd_at([place]))[1] for place in places]
    assert min(single) > 0.0 and both == pytest.approx(0.5 * sum(single) + 0.5 * max(single))


def test_standing_where_somebody_may_appear_costs_the_decayed_time():
    """On the spot all of it, 0.565 m beside it (1 - 1/4)^4, beyond 1.13 m nothing."""
    plan, whole = (0.0, 0.0, 9.0, 0.0, 1.0), TERMS.zone_time.sum()
    for distance, share in ((0.0, 1.0), (0.565, 0.75**4), (1.2, 0.0)):
        crowd = EMPTY._replace(entrance_x=np.zeros((1, 1)), entrance_y=np.full((1, 1), distance))
        crowd = crowd._replace(entrance_weight=np.full((1, 1), 2.0))
        added = cost_of(plan, crowd, speed=0.0)[0] - cost_of(plan, speed=0.0)[0]
        assert added == pytest.approx(2.0 * whole * share, abs=1e-12)


def random_problem(seed, n=6, k=9, p=40):
    """Plans of agents in a random crowd."""
    random = np.random.default_rng(seed)
    path = random.uniform(-4.0, 4.0, (n, 1, k, 2))
    path = path + STEP * np.arange(17)[:, None, None] * random.normal(0.0, 0.8, (n, 1, k, 2))
    weight = np.where(random.random((n, k)) < 0.8, random.uniform(0.0, 8.0, (n, k)), 0.0)
    zone = np.where(random.random((n, k)) < 0.5, random.uniform(0.0, 1.0, (n, k)), 0.0)
    entrances = [*random.uniform(-3.0, 3.0, (2, n, 4)), random.uniform(0.0, 0.5, (n, 4))]
    contact = random.uniform(0.2, 0.4, (n, k))
    crowd = Crowd(path[..., 0].copy(), path[..., 1].copy(), contact, weight, zone, *entrances)
    span = np.array([[-4.0, 0.0, 0.0, -1.0, 0.0], [4.0, 1.0, 2.5, 1.0, 1.0]])
    plans = random.uniform(*span, (n, p, 5))
    speed, yaw_rate = random.uniform(-0.2, 1.3, n), random.uniform(-3.0, 3.0, n)
    return plans, speed, yaw_rate, random.uniform(-3.0, 3.0, (n, 2)), crowd, TERMS


@pytest.mark.parametrize("seed", range(5))
def test_compiled_loops_give_the_bits_of_the_arrays(seed):
    pytest.importorskip("numba")
    problem = random_problem(seed)
    expected = plan_costs(*problem)
    everything = loops.compiled()(*problem, np.full(problem[0].shape[:2], np.inf), 0.0, NOT_WANTED)
    np.testing.assert_array_equal(everything, expected)
    best = np.full((6, 3), np.inf)
    some, clearance = loops.compiled()(*problem, best, 0.0, NOT_WANTED)
    np.testing.assert_array_equal(best, np.sort(expected[0], axis=1)[:, :3])
    given_up = np.isinf(some)
    assert given_up.mean() > 0.3 and (np.isinf(clearance) == given_up).all()
    np.testing.assert_array_equal(some[~given_up], expected[0][~given_up])
    assert (expected[0][given_up] > best[np.nonzero(given_up)[0], -1]).all()


def test_loops_are_right_without_the_compiler_too():
    problem = random_problem(7, n=2, k=3, p=4)
    found = loops.loop_costs(*problem, np.full((2, 4), np.inf), 0.0, NOT_WANTED)
    np.testing.assert_array_equal(found, plan_costs(*problem))


def test_wheel_speeds_are_the_same_bits_with_and_without_numba(monkeypatch):
    pytest.importorskip("numba")
    walks = Walks.made(5, n=8, m=12)
    fast = actions("mpc", walks)
    monkeypatch.setattr("socialnav_mj.controllers.planning.arrays.compiled", lambda: None)
    np.testing.assert_array_equal(actions("mpc", walks), fast)


# The search


def test_search_takes_the_cheapest_plan_and_refines_it():
    """Cost is the distance from a plan that is in no library; each round comes nearer."""
    target = np.array([0.3, 0.7, 0.8, 0.1, 0.9])

    def costs(plans, best):
        return np.abs(plans - target).sum(axis=2), np.zeros(plans.shape[:2])

    none = np.full((2, 5), np.nan)
    noise = np.random.default_rng(0).standard_normal((len(KEPT), SAMPLES, 5))
    found = [search(costs, np.tile([5.0, 0.0], (2, 1)), none, noise=noise[:k], max_speed=1.0).cost[0] for k in range(3)]
    assert found[0] > found[1] > found[2]
    last = search(costs, np.tile([5.0, 0.0], (2, 1)), np.stack([target, none[0]]), noise=noise, max_speed=1.0)
    np.testing.assert_array_equal(last.plan[0], target)
    np.testing.assert_allclose(last.cost, [-0.05, found[2]])


def test_library_begins_with_the_straight_way_and_keeps_the_limit():
    plans = library(0.8)
    assert plans.shape == (86, 5) and plans[0].tolist() == [0.0, 0.8, 0.4, 0.0, 0.8]
    assert plans[:, [1, 4]].max() == 0.8 and plans[:, 1].min() == 0.0


# Memory and prediction


def seen_walking(velocity, heading=0.0, place=(2.0, 1.0), there=True):
    """One agent that stands at the origin and one person who walks by, in the agent's frame."""
    c, s = np.cos(-heading), np.sin(-heading)
    turned = [[c, s], [-s, c]]
    result = observation(pedestrians=[np.asarray(place) @ turned])
    result["pedestrian_velocity"][0, 0] = np.asarray(velocity) @ turned
    result["pedestrian_mask"][0, 0] = there
    result["heading"][0] = heading
    return result


def test_tracks_remember_velocities_in_the_frame_of_now():
    tracks, place = Tracks(depth=8), np.array([2.0, 1.0])
    for k in range(5):
        seen = seen_walking((1.0 + k, 0.1), heading=0.3 * k, place=place)
        tracks.update(seen, elapsed=0.2)
        place = place + 0.2 * np.array([1.0 + k, 0.1])
    rows, columns = np.zeros(1, dtype=np.int64), np.zeros((1, 1), dtype=np.int64)
    found = tracks.velocities(seen, rows, columns, (0, 1, 3, 8))[0, 0]
    c, s = np.cos(1.2), np.sin(1.2)
    expected = np.array([[5.0, 0.1], [4.0, 0.1], [2.0, 0.1], [1.0, 0.1]]) @ [[c, -s], [s, c]]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("newcomer", ["jumped", "left and came", "another agent looks"])
def test_tracks_forget_when_somebody_else_is_in_the_column(newcomer):
    tracks = Tracks(depth=8)
    tracks.update(seen_walking((1.0, 0.0)), elapsed=0.2)
    if newcomer == "left and came":
        tracks.update(seen_walking((1.0, 0.0), there=False), elapsed=0.2)
    seen = seen_walking((0.0, 0.5), place=(2.8, 1.0) if newcomer == "jumped" else (2.2, 1.0))
    if newcomer == "another agent looks":
        seen["person"][0] = 8
    tracks.update(seen, elapsed=0.2)
    found = tracks.velocities(seen, np.zeros(1, dtype=np.int64), np.zeros((1, 1), dtype=np.int64), (0, 1))
    np.testing.assert_allclose(found[0, 0], [[0.0, 0.5], [0.0, 0.5]], atol=1e-12)


def test_tracks_report_who_appears_before_the_eyes_of_an_agent_that_was_there():
    tracks, pair = Tracks(depth=8), [(2.0, 1.0), (1.0, -1.0)]
    seen = [observation(pedestrians=pair) for _ in range(3)]
    for k, there in enumerate((1, 1, 2)):
        seen[k]["pedestrian_mask"][0, there:] = False
        seen[k]["position"][0], seen[k]["heading"][0] = (5.0, 5.0), np.pi / 2.0
    assert tracks.update(seen[0], elapsed=0.2).shape == (0, 2)  # there before anybody looked
    assert tracks.update(seen[1], elapsed=0.2).shape == (0, 2)
    np.testing.assert_allclose(tracks.update(seen[2], elapsed=0.2), [[6.0, 6.0]], atol=1e-12)


def test_entrances_count_who_appeared_near_and_how_often():
    """Three at nearly one place and one 1 m beside it in 10 s; 20 s are added. A place 5 m away is not told."""
    entrances = Entrances()
    entrances.note(np.array([[1.0, 0.0], [1.1, 0.1], [1.0, 1.0], [6.0, 0.0]]), elapsed=4.0)
    entrances.note(np.array([[1.0, 0.2]]), elapsed=6.0)
    x, y, frequency = entrances.around(np.array([[1.0, -1.0], [5.5, 0.0]]), np.array([np.pi / 2.0, 0.0]))
    np.testing.assert_allclose([*x[0], x[1, 0]], [1.0, 2.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(y[0], [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(frequency, [[3.0 / 30.0, 1.0 / 30.0], [1.0 / 30.0, 0.0]])
    assert Entrances().around(np.zeros((2, 2)), np.zeros(2))[0].shape == (2, 0)


def test_prediction_is_the_sum_over_lagged_velocities_by_hand():
    coefficients = np.zeros((2, len(LAGS)))
    coefficients[0, [0, 2]], coefficients[1, 5] = (0.3, -0.1), 0.4
    velocity = np.zeros((len(LAGS), 2))
    velocity[0], velocity[2], velocity[5] = (1.0, 2.0), (3.0, 0.0), (0.0, 5.0)
    found = Prediction(coefficients=coefficients)(velocity, steps=2)
    np.testing.assert_allclose(found, [[0.0, 0.6], [0.0, 2.0]], atol=1e-15)
    with pytest.raises(ValueError, match="steps = 3 is not allowed; allowed: at most 2"):
        Prediction(coefficients=coefficients)(velocity, steps=3)


def test_constant_velocity_goes_on_and_the_fitted_prediction_nearly_for_who_walks_on():
    velocity = np.tile([0.8, -0.3], (len(LAGS), 1))
    ahead = STEP * np.arange(1, 17)[:, None] * [0.8, -0.3]
    np.testing.assert_allclose(constant_velocity(16)(velocity, steps=16), ahead, atol=1e-12)
    fitted = load_prediction("linear", steps=16)(velocity, steps=16)
    assert np.abs(fitted - ahead).max() < 0.2


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (None, "there is no prediction"),
        ("{", "is no prediction for steps of 0.2 s"),
        ({"step": 0.1, "lags": list(LAGS), "coefficients": [[0.0] * 6]}, "it is made for steps of 0.1 s"),
        ({"step": 0.2, "lags": list(LAGS), "coefficients": [[0.0] * 5]}, r"shape \(1, 5\) are not allowed"),
        ({"step": 0.2, "lags": list(LAGS), "coefficients": [[0.0] * 6]}, "predicts 1 steps; expected at least 16"),
    ],
)
def test_load_prediction_says_what_is_wrong_with_a_file(tmp_path, content, named):
    path = tmp_path / "own.json"
    if content is not None:
        path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(ValueError, match=named):
        MPC(prediction=str(path))


def test_foresight_reckons_with_the_nearest_only():
    places = [(0.5 + 0.3 * k, 0.1 * k) for k in range(16)] + [(30.0, 0.0)]
    seen = observation(pedestrians=places[::-1], agents=[(0.0, 0.2)])
    ahead = Foresight(constant_velocity(16), LIMITS, steps=16).look(seen)
    assert ahead.path.shape == (1, 17, MOST_NEIGHBOURS, 2) and ahead.real.all()
    np.testing.assert_allclose(ahead.path[0, 5], [(0.0, 0.2), *places[: MOST_NEIGHBOURS - 1]])
    assert ahead.person[0].tolist() == [False] + [True] * (MOST_NEIGHBOURS - 1)


def test_foresight_expects_agents_to_keep_their_velocity_and_people_to_go_on_changing_it():
    """Somebody and an agent, both seen to slow down by 0.2 m/s a step."""
    foresight = Foresight(load_prediction("linear", steps=16), LIMITS, steps=16)
    x = np.array([2.0, 3.0])
    for speed in (1.0, 0.8, 0.6):
        seen = observation(pedestrians=[(x[0], 1.0)], agents=[(x[1], -1.0)])
        seen["pedestrian_velocity"][0, 0] = seen["agent_velocity"][0, 1] = (speed, 0.0)
        ahead = foresight.look(seen)
        x += 0.2 * (speed - 0.2)
    moved = ahead.path[0, :, :, 0] - ahead.path[0, 0, :, 0]
    assert ahead.person[0].tolist() == [True, False]
    np.testing.assert_allclose(moved[:, 1], STEP * 0.6 * np.arange(17), atol=1e-12)
    assert (moved[1:, 0] < moved[1:, 1] - 0.005).all()


# Behaviour


@pytest.mark.parametrize(
    ("kwargs", "named"),
    [
        ({"preset": "wild"}, "preset = 'wild' is not allowed; allowed: social, brisk, free, calm"),
        ({"zone_weight": -1.0}, "zone_weight = -1.0 is not allowed; allowed: numbers >= 0"),
        ({"person_weight": float("nan")}, "person_weight = nan"),
        ({"prediction": "oracle"}, "there is no prediction 'oracle'; available: constant_velocity, linear"),
    ],
)
def test_mpc_says_what_is_allowed(kwargs, named):
    with pytest.raises(ValueError) as caught:
        MPC(**kwargs)
    assert named in str(caught.value)


def test_presets_are_weights_and_a_weight_that_is_given_stays():
    for preset, weights in PRESETS.items():
        controller = make_controller(f"mpc(preset={preset!r})")
        assert tuple(getattr(controller, f"{kind}_weight") for kind in WEIGHTS) == weights
        assert controller.name == f"mpc(preset={preset!r})"
        assert controller_of(controller_config(controller)) == controller
    mixed = make_controller("mpc(preset='calm', zone_weight=0.5)")
    assert (mixed.person_weight, mixed.zone_weight) == (PRESETS["calm"][0], 0.5)


def test_mpc_turns_towards_a_goal_behind_and_drives_straight_to_one_ahead():
    np.testing.assert_allclose(twist_of(MPC(), goal=(8.0, 0.0)), [1.0, 0.0], atol=0.05)
    assert twist_of(MPC(), goal=(-5.0, 2.0))[1] > 2.0


def test_mpc_gives_way_to_whoever_stands_ahead_and_to_the_side_that_is_free():
    left = twist_of(MPC(), goal=(8.0, 0.0), speed=1.0, pedestrians=[(1.2, 0.15)])
    right = twist_of(MPC(), goal=(8.0, 0.0), speed=1.0, pedestrians=[(1.2, -0.15)])
    assert left[1] < -0.3 and right[1] > 0.3


def episode_of(spec, *walks, **kwargs):
    return rollout(environment_of(*walks, **kwargs), make_controller(spec))


CROSSING = (walk([(-3.0, 0.0), (3.0, 0.0)], 1.0), walk([(0.0, -3.2), (0.0, 4.0)], 1.0))


def nearest_person(episode):
    return np.nanmin(nearest_pedestrian_distance(episode))


@pytest.mark.parametrize("preset", PRESETS)
def test_mpc_lets_a_crossing_person_pass_and_arrives(preset):
    """Both would be at the origin at 3.0 to 3.2 s; whoever goes straight is hit."""
    assert not success(episode_of("go_straight", *CROSSING)).all()
    episode = episode_of(f"mpc(preset={preset!r})", *CROSSING)
    assert success(episode).all() and nearest_person(episode) > 0.4


def test_calm_stays_out_of_the_zone_that_free_cuts_through():
    """Somebody stands 0.7 m beside the straight way of 8 m."""
    walks = (walk([(-4.0, 0.0), (4.0, 0.0)], 1.0), stand((0.0, 0.7), 0.0, 30.0))
    free, calm = (nearest_person(episode_of(f"mpc(preset={name!r})", *walks)) for name in ("free", "calm"))
    assert free < 1.0 and calm > 1.15


def test_mpc_with_the_other_turn_limit_and_step_arrives_too():
    for kwargs in ({"turn_limit": "per_second"}, {"control_timestep": 0.1}, {"robot_max_speed": 0.6}):
        assert success(episode_of("mpc", *CROSSING, **kwargs)).all(), kwargs
    assert Limits.of(environment_of(*CROSSING, turn_limit="per_second").task.scenario).max_yaw_rate < 0.6
