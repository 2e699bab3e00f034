"""report.md: results of a run to be read, how to read them, and where they come from."""

import json
import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, TypeVar

from socialnav_mj.provenance import differences
from socialnav_mj.recordings.known import crowd_of, is_simulated
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES, Estimate
from socialnav_mj.report.intervals import LEAST, ONE_RECORDING
from socialnav_mj.report.markdown import bounds, code, head, interval, number, plain, row

SHOWN = (
    col.SUCCESS,
    col.SUCCESS_IF_GHOSTS_COUNT,
    col.FIRST_HIT_PEDESTRIAN,
    col.FIRST_HIT_AGENT,
    col.TIMED_OUT,
    col.OVERTURNED,
    col.COMPLETION_TIME_SUCCESS,
    col.TIME_UNDER_WAY,
    col.DISTANCE_TO_DISPLACEMENT,
    col.INTIMATE_INTRUSIONS,
    col.INTRUSION_SHARE_OF_STEPS,
    col.AVERAGE_SPEED,
)
"""Measures in report.md and report.html; all are in summary.csv."""

Other = TypeVar("Other")
"""A table that is no Markdown."""

_CELLS = """\
Every cell is the mean over draws ± its standard error; a draw is one random choice of the people who are replaced, \
and its mean over agents is one number. """

_HOW_TO_READ = f"""\
The 95 % interval is Student's over draws, for shares Wilson's with the number \
of agents that the spread between draws is worth (none for fewer than {LEAST} draws); where all draws have the same \
share, it stands in place of the error. {ONE_RECORDING} Controllers that share draws drove the same agents, so compare \
them draw by draw (`agents.parquet`). All other measures, defined in docs/metrics.md, are in `summary.csv`; every \
collision is a row of `tables/collisions.parquet`.

- **human**: the {{people}} themselves, each on its own track instead of the agent that replaced it, scored by \
the same code. Their contacts come from geometry at the same radii. It is the row to compare with, not a target of 1.
- **success**: arrived, and had no collision on the way, whoever moved into whom; over all agents.
- **success if ghosts count**: a person whose track begins on a robot passes through it as a ghost until clear, which \
is no collision; here whoever overlapped one did not succeed.
- **first collision with**: share of all agents whose first collision was with a pedestrian, or with another agent, \
whoever moved into whom.
- **timed out**: share of all agents whose deadline passed; **overturned**: of those that ended on their side or back, \
which fails and ends the trip.
- **time of successes**: spawn to arrival, over successes alone. It flatters fragile controllers, whose successes are \
the short trips; **time, censored** is over everybody who spawned and takes the time watched where an agent did not \
arrive, a lower bound.
- **path / displacement**: path traced over the straight distance from start to goal, over arrivals. The path ends \
within the goal radius, so a straight trip scores a little less than 1.
- **intimate intrusions**: control steps with a pedestrian's centre nearer than 1.2 m (the paper's number and \
name; Hall's *personal* distance), per agent; **share** is over all steps under way. Other agents do not count.
- **speed**: path over time under way, arrived or not.
"""


def report_page(summary: dict[str, Any], estimates: Sequence[Estimate], sections: Sequence[str]) -> str:
    """Everything that a run says, as Markdown.

    Args:
        summary: Command, warnings, recordings, versions and groups, as `summary.summary_of` returns them.
        estimates: Those that the summary was made of.
        sections: Lines that stand between the tables and how to read them.

    Returns:
        The text of report.md.
    """
    tables = [_table(rows) for _, rows in by_scenario(estimates)]
    return "\n".join(report_blocks(summary, estimates, tables, sections, cells=_CELLS))


def report_blocks(
    summary: dict[str, Any],
    estimates: Sequence[Estimate],
    tables: Sequence[Other],
    sections: Sequence[str],
    *,
    cells: str,
) -> list[str | Other]:
    """What a page about a run consists of.

    Args:
        summary: See `report_page`.
        estimates: See `report_page`.
        tables: One for each of `by_scenario`.
        sections: See `report_page`.
        cells: What stands in a table's cells, as Markdown.

    Returns:
        Markdown, and the tables in their places.
    """
    lines = ["# Report", ""]
    lines += [f"Command: {code(summary['command'])}" if summary["command"] else "Command: not recorded (no run.json)."]
    lines += ["", "Made from the episode files alone; `socialnav-mj report FOLDER` makes it again.", ""]
    lines += [f"**Warning**: {plain(warning)}.\n" for warning in summary["warnings"]]
    blocks: list[str | Other] = []
    for ((dataset, variant, scenario), _), table in zip(by_scenario(estimates), tables, strict=True):
        share = next(
            g["scenario_configuration"]["share"]
            for g in summary["groups"]
            if (g["dataset"], g["variant"], g["scenario"]) == (dataset, variant, scenario)
        )
        lines += [
            f"## {plain(f'{crowd_of(dataset, variant)}, {scenario}')}: {100 * share:g} % of the people replaced",
            "",
        ]
        blocks += ["\n".join(lines), table]
        lines = [""]
    lines += [
        *sections,
        "## How to read it",
        "",
        cells + _HOW_TO_READ.replace("{people}", _people(summary)),
        *_traceability(summary),
    ]
    return [*blocks, "\n".join(lines) + "\n"]


