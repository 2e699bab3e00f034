"""`mppi`: its formulas beside pytorch-mppi, sequences beside plans, loops beside arrays, behaviour."""

import numpy as np
import pytest
import toy_mppi as toy
from test_controllers import twist_of
from test_planning import CROSSING, episode_of, nearest_person, random_problem
from test_protocol import Walks, actions

from socialnav_mj.controllers.mppi import MPPI
from socialnav_mj.controllers.planning import loops
from socialnav_mj.controllers.planning.arrays import plan_costs
from socialnav_mj.controllers.planning.path_integral import (
    control_costs,
    correlated,
    improved,
    weights_of,
    whitened,
)
from socialnav_mj.metrics.outcomes import success

OF_PYTORCH_MPPI = [
    [0.22416855913920788, -0.4649836603985632],
    [0.5355956369653071, 0.5290974189139425],
    [0.6964563380342876, 0.7924620152157914],
    [0.9952308714593545, -0.5228616031630182],
    [0.37733502172110583, 0.963392988410781],
    [0.6327277550713153, 0.9991872269951355],
]
"""What `python tests/toy_mppi.py` prints with pytorch-mppi 0.9.1 and torch 2."""


def test_commands_on_a_toy_problem_are_those_of_pytorch_mppi():
    plan, place, commands = np.zeros((1, toy.STEPS, 2)), toy.START, []
    for drawn in toy.noise():
        plan = np.concatenate([plan[:, 1:], np.zeros((1, 1, 2))], axis=1)
        made = np.clip(plan[:, None] + drawn, toy.LOW, toy.HIGH) - plan[:, None]
        places = place + np.cumsum(toy.moved(np.zeros(2), plan[:, None] + made), axis=2)
        drawn_to = control_costs(plan, made, deviation=toy.DEVIATION, correlation=0.0, weight=toy.TEMPERATURE)
        weight = weights_of(toy.cost(places).sum(axis=2) + drawn_to, toy.TEMPERATURE)
        plan = improved(plan, made, weight)
        commands.append(plan[0, 0])
        place = toy.moved(place, plan[0, 0])
    np.testing.assert_allclose(commands, OF_PYTORCH_MPPI, atol=1e-12)


def test_weights_are_exponentials_of_costs_and_sum_to_one():
    found = weights_of(np.array([[3.0, 3.0 + np.log(2.0), np.inf, 100.0], [5.0, 5.0, 5.0, 5.0]]), 1.0)
    np.testing.assert_allclose(found, [[2 / 3, 1 / 3, 0.0, 0.0], 4 * [0.25]], rtol=1e-12)


def test_correlated_noise_has_the_stated_variance_and_correlation_and_is_undone():
    white = np.random.default_rng(0).standard_normal((20000, 6, 2))
    noise = correlated(white, 0.7)
    np.testing.assert_allclose(noise.var(axis=0), 1.0, atol=0.04)
    np.testing.assert_allclose((noise[:, 1:] * noise[:, :-1]).mean(axis=0), 0.7, atol=0.03)
    np.testing.assert_allclose(whitened(noise, 0.7), white, atol=1e-12)


def test_control_costs_are_those_of_the_covariance():
    """As u' C^-1 e with C built entry by entry: sd^2 x .6^|i - j|."""
    random, deviation = np.random.default_rng(1), np.array([0.3, 0.9])
    nominal, noise = random.normal(size=(2, 5, 2)), random.normal(size=(2, 4, 5, 2))
    lag = np.abs(np.subtract.outer(np.arange(5), np.arange(5)))
    inverse = np.linalg.inv(0.6**lag)
    expected = np.einsum("nkd,kl,npld,d->np", nominal, inverse, noise, 0.25 / deviation**2)
    found = control_costs(nominal, noise, deviation=deviation, correlation=0.6, weight=0.25)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def commanded(plans, problem):
    """The speeds and yaw rates that plans of five numbers come to, (n, p, 2 x steps), from the states on their way."""
    _, speed, yaw_rate, goal, crowd, terms = problem
    steps = len(terms.margin)
    states = np.full((*plans.shape[:2], steps, 6), np.nan)
    plan_costs(plans, speed, yaw_rate, goal, crowd, terms, states)
    v = np.concatenate([np.broadcast_to(speed[:, None, None], (*plans.shape[:2], 1)), states[..., 4]], axis=2)
    gained = np.diff(v, axis=2)
    sequence = np.zeros((*plans.shape[:2], steps, 2))
    sequence[..., 0] = v[..., :-1] + gained / terms.motion.speed_response
    sequence[..., 1] = states[..., 5]
    return np.nan_to_num(sequence), states


