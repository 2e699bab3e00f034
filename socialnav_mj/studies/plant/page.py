"""README.md of the plant study, and its verdict: what would a kinematic simulator have told wrongly?"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from socialnav_mj.report.intervals import CONFIDENCE, ONE_RECORDING
from socialnav_mj.report.markdown import interval, table
from socialnav_mj.studies.cells import interval_cell, mean_cell
from socialnav_mj.studies.conditions import Comparison
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.kendall import EXPLAINED
from socialnav_mj.studies.looks import SCENARIO_TITLES
from socialnav_mj.studies.ranking import ranking_lines
from socialnav_mj.studies.slopes import ORDER_OF_PANELS

IDEAL = "unicycle"
"""The condition that stands for a kinematic simulator."""
JUDGED = {
    "success": ("success", "", 3),
    "intrusion_share_of_steps": ("the share of steps within 1.2 m", "", 3),
    "time_under_way": ("the time", " s", 1),
}
"""Measure: how a verdict calls it, its unit, digits."""
_HOW_TO_READ = f"""\
Every controller drove the same agents among the same people on four plants: the default *wheels*; an ideal *unicycle* \
that follows every command exactly, whatever it touches; a *heavy* base that accelerates with 1 m/s^2; and wheels on a \
*slippery* floor (docs/simulation.md, "Plants"). *Difference*: minus wheels, paired by agent, with its 95 % interval. \
*Verdict*: what of the unicycle's numbers lies off those of the wheels by more than its interval; every statement is \
its own test at 95 %. *Tracking error*: between where a command leads and where the robot is a control step later. \
*Not met*: share of control steps at whose end the robot is off the commanded twist by more than 0.1 m/s or 0.2 rad/s, \
since its motors are at their limit, it slips, or it is held. {EXPLAINED} \
{ORDER_OF_PANELS} {ONE_RECORDING}
"""


def verdict(own: Comparison, scenario: str, controller: str) -> list[str]:
    """What a kinematic simulator tells wrongly of a controller.

    Args:
        own: Comparison of one recording; its first condition is what counts.
        scenario: Name of a task.
        controller: Of the comparison.

    Returns:
        A statement for each of `JUDGED` that the unicycle has otherwise; empty if there is none.
    """
    said = []
    for measure, (name, unit, digits) in JUDGED.items():
        gap = own.differences[scenario, controller, IDEAL, measure]
        if gap.low > 0.0 or gap.high < 0.0:
            way = "too high" if gap.mean > 0.0 else "too low"
            low, high = sorted((abs(gap.low), abs(gap.high)))
            ends = interval(abs(gap.mean), low, high, digits)
            said.append(f"{name} {way} by {ends}{unit}")
    return said


def verdict_rows(found: Sequence[Comparison]) -> list[dict[str, Any]]:
    """Every verdict as rows of a table.

    Args:
        found: One comparison for each recording.

    Returns:
        Column: value.
    """
    return [
        {
            "recording": own.recording,
            "scenario": scenario,
            "controller": controller,
            "told_wrongly": "; ".join(verdict(own, scenario, controller)),
        }
        for own in found
        for scenario in own.scenarios
        for controller in own.controllers
    ]


def plant_page(
    found: Sequence[Comparison], *, figures: Mapping[str, Sequence[str]], provenance: Mapping[str, Any]
) -> str:
    """Text of the study's README.md.

    Args:
        found: One comparison for each recording.
        figures: Name of the recording: lines that show its figures.
        provenance: Command, experiment, recordings, runs.

    Returns:
        Markdown.
    """
    lines = ["# What physics changes", "", f"Command: `{provenance['command']}`", "", _HOW_TO_READ]
    lines += ["## What would a kinematic simulator have told wrongly?", "", *_verdicts(found)]
    lines += ["## Does the ranking hold?", "", *ranking_lines(found)]
    for own in found:
        lines += [f"## {own.recording}", "", *figures[own.recording]]
        for scenario in own.scenarios:
            lines += [f"### {SCENARIO_TITLES.get(scenario, scenario)}", "", *_scenario(own, scenario)]
    return "\n".join([*lines, *traceability(provenance, provenance["recordings"])]) + "\n"


def _verdicts(found: Sequence[Comparison]) -> list[str]:
    rows, n_told = [], 0
    for controller in found[0].controllers:
        for own in found:
            told = {scenario: verdict(own, scenario, controller) for scenario in own.scenarios}
            n_told += sum(len(said) for said in told.values())
            texts = [
                f"{SCENARIO_TITLES.get(s, s).split(':')[0]}: {', '.join(said)}" for s, said in told.items() if said
            ]
            rows.append([controller, own.recording, "; ".join(texts) or "nothing that these draws show"])
    n_tests = sum(
        bool(np.isfinite((gap.low, gap.high)).all())
        for own in found
        for (_, _, condition, measure), gap in own.differences.items()
        if condition == IDEAL and measure in JUDGED
    )
    chance = f"were nothing told wrongly, chance would show some {(1.0 - CONFIDENCE) * n_tests:.0f}"
    how_many = f"Told wrongly: {n_told} of {n_tests} numbers; {chance}."
    return [how_many, "", *table(["controller", "recording", "told wrongly"], rows)]


def _scenario(own: Comparison, scenario: str) -> list[str]:
    first, *others = own.conditions
    rows = []
    for name in own.controllers:
        cells = [name, interval_cell(own.level(scenario, name, first, "success"))]
        for other in others:
            gap = own.differences[scenario, name, other.name, "success"]
            cells.append(interval(gap.mean, gap.low, gap.high, 3, "+"))

        def each(measure: str, digits: int, name: str = name) -> str:
            levels = [own.level(scenario, name, condition, measure) for condition in own.conditions]
            return " / ".join(mean_cell(level, digits) for level in levels)

        cells += [each("time_under_way", 1), each("first_hit_pedestrian", 3), each("first_hit_agent", 3)]
        cells += [each("tracking_error", 3), each("side_slip", 3), each("unmet_share", 3)]
        rows.append([*cells, each("stopping_distance", 2)])
    heads = ["controller", f"success, {first.name}", *(f"difference, {other.name}" for other in others)]
    each_of = " / ".join(condition.name for condition in own.conditions)
    heads += [f"time, censored [s]: {each_of}", "first collision with a pedestrian", "with an agent"]
    return table([*heads, "tracking error [m]", "side slip [m/s]", "commands not met", "stopping distance [m]"], rows)
