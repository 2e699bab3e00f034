"""Cells of the tables in Markdown."""

import math

import pytest

from socialnav_mj.report.markdown import bounds, interval, marked_row, number, row

NAN = math.nan


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (number(0.12345, 3), "0.123"),
        (number(0.12345, 2, "+"), "+0.12"),
        (number(-0.5, 1, "+"), "-0.5"),
        (number(NAN, 3), "-"),
        (bounds(0.1, 0.25), "0.100 to 0.250"),
        (bounds(-0.1, 0.25, 1, "+"), "-0.1 to +0.2"),
        (bounds(NAN, NAN), "-"),
        (interval(0.2, 0.1, 0.25), "0.200 (0.100 to 0.250)"),
        (interval(0.2, 0.1, 0.25, 1, "+"), "+0.2 (+0.1 to +0.2)"),
        (interval(0.2, NAN, NAN), "0.200"),
        (interval(NAN, NAN, NAN), "-"),
    ],
)
def test_numbers_and_intervals_are_written_as_far_as_there_are_any(written: str, expected: str) -> None:
    assert written == expected


def test_cells_of_the_code_stay_markdown_and_those_from_files_become_text() -> None:
    assert marked_row(["`a`", "|x| < 1"]) == "| `a` | \\|x\\| < 1 |"
    assert row(["`a`", "|x| < 1"]) == "| \\`a\\` | \\|x\\| &lt; 1 |"
