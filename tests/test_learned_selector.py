"""`learned_selector`: trials and what came of them by hand, the regression, files, and the switch that it makes."""

import hashlib
import json

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line
from safetensors.numpy import save
from scenes import environment_of, walk
from test_protocol import LIMITS, Walks

from socialnav_mj.cli import main
from socialnav_mj.controllers import controller_config, controller_of, make_controller, with_policy_of
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.learned_selector import LearnedSelector, default_candidates, load_outcomes
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.situation import NAMES, situation
from socialnav_mj.controllers.stand_still import StandStill
from socialnav_mj.features import View, view_of
from socialnav_mj.learning.selection import fit, left_out
from socialnav_mj.learning.trials import COLLISION_COST, HOLD, NEARNESS_COST, Trials, outcomes
from socialnav_mj.rollout import rollout


def write_weights(path, *, weight=None, bias=(0.0, 0.0), candidates=("go_straight", "stand_still"), **card):
    """Weights and card made by hand."""
    weight = np.zeros((len(candidates), len(NAMES))) if weight is None else weight
    layer = {"weight": np.asarray(weight, dtype=np.float32), "bias": np.asarray(bias, dtype=np.float32)}
    content = save({f"outcomes.0.{name}": values for name, values in layer.items()})
    path.write_bytes(content)
    stated = {"candidates": list(candidates), "features": list(NAMES), "sha256": hashlib.sha256(content).hexdigest()}
    path.with_suffix(".json").write_text(json.dumps(stated | card))
    return str(path)


def a_view(position, velocity=(0.0, 0.0), goal=(5.0, 1.0), twist=(0.8, 0.3)):
    return View(
        goal=np.array([goal]),
        twist=np.array([twist]),
        position=np.array([[position]], dtype=float),
        velocity=np.array([[velocity]], dtype=float),
        present=np.ones((1, 1), dtype=bool),
    )


# Situations


def test_situation_says_where_the_nearest_is_and_is_the_same_in_the_mirror():
    numbers = dict(zip(NAMES, situation(a_view((2.0, 0.0), (-1.0, 0.0)))[0], strict=True))
    near = np.exp(-1.0)
    assert numbers["nearest"] == numbers["nearest ahead"] == pytest.approx(near)
    assert numbers["nearest aside"] == numbers["nearest behind"] == 0.0
    assert numbers["crowd"] == pytest.approx(near / 12.0)
    assert numbers["approach"] == pytest.approx(near * 0.5)
    assert numbers["risk"] == numbers["risk ahead"] == pytest.approx(np.exp(-1.0))
    one = situation(a_view((1.0, 1.7), (-0.5, 0.2)))
    other = situation(a_view((1.0, -1.7), (-0.5, -0.2), goal=(5.0, -1.0), twist=(0.8, -0.3)))
    np.testing.assert_allclose(one, other, atol=1e-12)


# Trials


def test_trials_last_their_time_and_are_logged_where_they_begin():
    trials = Trials(candidates=(GoStraight(), StandStill()))
    episode = rollout(_alone(), trials)
    steps = round(HOLD / episode.control_timestep)
    active = np.flatnonzero(episode.agent_active[:, 0])
    begins = np.array([step for step, *_ in trials.log])
    np.testing.assert_array_equal(begins, active[0] + steps * np.arange(len(begins)))
    chosen = np.array([own[0] for _, _, own, _ in trials.log])
    np.testing.assert_array_equal(episode.agent_policy[begins, 0], chosen)
    np.testing.assert_array_equal(episode.agent_policy[active, 0], np.repeat(chosen, steps)[: len(active)])
    assert {*chosen.tolist()} == {0, 1} and [p.tolist() for _, p, *_ in trials.log] == len(begins) * [[1]]


def _alone():
    return environment_of(walk([(0.0, 0.0), (9.0, 0.0)], 1.0))


