"""Slope charts show every controller, in one order, with every condition named below every column."""

import re

import numpy as np
import pytest

from socialnav_mj.report.intervals import Interval
from socialnav_mj.studies.conditions import Comparison, Condition, at
from socialnav_mj.studies.levels import Level, LevelTable
from socialnav_mj.studies.slopes import draw_slopes, in_order

CONDITIONS = (Condition(name="before", title="Before"), Condition(name="after", title="After"))


def level(scenario: str, controller: str, condition: Condition, mean: float) -> Level:
    low, high = mean - 0.1, mean + 0.1
    interval = Interval(
        mean=mean, low=low, high=high, low_given=low, high_given=high, n_draws=3, n_trainings=0, note=""
    )
    method = at(controller, condition)
    return Level(scenario=scenario, method=method, training=None, measure="success", interval=interval, n_values=9)


def comparison(means: dict[str, float]) -> Comparison:
    """Two scenarios; scenario 2 and what is after are better by .1; who has NaN has no levels."""
    rows = [
        level(scenario, controller, condition, mean + 0.1 * k + 0.1 * late)
        for k, scenario in enumerate(("scenario_1", "scenario_2"))
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
