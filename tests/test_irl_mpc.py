"""`irl_mpc`: features and reward along plans beside those of the policy, loops beside arrays, what it gives way to."""

import numpy as np
import pytest
from test_planning import CROSSING, episode_of, nearest_person, random_problem
from test_protocol import Walks, actions

from socialnav_mj.controllers import controller_config, controller_of, make_controller, with_policy_of
from socialnav_mj.controllers.irl_mpc import IRLMPC
from socialnav_mj.controllers.planning import learned
from socialnav_mj.controllers.planning.arrays import plan_costs
from socialnav_mj.controllers.planning.learned_arrays import learned_costs
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.replay_irl import load_policy
from socialnav_mj.features import Continuous, View, running_state
from socialnav_mj.geometry import to_agent_frame
from socialnav_mj.metrics.outcomes import success

LAYERS = tuple((np.ascontiguousarray(w.T), b) for w, b in load_policy("students003_continuous_seed0").reward)
TOP = 0.2
SCALE = np.full(4, 0.5)


def asked(seed):
    """Plans of agents in a random crowd, for both ways to ask for the reward."""
    plans, speed, yaw_rate, goal, crowd, terms = random_problem(seed)
    states = np.full((*plans.shape[:2], 4, 6), np.nan)
    base, _ = plan_costs(plans, speed, yaw_rate, goal, crowd, terms, states)
    return base, states, goal, crowd.x, crowd.y, terms.step, SCALE, TOP, LAYERS


def test_formulas_are_numpys_to_the_stated_accuracy():
    x = np.linspace(0.0, 30.0, 999)
    np.testing.assert_allclose(learned.decaying(x), np.exp(-x), atol=1e-10)
    both = np.linspace(-9.0, 9.0, 999)
    np.testing.assert_allclose(learned.squashed(both), np.tanh(both), atol=1e-10)


def test_what_a_plan_lacks_in_reward_is_that_of_the_features_an_agent_would_see():
    base, states, goal, x, y, step, scale, top, layers = asked(0)
    policy, features = load_policy("students003_continuous_seed0"), Continuous()
    found = learned_costs(base, states, goal, x, y, step, scale, top, layers) - base
    expected = np.zeros_like(base)
    for i, q in np.ndindex(base.shape):
        for a, k in enumerate((3, 7, 11, 15)):
            own = states[i, q, a]
            if np.isnan(own[0]):
                continue
            heading = np.arctan2(own[3], own[2])
            there = np.stack([x[i, k + 1], y[i, k + 1]], axis=1)
            before = np.stack([x[i, k], y[i, k]], axis=1)
            view = View(
                goal=to_agent_frame(goal[i] - own[:2], heading)[None],
                twist=own[None, 4:],
                position=to_agent_frame(there - own[:2], heading)[None],
                velocity=to_agent_frame((there - before) / step, heading)[None] - [own[4], 0.0],
                present=np.ones((1, x.shape[2]), dtype=bool),
            )
            reward = policy.reward_of(running_state(features(view)))[0]
            expected[i, q] += scale[a] * max(top - reward, 0.0)
    assert expected.max() > 2.0 * expected.min()
    np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_loops_give_the_bits_of_the_arrays_for_all_plans_that_can_be_best(seed):
    pytest.importorskip("numba")
    problem = asked(seed)
    expected = learned_costs(*problem)
    everything = learned.compiled()(*problem, np.full(problem[0].shape, np.inf))
    np.testing.assert_array_equal(everything, expected)
    best = np.full((6, 3), np.inf)
    some = learned.compiled()(*problem, best)
    np.testing.assert_array_equal(best, np.sort(expected, axis=1)[:, :3])
    left_out = np.isinf(some)
    assert left_out.mean() > 0.3
    np.testing.assert_array_equal(some[~left_out], expected[~left_out])


def test_loops_are_right_without_the_compiler_too():
    base, states, *rest = asked(1)
    problem = (base[:, :3], states[:, :3], *rest)
    found = learned.loop_costs(*problem, np.full((6, 3), np.inf))
    np.testing.assert_array_equal(found, learned_costs(*problem))


def test_nobody_around_and_plans_given_up_are_no_trouble():
    base, states, goal, x, y, *rest = asked(2)
    base[:, ::2] = np.inf
    empty = (base, states, goal, x[..., :0], y[..., :0], *rest)
    found = learned_costs(*empty)
    assert np.isinf(found[:, ::2]).all() and np.isfinite(found[:, 1::2]).all()
    if loops := learned.compiled():
        np.testing.assert_array_equal(loops(*empty, np.full(base.shape, np.inf)), found)


def test_wheel_speeds_are_the_same_bits_with_and_without_numba(monkeypatch):
    pytest.importorskip("numba")
    walks = Walks.made(5, n=4, m=12)
    fast = actions("irl_mpc", walks)
    monkeypatch.setattr("socialnav_mj.controllers.planning.arrays.compiled", lambda: None)
    monkeypatch.setattr("socialnav_mj.controllers.planning.learned.compiled", lambda: None)
    np.testing.assert_array_equal(actions("irl_mpc", walks), fast)


def test_without_weight_it_is_the_free_planner_and_with_it_another():
    walks = Walks.made(6, n=8, m=14)
    free = actions("mpc(preset='free')", walks)
    np.testing.assert_array_equal(actions("irl_mpc(learned_weight=0.0)", walks), free)
    assert np.abs(actions("irl_mpc(learned_weight=3.0)", walks) - free).max() > 0.1


def test_irl_mpc_lets_a_crossing_person_pass_and_arrives():
    episode = episode_of("irl_mpc", *CROSSING)
    assert success(episode).all() and nearest_person(episode) > 0.4


def test_its_policy_is_that_of_the_recording_and_travels_with_its_checksum():
    spec = with_policy_of("irl_mpc(learned_weight=2.0)", "students003")
    controller = make_controller(spec)
    assert controller.policy == "students003_continuous_seed0" and controller.learned_weight == 2.0
    config = controller_config(controller)
    assert len(config["checksum"]) == 64 and controller_of(config) == controller


@pytest.mark.parametrize(
    ("setting", "error", "named"),
    [
        ({"learned_weight": -1.0}, ValueError, "learned_weight = -1.0 is not allowed; allowed: numbers >= 0"),
        ({"policy": "nobody"}, PolicyError, "there is no policy 'nobody'"),
        ({"checksum": "0" * 64}, PolicyError, "but 0000"),
    ],
)
def test_impossible_settings_are_refused(setting, error, named):
    with pytest.raises(error, match=named):
        IRLMPC(**setting)
