"""Agents beside the people they replaced, who was at fault, and how many draws it takes: from table to report."""

import math
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Outcome, Partner
from socialnav_mj.report import power, writer
from socialnav_mj.report.collisions import CONTACT_SCHEMA
from socialnav_mj.report.paired import DIFFERENCES, paired_differences
from socialnav_mj.report.paired_figure import draw_paired
from socialnav_mj.report.power import minimum_draws, resolutions, told
from socialnav_mj.report.results import read_results
from socialnav_mj.report.sections import draws_section

HUMAN_STEPS = 20
DRAWS = 4


def make(controller, draw):
    """Two agents 4 m each; person 7's robot takes `draw` steps longer than it, 8's times out after 6 s; both are hit.

    One of the people stands at (2, 1): 1 m off the first agent's way, or half of it for the robot.
    """
    human = controller == "human"
    extra = 0 if human else draw + (5 if controller == "slow" else 0)
    off = 0.0 if human else 0.5
    first = np.concatenate([line((0, 0), (2, off), 10), line((2, off), (4, off), HUMAN_STEPS - 10 + extra)[1:]])
    second = Agent(positions=line((0, 9), (4, 9), HUMAN_STEPS), person=8)
    if not human:
        second = Agent(positions=np.tile((0.0, 9.0), (31, 1)), goal=(4, 9), outcome=Outcome.TIMED_OUT, person=8)
    force = math.nan if human else 100.0 * (draw + 1)
    people = [
        Pedestrian(positions=np.tile((2, 1), (40, 1))),
        Pedestrian(positions=line((3.8, 9), (-4, 9), 39)),
        Pedestrian(positions=np.tile((2, 1.2), (40, 1))),
    ]
    touches = [
        Touch(agent=1, partner=1, step=10, impact_force=force, impact_impulse=force / 10),
        Touch(agent=0, partner=1, step=12, kind=Partner.AGENT, impact_impulse=0.5, impact_force=5),
    ]
    return build_episode(
        [Agent(positions=first, goal=(4, 0), person=7), second],
        people,
        touches,
        controller=controller,
        draw=draw,
        scenario=Scenario(share=0.1, seed=draw),
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    for controller in ("quick", "slow", "human"):
        for draw in range(DRAWS):
            make(controller, draw).save(folder / "episodes" / f"{controller}-{draw}.npz")
    return folder


@pytest.fixture(scope="module")
def results(run):
    return read_results(run, controllers=["quick", "slow"])


@pytest.fixture(scope="module")
def written(run):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("socialnav_mj.trace.writer.write_trace", lambda *_: None)
        return writer.write_report(run).path.read_text()


def section(text, heading):
    return text.split(f"## {heading}\n")[1].split("\n## ")[0]


def cells(text, controller, column=1):
    rows = [[c.strip() for c in row.split("|")[1:-1]] for row in text.splitlines() if row.startswith("| ")]
    return next(row for row in rows if row[column] == controller)


def test_every_agent_has_the_values_of_its_own_person_and_draw(results):
    rows = [row for row in results.agents.to_pylist() if row["controller"] == "slow"]
    assert [row["person"] for row in rows] == [7, 8] * DRAWS
    for row in rows:
        assert row["human_completion_time"] == pytest.approx(HUMAN_STEPS * 0.2)
        assert row["human_path_length"] == pytest.approx(4.0)
    assert rows[0]["human_minimum_distance"] == pytest.approx(1.0)
    # person 8 walks 4 m towards a person who walks 0.2 m a step from 3.8 m: they are nearest between steps 9 and 10
    assert rows[1]["human_minimum_distance"] == pytest.approx(0.2, abs=0.01)


def test_agents_without_a_human_row_are_unpaired(run, tmp_path):
    make("quick", 0).save(tmp_path / "episodes" / "alone.npz")
    results = read_results(tmp_path)
    assert results.agents["human_completion_time"].to_pylist() == [None, None] and results.overlaps == {}
    assert all(e.n_agents == 0 for e in paired_differences(results.agents))


def test_differences_are_agent_minus_person_with_the_draw_as_unit(results):
    found = {(e.controller, e.measure): e for e in paired_differences(results.agents)}
    assert len(found) == 2 * len(DIFFERENCES) and ("human", "time") not in found
    longer = [0.2 * draw for draw in range(DRAWS)]
    arrivals = found["quick", "time_of_arrivals"]
    assert (arrivals.mean, arrivals.n_draws, arrivals.n_agents) == (pytest.approx(np.mean(longer)), DRAWS, DRAWS)
    assert arrivals.standard_error == pytest.approx(np.std(longer, ddof=1) / math.sqrt(DRAWS))
    assert arrivals.low <= arrivals.mean <= arrivals.high
    # the time-out was watched for 6 s, 2 s longer than its person took
    assert found["quick", "time"].mean == pytest.approx(np.mean([(x + 2.0) / 2 for x in longer]))
    assert found["slow", "time_of_arrivals"].mean == pytest.approx(np.mean(longer) + 1.0)
    # robots veer to y = 0.5: there they are 0.5 m from the one who stands at (2, 1)
    detour = math.hypot(2, 0.5) + 2.0 - 4.0
    assert found["quick", "path_of_arrivals"].mean == pytest.approx(detour)
    assert found["quick", "path_of_arrivals"].note == "all draws are equal"


def test_table_of_collisions_has_a_row_for_each_side(results):
    table = results.contacts
    assert table.schema == CONTACT_SCHEMA and table.num_rows == 3 * DRAWS * 3
    rows = [row for row in table.to_pylist() if row["controller"] == "quick" and row["draw"] == 2]
    assert [(r["person"], r["partner"], r["partner_person"], r["fault"]) for r in rows] == [
        (8, "pedestrian", 1001, "partner"),
        (7, "agent", 8, rows[1]["fault"]),
        (8, "agent", 7, rows[2]["fault"]),
    ]
    assert rows[0]["agent_standing"] and rows[0]["severity"] == "over" and rows[0]["impact_force"] == 300.0
    assert rows[0]["closing_speed"] == pytest.approx(1.0) and rows[0]["flesh_force"] == pytest.approx(744, abs=1)
    assert (rows[0]["clamped"], rows[0]["shoved"]) == (False, False)
    assert rows[0]["impact_momentum"] == pytest.approx(9.23, abs=0.01)
    assert rows[1]["severity"] is None and rows[1]["closing_speed"] == pytest.approx(rows[2]["closing_speed"])


def test_report_says_who_was_at_fault(written):
    text = section(written, "Who moved into whom")
    quick = cells(text, "quick")
    # 4 draws, each robot of person 8 walked into while it stands
    assert quick[2:7] == ["4", "0", "4", "0", "0"]
    assert quick[7] == "4" and quick[11] == "0" and quick[12] == "0.500"
    # two of the three replayed people stand 0.2 m apart
    assert "made_up (by_hand), scenario_1: 0.667" in text


def test_report_says_how_hard(written):
    quick = cells(section(written, "How hard"), "quick")
    # 100, 200, 300 and 400 N for 0.05 s, 10 to 40 N s; 10.5 kg of iron at 1 m/s would hurt, with 9.2 N s
    assert quick[2:] == ["4", "1.00", "1.00", "25.0", "9.2", "0.00", "0", "1", "1", "2", "0", "0", "0", "4"]
    assert "human" not in section(written, "How hard").split("flesh: to 130 N")[1]


def test_report_shows_pairs_and_their_figure(run, written):
    text = section(written, "Beside the people they replaced")
    assert "figures/paired_humans.svg" in text
    assert cells(text, "slow")[3].startswith("+1.30 (")
    assert cells(text, "slow")[-2:] == [str(2 * DRAWS), str(DRAWS)]
    svg = (run / "figures" / "paired_humans.svg").read_text()
    for word in ("scenario 1", "quick", "slow", "minimum distance [m]", "95 % interval"):
        assert word in svg, word
    assert (run / "figures" / "paired_humans.png").read_bytes().startswith(b"\x89PNG")
    assert pq.read_table(run / "tables" / "collisions.parquet").schema == CONTACT_SCHEMA
    assert len((run / "tables" / "paired.csv").read_text().splitlines()) == 1 + 2 * len(DIFFERENCES)


def test_legend_of_many_long_names_stays_within_the_figure(results, monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr("socialnav_mj.report.paired_figure.save", lambda figure, *_: drawn.append(figure) or [])
    names = [f"hybrid(near=\"replay_irl(policy='students003_continuous_seed{i}')\")" for i in range(9)]
    differences = [e for e in paired_differences(results.agents) if e.controller == "slow"]
    for chosen in (names, ["quick", "slow"]):
        draw_paired([replace(e, controller=name) for name in chosen for e in differences], tmp_path)
        figure = drawn.pop()
        figure.canvas.draw()
        (legend,) = figure.legends
        box, whole = legend.get_window_extent(), figure.bbox
        assert whole.x0 <= box.x0 and box.x1 <= whole.x1 and box.y1 <= whole.y1
        assert min(axes.get_window_extent().height for axes in figure.axes) > 0.2 * whole.height


def test_figure_of_equal_numbers_has_equal_bytes(results, tmp_path):
    differences = paired_differences(results.agents)
    one, two = (draw_paired(differences, tmp_path / name) for name in "ab")
    assert [path.name for path in one] == ["paired_humans.png", "paired_humans.svg"]
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]
    assert draw_paired([], tmp_path / "c") == [] and not (tmp_path / "c").exists()


@given(spread=st.floats(1e-3, 10), ratio=st.floats(0.02, 5), power=st.sampled_from([0.5, 0.8, 0.95]))
def test_minimum_draws_is_the_smallest_number_that_reaches(spread, ratio, power):
    n = minimum_draws(spread, ratio * spread, power=power)

    def reach(k):
        return (student.ppf(0.975, k - 1) + student.ppf(power, k - 1)) / math.sqrt(k)

    assert reach(n) <= ratio * (1 + 1e-9)
    assert n == 2 or reach(n - 1) > ratio * (1 - 1e-9)


def test_minimum_draws_of_a_large_study_is_the_textbooks():
    assert minimum_draws(1.0, 0.05) == pytest.approx((1.96 / 0.05) ** 2, rel=5e-3)
    assert minimum_draws(1.0, 0.05, power=0.8) == pytest.approx(((1.96 + 0.8416) / 0.05) ** 2, rel=5e-3)
    assert minimum_draws(0.0, 0.05) == 2


def test_minimum_draws_tells_a_difference_as_often_as_it_says():
    random = np.random.default_rng(5)
    n = minimum_draws(1.0, 0.7, power=0.8)
    samples = random.normal(0.7, 1.0, (2000, n))
    error = samples.std(axis=1, ddof=1) / math.sqrt(n)
    found = np.mean(samples.mean(axis=1) / error > student.ppf(0.975, n - 1))
    assert found == pytest.approx(0.8, abs=0.04)  # a little off, as Student's quantile stands for the noncentral one


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-1.0, 0.1), "spread = -1"),
        ((math.nan, 0.1), "spread = nan"),
        ((1.0, 0.0), "difference = 0"),
    ],
)
def test_minimum_draws_refuses_what_has_no_answer(arguments, message):
    with pytest.raises(ValueError, match=message):
        minimum_draws(*arguments)


