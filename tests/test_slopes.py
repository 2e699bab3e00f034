"""Slope charts show every controller and condition in one order; pages name who falls behind whom."""

import re
from dataclasses import replace

import numpy as np
import pytest

from socialnav_mj.report.intervals import Interval
from socialnav_mj.studies.conditions import Comparison, Condition, at
from socialnav_mj.studies.kendall import kendall
from socialnav_mj.studies.levels import Level, LevelTable
from socialnav_mj.studies.ranking import ranking_lines, turned_rows
from socialnav_mj.studies.slopes import draw_slopes, in_order

CONDITIONS = (Condition(name="before", title="Before"), Condition(name="after", title="After"))


def level(scenario: str, controller: str, condition: Condition, mean: float) -> Level:
    low, high = mean - 0.1, mean + 0.1
    interval = Interval(
        mean=mean, low=low, high=high, low_given=low, high_given=high, n_draws=3, n_trainings=0, note=""
    )
    method = at(controller, condition)
    return Level(scenario=scenario, method=method, training=None, measure="success", interval=interval, n_values=9)


def comparison(means: dict[str, float], *scenarios: str) -> Comparison:
    """Two scenarios or those given; scenario 2 and what is after are better by .1; who has NaN has no levels."""
    rows = [
        level(scenario, controller, condition, mean + 0.1 * k + 0.1 * late)
        for k, scenario in enumerate(scenarios or ("scenario_1", "scenario_2"))
        for controller, mean in means.items()
        for late, condition in enumerate(CONDITIONS)
        if np.isfinite(mean)
    ]
    return Comparison(
        recording="made",
        controllers=tuple(means),
        conditions=CONDITIONS,
        measures=("success",),
        table=LevelTable(rows=tuple(rows)),
        differences={},
        taus={},
    )


def test_panels_stand_in_the_order_of_success_and_who_has_none_comes_last() -> None:
    assert in_order(comparison({"a": 0.2, "b": np.nan, "c": 0.9, "d": 0.5})) == ("c", "d", "a", "b")


@pytest.mark.parametrize("n", [1, 2, 5, 6, 19])
def test_every_controller_has_a_panel_and_every_column_its_conditions(n, tmp_path) -> None:
    names = [f"controller_{k:02}" for k in range(n)]
    png, svg = draw_slopes(comparison(dict.fromkeys(names, 0.5)), "success", "share", tmp_path, "chart")
    assert png.stat().st_size > 0
    written = re.findall(r"<text[^>]*>([^<]+)</text>", svg.read_text())
    assert sorted(text for text in written if text.startswith("controller_")) == names
    for condition in CONDITIONS:
        assert written.count(condition.name) == min(n, 5)
    assert {"made", "share", "scenario 1: 10 % agents", "scenario 2: 30 % agents"} <= {*written}


def test_long_names_are_broken_into_lines(tmp_path) -> None:
    name = "replay_irl(policy='somewhere_else_seed0')"
    _, svg = draw_slopes(comparison({name: 0.5}), "success", "share", tmp_path, "chart")
    lines = [line for line in re.findall(r">([^<>]+)</", svg.read_text()) if line.strip() and line.strip() in name]
    assert "".join(lines) == name and len(lines) == 2


def test_page_and_table_name_who_falls_behind_whom() -> None:
    random = np.random.default_rng(3)
    one, two, same = (
        np.array(means) + random.normal(0.0, 0.001, (5, 3))
        for means in ((0.9, 0.5, 0.1), (0.5, 0.9, 0.1), (0.8, 0.5, 0.2))
    )
    made = comparison({"hare": 0.9, "tortoise": 0.5, "snail": 0.1}, "scenario_1")
    turned = replace(made, taus={("scenario_1", "after", "success"): kendall(one, two)})
    (row,) = turned_rows([turned])
    assert (row["more_before"], row["more_then"], row["condition"]) == ("hare", "tortoise", "after")
    page = "\n".join(ranking_lines([turned]))
    assert "0.33 (0.33 to 0.33); 1 of 3" in page and "| after | hare | tortoise |" in page
    page = "\n".join(ranking_lines([replace(made, taus={("scenario_1", "after", "success"): kendall(one, same)})]))
    assert "1.00 (1.00 to 1.00); 0 of 3" in page and "No two controllers" in page