def _table(rows: Sequence[tuple[str, dict[str, Estimate]]]) -> str:
    """Controllers of a scenario."""
    shown = [MEASURES[name] for name in SHOWN]
    lines = head(["controller", shown[0].heading, "95 % interval", *(m.heading for m in shown[1:]), "draws", "agents"])
    for controller, own in rows:
        cells = [with_error(own[measure.name], measure.digits) for measure in shown]
        counts = [str(own["success"].n_draws), str(own["success"].n_agents)]
        lines.append(row([controller, cells[0], bounds(own["success"].low, own["success"].high), *cells[1:], *counts]))
    return "\n".join(lines)


def _people(summary: dict[str, Any]) -> str:
    """Whose tracks the human row is of."""
    simulated = {is_simulated(r["name"], r["variant"]) for r in summary["recordings"]}
    return " and ".join(f"{'simulated' if each else 'recorded'} people" for each in sorted(simulated))


def _traceability(summary: dict[str, Any]) -> list[str]:
    lines = ["## Traceability", "", "Recordings:", ""]
    recordings = (f"{r['name']}, variant {r['variant']}, checksum {r['checksum']}" for r in summary["recordings"])
    lines += [f"- {plain(text)}" for text in recordings]
    lines += ["", "Versions:", ""]
    versions = (", ".join(f"{name} {version}" for name, version in v.items()) for v in summary["versions"])
    lines += [f"- {plain(text)}" for text in versions]
    lines += ["", "Configurations (the draw's seed apart):", ""]
    configurations: dict[str, Any] = {}
    for group in summary["groups"]:
        dataset = f"{group['dataset']} ({group['variant']})"
        configurations[f"{group['scenario']} of {dataset}"] = group["scenario_configuration"]
        configurations[f"{group['controller']} on {dataset}"] = group["controller_configuration"]
    lines += [
        f"- {plain(name)}: {code(json.dumps(value, sort_keys=True))}" for name, value in sorted(configurations.items())
    ]
    lines += _what_differs(summary)
    lines += ["", "Episodes:", "", *head(["file", "draw", "state hash"])]
    lines += [
        row([e["file"], str(e["draw"]), e["state_hash"]]) for group in summary["groups"] for e in group["episodes"]
    ]
    return lines


def _what_differs(summary: dict[str, Any]) -> list[str]:
    """Controllers of one class beside the first of them: other settings, or another state of its source."""
    by_name = {group["controller"]: group["controller_configuration"] for group in summary["groups"]}
    first: dict[str, str] = {}
    lines = []
    for name, configuration in by_name.items():
        model = first.setdefault(str(configuration.get("class", name)), name)
        if other := [text for text in differences(by_name[model], configuration) if not text.startswith(_NAMES)]:
            lines.append(f"- {plain(name)} differs from {plain(model)}: {code('; '.join(other))}")
    return (
        ["", "What differs between controllers of one class (value of the latter, but of the former):", "", *lines]
        if lines
        else []
    )


_NAMES = ("name = ", "attributes.name = ", "attributes = ")
"""Differences that the rows' names say already."""


def by_scenario(
    estimates: Sequence[Estimate],
) -> Iterator[tuple[tuple[str, str, str], list[tuple[str, dict[str, Estimate]]]]]:
    """Estimates as the rows of tables.

    Args:
        estimates: Of `estimates.summarise`.

    Yields:
        (dataset, variant, scenario), and for each of its controllers the estimates by measure; in the given order.
    """
    for scenario, group in groupby(estimates, key=lambda e: (e.dataset, e.variant, e.scenario)):
        rows = groupby(group, key=lambda e: e.controller)
        yield scenario, [(controller, {e.measure: e for e in row}) for controller, row in rows]


def with_error(estimate: Estimate, digits: int) -> str:
    """A mean and its standard error, as far as there is one; the interval of a share that is equal in all draws.

    Args:
        estimate: Of a measure.
        digits: Behind the point.

    Returns:
        "-" where there is nothing to tell.
    """
    if estimate.standard_error < 1e-12 and not math.isnan(estimate.low):
        return interval(estimate.mean, estimate.low, estimate.high, digits)
    error = "" if math.isnan(estimate.standard_error) else f" ± {number(estimate.standard_error, digits)}"
    return number(estimate.mean, digits) + error
