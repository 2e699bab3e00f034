"""Does the ranking hold? What the pages of all studies of conditions say of it."""

from collections.abc import Sequence
from math import isnan
from typing import Any

from socialnav_mj.report.markdown import interval, table
from socialnav_mj.studies.conditions import Comparison
from socialnav_mj.studies.kendall import Tau
from socialnav_mj.studies.looks import SCENARIO_TITLES

TURNED = ("recording", "scenario", "condition", "measure", "more_before", "more_then")
"""Columns of `turned_rows`."""


def ranking_lines(found: Sequence[Comparison]) -> list[str]:
    """Rank correlations of all conditions with the first, and who falls behind whom by the first measure.

    Args:
        found: One comparison for each recording.

    Returns:
        Lines of Markdown.
    """
    taus = [
        [
            own.recording,
            SCENARIO_TITLES.get(scenario, scenario),
            _words(measure),
            *(_cell(own.taus[scenario, other.name, measure]) for other in own.conditions[1:]),
        ]
        for own in found
        for scenario in own.scenarios
        for measure in dict.fromkeys(key[2] for key in own.taus)
    ]
    names = [condition.name for condition in found[0].conditions[1:]]
    lines = table(["recording", "scenario", "ranked by", *(f"Kendall's tau, {name}" for name in names)], taus)
    first, measure = found[0].conditions[0].name, found[0].measures[0]
    turned: dict[tuple[str, ...], list[str]] = {}
    for row in turned_rows(found):
        if row["measure"] == measure:
            falls = (row["recording"], row["scenario"], row["condition"], row["more_before"])
            turned.setdefault(falls, []).append(row["more_then"])
    by = _words(measure)
    if not turned:
        return [*lines, f"No two controllers that draws tell apart on both sides change places by {by}.", ""]
    rows = [[r, SCENARIO_TITLES.get(s, s), c, who, ", ".join(others)] for (r, s, c, who), others in turned.items()]
    heads = ["recording", "scenario", "on", f"more {by} with {first}, and less here", "than"]
    return [*lines, f"Who changes places by {by}, and is told apart on both sides:", "", *table(heads, rows)]


def turned_rows(found: Sequence[Comparison]) -> list[dict[str, Any]]:
    """Every pair that changes over, and that draws tell apart under both conditions, as rows of a table.

    Args:
        found: One comparison for each recording.

    Returns:
        Column: value.
    """
    return [
        dict(
            zip(
                TURNED,
                (own.recording, scenario, condition, measure, own.controllers[before], own.controllers[then]),
                strict=True,
            )
        )
        for own in found
        for (scenario, condition, measure), tau in own.taus.items()
        for before, then in tau.turned_over
    ]


def _cell(tau: Tau) -> str:
    """Such as "0.82 (0.37 to 1.00); 2 of 62"; without pairs where draws are too few for an interval."""
    cell = interval(tau.mean, tau.low, tau.high, 2)
    return cell if isnan(tau.low) else f"{cell}; {len(tau.turned_over)} of {tau.told_apart}"


def _words(measure: str) -> str:
    return measure.replace("_", " ")