def test_outcomes_by_hand():
    """1 m/s for 4 s to the goal, then .5 s stood before it is counted as reached; a person within 1.2 m for a while."""
    episode = build_episode(
        [Agent(positions=line((0, 0), (4, 0), 20)), Agent(positions=line((0, 9), (2, 9), 20), goal=(8, 9))],
        [Pedestrian(positions=np.tile([1.0, 1.0], (21, 1)))],
        [Touch(agent=1, partner=0, step=15.5)],
    )
    speed = episode.metadata["scenario"]["robot"]["max_speed"]
    log = [
        (0, np.array([0, 1]), np.array([0, 1]), np.zeros((2, 15))),
        (12, np.array([0, 1]), np.array([0, 1]), np.zeros((2, 15))),
    ]
    found = outcomes(episode, log)
    gap = np.hypot(0.2 * np.arange(12) - 1.0, 1.0)
    near = NEARNESS_COST * 0.2 * (gap < 1.2).sum()
    radius = episode.metadata["scenario"]["goal_radius"]
    way = 0.2 * 12
    expected = [
        2.4 - way / speed + near,
        2.4 - 0.5 * way / speed,
        1.6 - (1.6 - radius) / speed,
        1.6 - 0.8 / speed + COLLISION_COST,
    ]
    np.testing.assert_allclose(found, expected, atol=1e-9)


# The regression


def made_up(count=4000, noise=0.3, seed=0):
    """Trials whose cost is known: the first costs 1 + 2 x crowd, the second 3 - 4 x risk."""
    random = np.random.default_rng(seed)
    numbers, choice = random.uniform(0.0, 1.0, (count, len(NAMES))), random.integers(2, size=count)
    crowd, risk = numbers[:, NAMES.index("crowd")], numbers[:, NAMES.index("risk")]
    cost = np.where(choice == 0, 1.0 + 2.0 * crowd, 3.0 - 4.0 * risk)
    return choice, numbers, cost + noise * random.normal(size=count), random.integers(4, size=count)


def test_fit_finds_the_costs_that_trials_were_made_with():
    choice, numbers, cost, _ = made_up()
    weight, bias = fit(choice, numbers, cost, candidates=2, ridge=1.0)
    expected = np.zeros((2, len(NAMES)))
    expected[0, NAMES.index("crowd")], expected[1, NAMES.index("risk")] = 2.0, -4.0
    np.testing.assert_allclose(weight, expected, atol=0.12)
    np.testing.assert_allclose(bias, [1.0, 3.0], atol=0.25)
    flat, mean = fit(choice, numbers, cost, candidates=2, ridge=1e12)
    np.testing.assert_allclose(flat, 0.0, atol=1e-6)
    np.testing.assert_allclose(mean, [cost[choice == k].mean() for k in (0, 1)], atol=1e-6)


def test_switch_is_judged_on_draws_that_were_left_out():
    """The best candidate costs 1 on average; the switch takes the second where 3 - 4 r < 1 + 2 c, by integration."""
    choice, numbers, cost, group = made_up(count=20000)
    judged = left_out(choice, numbers, cost, group, candidates=2, ridge=1.0)
    random = np.random.default_rng(5)
    crowd, risk = random.uniform(size=(2, 200000))
    least = np.minimum(1.0 + 2.0 * crowd, 3.0 - 4.0 * risk).mean()
    assert judged["switch"] == pytest.approx(least, abs=0.05)
    assert judged["best"] == pytest.approx(1.0, abs=0.05)
    assert judged["difference"] == pytest.approx(least - 1.0, abs=3.0 * judged["standard_error"])
    assert 0.0 < judged["standard_error"] < 0.02
    assert judged["error"] == pytest.approx(0.3, abs=0.02) and judged["constant"] > 0.6
    alone = left_out(choice, numbers, cost, np.zeros_like(group), candidates=2, ridge=1.0)
    assert np.isnan(list(alone.values())).all()


# The switch


def test_whoever_is_expected_to_cost_least_drives_and_scores_are_told(tmp_path):
    weight = np.zeros((2, len(NAMES)))
    weight[0, NAMES.index("nearest")] = 2.0
    path = write_weights(tmp_path / "w.safetensors", weight=weight, bias=(0.0, 0.9))
    selector = LearnedSelector(candidates=(GoStraight(), StandStill()), weights=path, bonus=0.0)
    selector.reset(LIMITS)
    for observation in Walks.made(2, n=6, m=8).observations(3):
        found = selector.twist(observation)
        nearest = situation(view_of(observation, np.arange(6)))[:, NAMES.index("nearest")]
        np.testing.assert_allclose(selector.scores, np.stack([2.0 * nearest, np.full(6, 0.9)], axis=1), atol=1e-6)
        np.testing.assert_array_equal(selector.active_policy, 2.0 * nearest > 0.9)
        assert (found[selector.active_policy == 1] == 0.0).all()
    assert {*selector.active_policy.tolist()} == {0, 1}


