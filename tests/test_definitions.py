"""The table of docs/metrics.md says what the metrics declare."""

import math
from pathlib import Path

import pytest
from declarations import comfort

from socialnav_mj.metrics import METRICS
from socialnav_mj.report.definitions import definitions, unit_and_range, with_definitions, write_definitions

PAGE = Path(__file__).resolve().parents[1] / "docs" / "metrics.md"


def test_page_shows_the_declarations_of_today():
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_definitions(page), "docs/metrics.md is not up to date: `make docs`"
    assert all(f"| `{metric.name}` | " in page for metric in METRICS)


def test_page_without_marks_is_refused():
    with pytest.raises(ValueError, match="the page lacks '<!-- Made by `make docs`"):
        with_definitions("# Metrics\n")


def test_range_is_told_in_words():
    told = {metric.name: unit_and_range(metric) for metric in METRICS}
    assert [told[n] for n in ("success", "path_length", "spl")] == ["0 or 1", "m, >= 0", "[0, 1]"]
    assert [told[n] for n in ("path_irregularity", "collisions_over")] == ["rad, [0, pi]", "count"]
    assert told["minimum_time_to_collision"] == "s, >= 0, or inf"
    assert told["first_partner"] == "0: pedestrian, 1: agent"
    assert unit_and_range(comfort(low=-math.inf)) == "m, <= 1"


def test_table_is_replaced_and_the_rest_of_the_page_kept(tmp_path):
    text = PAGE.read_text(encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text(text.replace("| `spl` |", "| `sp1` |", 1), encoding="utf-8")
    assert write_definitions(page) == page and page.read_text(encoding="utf-8") == text
    longer = with_definitions(text, [*METRICS, comfort()]).splitlines()
    assert [line for line in longer if line not in text.splitlines()] == [definitions([comfort()])[2]]
    assert definitions([comfort()])[2] == "| `comfort` | made up | m, [0, 1] | more | - |  |"