def test_more_draws_than_anybody_runs_are_told_as_such():
    assert minimum_draws(1.0, 1e-6) is None
    assert told(None) == "> 100,000" and told(12) == "12"


def test_report_goes_on_where_a_spread_takes_too_many_draws(results, monkeypatch):
    monkeypatch.setattr(power, "MOST_DRAWS", 2)
    lines = draws_section(resolutions(results.agents))
    assert any("> 2 / > 2 (" in line for line in lines)


def test_resolutions_use_the_spread_of_paired_differences(results, written):
    found = {(r.controllers, r.measure): r for r in resolutions(results.agents, {"time_under_way": 1.0})}
    # slow takes 1 s longer than quick in every draw, for one of two agents: no spread at all
    assert found[("quick", "slow"), "time_under_way"].spread == pytest.approx(0.0, abs=1e-12)
    human = found[("quick", "human"), "time_under_way"]
    assert human.spread == pytest.approx(np.std([0.1 * d for d in range(DRAWS)], ddof=1))
    assert human.draws == minimum_draws(human.spread, 1.0) <= human.draws_for_power
    row = cells(section(written, "How many draws it takes"), "quick - human")
    success = next(
        r for r in resolutions(results.agents) if (r.controllers, r.measure) == (human.controllers, "success")
    )
    assert row[2] == f"{success.draws} / {success.draws_for_power} ({success.spread:.3f})" and row[-1] == str(DRAWS)
    with pytest.raises(ValueError, match=r"unknown measure 'speed'; available: success"):
        resolutions(results.agents, {"speed": 1.0})