def test_equals_do_not_alternate(tmp_path):
    path = write_weights(tmp_path / "w.safetensors", candidates=("one", "two"))
    twins = (GoStraight(name="one"), GoStraight(name="two"))
    selector = LearnedSelector(candidates=twins, weights=path, bonus=0.1)
    selector.reset(LIMITS)
    for observation in Walks.made(0).observations(3):
        selector.act(observation)
    np.testing.assert_allclose(np.diff(selector.scores), 0.1)


def test_shipped_weights_are_for_the_default_candidates_and_travel_with_their_checksum():
    outcomes_ = load_outcomes("students003")
    assert outcomes_.card["draws"] <= 100 and sum(outcomes_.card["trials"]) > 1000
    assert list(outcomes_.card["candidates"]) == [one.name for one in default_candidates()]
    spec = with_policy_of("learned_selector", "students003")
    controller = make_controller(spec)
    assert "replay_irl(policy='students003_continuous_seed0')" in controller.policies
    config = controller_config(controller)
    assert config["checksum"] == outcomes_.checksum and controller_config(controller_of(config)) == config


@pytest.mark.parametrize(
    ("change", "error", "named"),
    [
        ({"weights": "nobody"}, PolicyError, "there are no weights 'nobody'; available: students003"),
        ({"bonus": -1.0}, ValueError, "bonus = -1.0 is not allowed; allowed: numbers >= 0"),
        ({"checksum": "0" * 64}, PolicyError, "but 0000"),
        ({"candidates": (GoStraight(), StandStill())}, ValueError, "was learned for"),
    ],
)
def test_impossible_settings_are_refused(change, error, named):
    with pytest.raises(error, match=named):
        LearnedSelector(**change)


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        ({"sha256": "0" * 64}, "but its card says 0000"),
        ({"features": ["a"]}, "features"),
        ({"candidates": [1, 2]}, "candidates have to be names"),
        ({"candidates": ["a", "b", "c"]}, r"outcomes.0 has weight \(3, 15\) and bias \(2,\)"),
    ],
)
def test_damaged_weights_are_refused(tmp_path, damage, named):
    path = write_weights(tmp_path / "w.safetensors", **damage)
    with pytest.raises(PolicyError, match=named):
        load_outcomes(path)
    bad = write_weights(tmp_path / "n.safetensors", bias=(np.nan, 0.0))
    with pytest.raises(PolicyError, match="holds values that are not finite"):
        load_outcomes(bad)


def test_command_resumes_and_writes_what_the_controller_reads(tmp_path, capsys):
    words = ["fit-selector", "--dataset", "plaza", "--scenarios", "2", "--draws", "2", "--out", str(tmp_path)]
    words += ["--candidates", "go_straight", "potential_field"]
    main(words)
    assert "use them" in capsys.readouterr().out
    first = (tmp_path / "selector.safetensors").read_bytes()
    kept, again = sorted(tmp_path.glob("trials_*.npz"))
    again.unlink()
    before = kept.stat().st_mtime_ns
    main(words)
    assert kept.stat().st_mtime_ns == before and (tmp_path / "selector.safetensors").read_bytes() == first
    candidates = tuple(make_controller(name) for name in ("go_straight", "potential_field"))
    selector = LearnedSelector(candidates=candidates, weights=str(tmp_path / "selector.safetensors"))
    card = selector._outcomes.card
    assert sum(card["trials"]) > 20 and card["draws"] == 2 and np.isfinite(card["left_out"]["switch"])
    with pytest.raises(SystemExit):
        main([*words, "--draws", "101"])
    assert "draws from 100 on are for reporting" in " ".join(capsys.readouterr().err.split())