def test_a_sequence_of_the_commands_of_a_plan_costs_what_the_plan_costs():
    problem = random_problem(3)
    plans = problem[0]
    sequence, states = commanded(plans, problem)
    expected = plan_costs(*problem)[0]
    again = np.full_like(states, np.nan)
    found = plan_costs(sequence.reshape(*plans.shape[:2], -1), *problem[1:], again)[0]
    # Where the change of speed was cut the command is not known from the change: those come to the same speed.
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(again, states, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_loops_give_the_bits_of_the_arrays_for_sequences_and_give_up_no_more_than_they_may(seed):
    pytest.importorskip("numba")
    _, *rest = random_problem(seed)
    random = np.random.default_rng(seed)
    plans = random.uniform(np.tile([0.0, -2.6], 16), np.tile([1.0, 2.6], 16), (6, 40, 32))
    one, two = (np.full((6, 40, 16, 6), np.nan) for _ in range(2))
    expected = plan_costs(plans, *rest, one)
    everything = loops.compiled()(plans, *rest, np.full((6, 40), np.inf), 0.0, two)
    np.testing.assert_array_equal(everything, expected)
    np.testing.assert_array_equal(two, one)
    some, _ = loops.compiled()(plans, *rest, np.full((6, 1), np.inf), 0.5, np.empty((0, 0, 0, 0)))
    given_up = np.isinf(some)
    assert 0.1 < given_up.mean() < 1.0
    np.testing.assert_array_equal(some[~given_up], expected[0][~given_up])
    assert (expected[0] - expected[0].min(axis=1, keepdims=True))[given_up].min() > 0.5


@pytest.mark.parametrize("spec", ["mppi", "mppi(uncontrolled=0.5, correlation=0.0)"])
def test_wheel_speeds_are_the_same_bits_with_and_without_numba(spec, monkeypatch):
    pytest.importorskip("numba")
    walks = Walks.made(5, n=8, m=12)
    fast = actions(spec, walks)
    monkeypatch.setattr("socialnav_mj.controllers.planning.arrays.compiled", lambda: None)
    np.testing.assert_array_equal(actions(spec, walks), fast)


def test_mppi_lets_a_crossing_person_pass_and_arrives():
    episode = episode_of("mppi", *CROSSING)
    assert success(episode).all() and nearest_person(episode) > 0.4


def test_mppi_turns_towards_a_goal_behind_and_gives_way_to_the_side_that_is_free():
    assert twist_of(MPPI(), goal=(-5.0, 2.0))[1] > 2.0
    left = twist_of(MPPI(), goal=(8.0, 0.0), speed=1.0, pedestrians=[(1.2, 0.15)])
    right = twist_of(MPPI(), goal=(8.0, 0.0), speed=1.0, pedestrians=[(1.2, -0.15)])
    assert left[1] < -0.2 and right[1] > 0.2


def test_mppi_with_the_other_turn_limit_and_step_arrives_too():
    for kwargs in ({"turn_limit": "per_second"}, {"control_timestep": 0.1}):
        assert success(episode_of("mppi", *CROSSING, **kwargs)).all(), kwargs


@pytest.mark.parametrize(
    ("setting", "allowed"),
    [
        ({"samples": 0}, "samples = 0 is not allowed; allowed: integers >= 1"),
        ({"temperature": 0.0}, "temperature = 0.0 is not allowed; allowed: numbers > 0"),
        ({"correlation": 1.0}, r"correlation = 1.0 is not allowed; allowed: numbers in \[0, 1\)"),
        ({"uncontrolled": 2.0}, r"uncontrolled = 2.0 is not allowed; allowed: numbers in \[0, 1\]"),
        ({"zone_weight": -1.0}, "zone_weight = -1.0 is not allowed; allowed: numbers >= 0"),
    ],
)
def test_impossible_settings_are_refused(setting, allowed):
    with pytest.raises(ValueError, match=allowed):
        MPPI(**setting)
