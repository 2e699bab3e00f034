"""Claims on tables whose truth is known, and agents that are paired across controllers."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from agents import METHOD_VALUES, experiment_table, roster_of, rows_of, table_of

from socialnav_mj.recordings import Recording
from socialnav_mj.report.intervals import Components, interval_of
from socialnav_mj.report.power import minimum_draws, resolved
from socialnav_mj.studies.claims import CLAIMS, SCENARIOS
from socialnav_mj.studies.findings import _would_take, examine, verdict_of, verdict_of_all
from socialnav_mj.studies.held_out import HELD_OUT, IN_SAMPLE, VALIDATION, period_of_people
from socialnav_mj.studies.panel import COMMON, MIXED, POTENTIAL_FIELD, REPLAY_IRL, Entry, Term, make_panel
from socialnav_mj.studies.paper.claims_page import claims_page, to_decide

SEEDS = (0, 1, 2)


def verdicts(table, trainings=SEEDS):
    return {f.claim.key: f.verdict for f in examine(make_panel(table, roster_of(trainings)))}


def changed(method, quantity, means):
    return METHOD_VALUES | {method: METHOD_VALUES[method] | {quantity: means}}


def test_every_claim_holds_where_all_is_as_the_paper_says():
    assert verdicts(experiment_table(noise=0.002)) == {claim.key: "holds" for claim in CLAIMS}


@pytest.mark.parametrize(
    ("method", "quantity", "means", "failing"),
    [
        ("mix", "success", [0.7, 0.8, 0.75, 0.95], {"a"}),
        ("pf", "speed", [0.9, 0.9, 0.9, 0.78], {"b1", "f1", "f2"}),
        ("irl", "steps", [30.0, 25.0, 40.0, 10.0], {"b3", "b4", "e1", "e2"}),
        ("irl", "success", [0.6, 0.5, 0.7, 0.8], {"c1"}),
        ("irl", "success", [0.6, 0.7, 0.85, 0.93], {"c2"}),
        ("mix", "steps", [31.0, 26.0, 15.5, 14.0], {"e1", "e2"}),
    ],
)
def test_claims_fail_where_one_scenario_contradicts(method, quantity, means, failing):
    found = verdicts(experiment_table(changed(method, quantity, means), noise=0.002))
    assert failing <= {key for key, verdict in found.items() if verdict == "fails"}
    untouched = {"c1", "c2"} - failing if quantity != "success" else {"b1", "b2", "b3", "d1"}
    assert all(found[key] == "holds" for key in untouched)


def test_claim_is_undecided_where_draws_and_trainings_wander_more_than_the_effect():
    values = changed("mix", "success", [0.61, 0.71, 0.81, 0.91])
    assert verdicts(experiment_table(values, noise=0.06))["a"] == "undecided"


def test_claim_about_all_scenarios_is_undecided_without_one_unless_another_contradicts():
    table = experiment_table(noise=0.002, scenarios=("scenario_1", "scenario_2", "scenario_3"))
    found = {f.claim.key: f for f in examine(make_panel(table, roster_of(SEEDS)))}
    assert found["a"].verdict == "undecided" and len(found["a"].missing) == 2
    assert found["c1"].verdict == "holds"
    values = changed("mix", "success", [0.4, 0.8, 0.9, 0.95])
    table = experiment_table(values, noise=0.002, scenarios=("scenario_1", "scenario_2", "scenario_3"))
    assert verdicts(table)["a"] == "fails"


def test_verdict_says_on_which_side_of_nothing_the_interval_lies():
    assert [verdict_of(*ends) for ends in ((0.1, 0.2), (-0.2, -0.1), (-0.1, 0.1), (0.0, 0.1))] == [
        "holds",
        "fails",
        "undecided",
        "undecided",
    ]
    assert verdict_of(float("nan"), float("nan")) == "undecided"
    assert verdict_of_all(["holds", "undecided", "fails"]) == "fails"
    assert verdict_of_all(["holds", "holds"]) == "holds"
    assert verdict_of_all(["holds", "undecided"]) == verdict_of_all([]) == "undecided"


def test_page_gives_rule_verdicts_effects_and_the_weakest_comparison_of_each_variant():
    default = examine(make_panel(experiment_table(noise=0.002), roster_of(SEEDS)))
    worse = experiment_table(changed("mix", "success", [0.7, 0.8, 0.75, 0.95]), noise=0.002)
    other = examine(make_panel(worse, roster_of(SEEDS)))
    page = claims_page(
        {"default": default, "v": other}, titles={"default": "default", "v": "variant"}, command="run it"
    )
    assert "Command: `run it`" in page and "**fails** if at least one fails" in page
    row = next(line for line in page.splitlines() if line.startswith("| (a) "))
    assert row.endswith("| holds | fails | - |")
    weakest = next(line for line in page.splitlines() if line.startswith("| variant | fails "))
    _, _, comparison, effect, *_ = weakest.split(" | ")
    assert comparison == "scenario_3: hybrid - potential field"
    assert float(effect) == pytest.approx(-0.05, abs=0.025)  # one of 40 agents
    assert all(claim.sentence in page for claim in CLAIMS)
    assert "they say nothing about another crowd" in page


def test_undecided_claim_says_what_would_decide_it():
    values = changed("mix", "success", [0.61, 0.71, 0.81, 0.91])
    found = examine(make_panel(experiment_table(values, noise=0.06), roster_of(SEEDS)))
    assert all(f.would_take is None for f in found if f.verdict != "undecided")
    claim = found[0]
    draws, trainings = claim.would_take
    assert draws >= 4 and trainings >= 3
    page = claims_page({"default": found}, titles={"default": "default"}, command="run it")
    row = next(line for line in page.splitlines() if line.startswith("| (a) "))
    assert row.endswith(f"| {to_decide(claim)} |") and to_decide(claim) == f"{draws:,} draws x {trainings:,} trainings"
    assert f"To decide: {to_decide(claim)}." in page
    table = experiment_table(values, noise=0.06, scenarios=("scenario_1",))
    assert to_decide(examine(make_panel(table, roster_of(SEEDS)))[0]) == "the comparisons not run"


def test_one_comparison_against_a_claim_decides_it_and_else_all_have_to():
    easy = resolved(Components(draw=1.0, training=0.0, cell=0.0), 0.9, trained=False)
    hard = resolved(Components(draw=1.0, training=0.0, cell=0.0), 0.3, trained=False)
    for_it, against = (interval_of(sign + np.array([[0.0], [1.0], [2.0]])) for sign in (0.0, -3.0))
    assert _would_take([(easy, for_it), (hard, for_it)]) == (minimum_draws(1.0, 0.3), 0)
    assert _would_take([(easy, against), (hard, for_it)]) == (minimum_draws(1.0, 0.9), 0)
    assert _would_take([]) is None


def test_claims_about_the_same_agents_count_them():
    found = {f.claim.key: f for f in examine(make_panel(experiment_table(noise=0.002), roster_of(SEEDS)))}
    assert found["a"].same_agents == {} and list(found["f1"].same_agents) == list(SCENARIOS)
    count, total = found["f1"].same_agents["scenario_1"]
    assert total == 4 * 40 and 0.45 * total < count < 0.52 * total  # half of them succeed under the weakest controller
    page = claims_page({"default": list(found.values())}, titles={"default": "default"}, command="run it")
    assert f"brought home: scenario_1 {count} of 160 ({count / 160:.0%}".replace("%", " %") in page


def small_panel():
    """Two draws of two agents: the potential field loses agent 1 of draw 0, the learned one never spawns it."""
    nan = None
    rows = [
        *rows_of(
            "pf",
            "scenario_1",
            0,
            {"success": [True, False], "completion_time": [4.0, nan], "average_speed": [1.0, 3.0]},
        ),
        *rows_of(
            "pf", "scenario_1", 1, {"success": [True, True], "completion_time": [6.0, 8.0], "average_speed": [1.0, 1.0]}
        ),
        *rows_of(
            "irl0",
            "scenario_1",
            0,
            {"success": [True, False], "completion_time": [5.0, nan], "average_speed": [0.5, nan]},
        ),
        *rows_of(
            "irl0",
            "scenario_1",
            1,
            {"success": [True, False], "completion_time": [9.0, 9.0], "average_speed": [0.5, 0.0]},
        ),
    ]
    return make_panel(table_of(rows), roster_of([0]))


def minus(measure):
    term = Term(factor=1.0, method=POTENTIAL_FIELD, scenario="scenario_1", measure=measure)
    return [term, replace(term, factor=-1.0, method=REPLAY_IRL)]


def test_contrast_is_paired_by_agent():
    """Draw 0: agent 1 has no speed under one of the two, so agent 0 alone counts: 1 - 0.5. Draw 1: (0.5 + 1) / 2."""
    np.testing.assert_allclose(small_panel().contrast(minus("average_speed")), [[0.5], [0.75]])
    np.testing.assert_allclose(small_panel().contrast(minus("success")), [[0.0], [0.5]])


def test_common_agents_are_those_that_every_controller_brought_home():
    """Agent 1 failed under the learned policy in both draws, so only agent 0 of each counts, for both."""
    measure = f"completion_time_success{COMMON}"
    np.testing.assert_allclose(small_panel().contrast(minus(measure)), [[-1.0], [-3.0]])
    np.testing.assert_allclose(small_panel().contrast(minus(measure)[:1]), [[4.0], [6.0]])
    # without the ending each has its own successes
    np.testing.assert_allclose(small_panel().contrast(minus("completion_time_success")[:1]), [[4.0], [7.0]])


def test_share_of_steps_weighs_agents_by_their_steps():
    columns = {"intrusion_share": [0.5, 0.0], "active_steps": [10, 30]}
    panel = make_panel(table_of(rows_of("pf", "scenario_1", 0, columns)), roster_of([]))
    term = Term(factor=1.0, method=POTENTIAL_FIELD, scenario="scenario_1", measure="intrusion_share_of_steps")
    np.testing.assert_allclose(panel.contrast([term]), [[0.125]])


def test_trainings_are_compared_each_with_its_own_mixed_policy():
    rows = [
        row
        for name, speed in (("pf", 1.0), ("irl0", 0.5), ("irl1", 0.7), ("mix0", 0.6), ("mix1", 0.9))
        for row in rows_of(name, "scenario_1", 0, {"average_speed": [speed]})
    ]
    panel = make_panel(table_of(rows), roster_of([0, 1]))
    mixed = Term(factor=1.0, method=MIXED, scenario="scenario_1", measure="average_speed")
    np.testing.assert_allclose(panel.contrast([mixed, replace(mixed, factor=-1.0, method=REPLAY_IRL)]), [[0.1, 0.2]])
    np.testing.assert_allclose(panel.contrast([mixed], trainings=[1]), [[0.9]])


def test_panel_does_not_depend_on_the_order_of_rows():
    table = experiment_table(noise=0.02, n_draws=3, n_agents=8)
    shuffled = table.take(pa.array(np.random.default_rng(0).permutation(table.num_rows)))
    one, other = make_panel(table, roster_of(SEEDS)), make_panel(shuffled, roster_of(SEEDS))
    for part in CLAIMS[0].parts:
        np.testing.assert_array_equal(one.contrast(part.terms), other.contrast(part.terms))


def test_panel_refuses_two_controllers_in_one_role_and_two_recordings():
    table = table_of(rows_of("pf", "scenario_1", 0, {"success": [True]}))
    with pytest.raises(ValueError, match="'pf' and 'weak' are both potential_field"):
        make_panel(table, [*roster_of([]), Entry(controller="weak", method=POTENTIAL_FIELD)])
    other = table.set_column(0, "dataset", pa.array(["else"]))
    with pytest.raises(ValueError, match="2 recordings"):
        make_panel(pa.concat_tables([table, other]), roster_of([]))


def crowd():
    """People who appear at 0, 5, 6.5, 7 and 9 s of 10 s."""
    begin = [0.0, 5.0, 6.5, 7.0, 9.0]
    return Recording(
        name="made",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(1, 6),
        times=tuple(np.array([t, 10.0]) for t in begin),
        positions=tuple(np.array([[0.0, k], [1.0, k]]) for k in range(5)),
        checksum="0",
    )


def test_people_are_held_out_who_appear_after_training_and_validation():
    card = {"datasets": ["made"], "train_window": [0.0, 0.6], "validation_window": [0.6, 0.7]}
    periods = period_of_people(crowd(), [card, dict(card)])
    assert periods == {1: IN_SAMPLE, 2: IN_SAMPLE, 3: VALIDATION, 4: HELD_OUT, 5: HELD_OUT}
    assert set(period_of_people(crowd(), [card | {"datasets": ["zara01"]}]).values()) == {HELD_OUT}
    assert period_of_people(crowd(), [card | {"datasets": ["zara01", f"some/folder/{crowd().name}.txt"]}]) == periods
    with pytest.raises(ValueError, match="different parts of made"):
        period_of_people(crowd(), [card, card | {"train_window": [0.0, 0.5]}])
