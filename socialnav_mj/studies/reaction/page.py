"""README.md of the reaction study."""

from collections.abc import Mapping, Sequence
from typing import Any

from socialnav_mj.report.intervals import ONE_RECORDING
from socialnav_mj.report.markdown import interval, table
from socialnav_mj.studies.cells import interval_cell, mean_cell
from socialnav_mj.studies.conditions import Comparison
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.kendall import EXPLAINED
from socialnav_mj.studies.looks import SCENARIO_TITLES
from socialnav_mj.studies.ranking import ranking_lines
from socialnav_mj.studies.slopes import ORDER_OF_PANELS

_HOW_TO_READ = f"""\
Every controller drove the same agents among the same people, who keep to the recording (*replay*), or step off it for \
robots and come back: *weak* and *yielding* bracket the unknown strength (docs/simulation.md, "People who react"). \
*Difference*: the level minus replay, paired by agent, with its 95 % interval. *Imposed deviation* and *delay*: metres \
and seconds by which an agent makes people leave their recorded tracks, a cost that replay cannot show. {EXPLAINED} \
{ORDER_OF_PANELS} {ONE_RECORDING}
"""


def reaction_page(
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
    lines = ["# People who react", "", f"Command: `{provenance['command']}`", "", _HOW_TO_READ]
    lines += ["## Does the ranking hold?", "", *ranking_lines(found)]
    lines += ["## How far controllers lie apart", "", *_spread(found)]
    for own in found:
        lines += [f"## {own.recording}", "", *figures[own.recording]]
        for scenario in own.scenarios:
            lines += [f"### {SCENARIO_TITLES.get(scenario, scenario)}", "", *_scenario(own, scenario)]
    return "\n".join([*lines, *traceability(provenance, provenance["recordings"])]) + "\n"


def _spread(found: Sequence[Comparison]) -> list[str]:
    """Greatest minus least success of the controllers under each condition."""
    rows = []
    for own in found:
        for scenario in own.scenarios:
            cells = []
            for condition in own.conditions:
                levels = [own.level(scenario, name, condition, "success") for name in own.controllers]
                means = [level.interval.mean for level in levels if level is not None]
                cells.append(f"{min(means):.3f} to {max(means):.3f}" if means else "-")
            rows.append([own.recording, SCENARIO_TITLES.get(scenario, scenario), *cells])
    titles = [f"success, {condition.name}" for condition in found[0].conditions]
    return table(["recording", "scenario", *titles], rows)


def _scenario(own: Comparison, scenario: str) -> list[str]:
    first, *others = own.conditions
    rows = []
    for name in own.controllers:
        cells = [name, interval_cell(own.level(scenario, name, first, "success"))]
        for other in others:
            gap = own.differences[scenario, name, other.name, "success"]
            cells.append(interval(gap.mean, gap.low, gap.high, 3, "+"))
        cells.append(mean_cell(own.level(scenario, name, first, "intrusion_share_of_steps"), 3))
        for other in others:
            gap = own.differences[scenario, name, other.name, "intrusion_share_of_steps"]
            cells.append(interval(gap.mean, gap.low, gap.high, 3, "+"))
        for measure in ("deviation_imposed", "delay_imposed"):
            cells.append(" / ".join(mean_cell(own.level(scenario, name, other, measure), 2) for other in others))
        rows.append(cells)
    names = [other.name for other in others]
    heads = ["controller", f"success, {first.name}", *(f"difference, {name}" for name in names)]
    heads += [f"share within 1.2 m, {first.name}", *(f"difference, {name}" for name in names)]
    heads += [f"imposed {what}, {' / '.join(names)}" for what in ("deviation [m]", "delay [s]")]
    return table(heads, rows)
