"""Results of a run as tables for a terminal."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from socialnav_mj.cli.console import console
from socialnav_mj.recordings.known import crowd_of
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES, Estimate
from socialnav_mj.report.markdown import bounds
from socialnav_mj.report.page import by_scenario, with_error

_COLUMNS = (
    col.SUCCESS,
    col.FIRST_HIT_PEDESTRIAN,
    col.FIRST_HIT_AGENT,
    col.TIMED_OUT,
    col.TIME_UNDER_WAY,
    col.DISTANCE_TO_DISPLACEMENT,
    col.INTIMATE_INTRUSIONS,
    col.AVERAGE_SPEED,
)
"""Fewer, for 80 characters; the first alone shows its error."""


def terminal_tables(estimates: Sequence[Estimate]) -> list[Table]:
    """One table for each scenario, for a terminal.

    Args:
        estimates: Of the measures of one run, as `estimates.summarise` returns them.

    Returns:
        Tables with a row for each controller, in the estimates' order.
    """
    tables = []
    for (dataset, variant, scenario), rows in by_scenario(estimates):
        n_draws = max(row["success"].n_draws for _, row in rows)
        spread = "± standard error" if n_draws > 1 else "no error: that takes more draws"
        table = Table(
            title=Text(f"{crowd_of(dataset, variant)}, {scenario}"),
            caption=f"means over {n_draws} draw{'s' * (n_draws > 1)}, {spread}; times count time-outs",
            box=box.SIMPLE_HEAD,
            padding=0,
        )
        table.add_column("controller", overflow="fold")
        shown = [MEASURES[name] for name in _COLUMNS]
        for measure in shown:
            table.add_column(Text(measure.narrow_heading), justify="right")
        for controller, own in rows:
            means = [f"{own[measure.name].mean:.{measure.narrow_digits}f}" for measure in shown[1:]]
            table.add_row(Text(controller), with_error(own[shown[0].name], shown[0].narrow_digits), *means)
        tables.append(table)
    return tables


def own_table(estimates: Sequence[Estimate], own: Sequence[str]) -> Table:
    """Means and intervals of the user's own metrics.

    Args:
        estimates: See `terminal_tables`.
        own: Names of their measures.

    Returns:
        A row for each scenario, controller and metric.
    """
    table = Table(title="own metrics", box=box.SIMPLE_HEAD, padding=0)
    for heading in ("scenario", "controller", "metric", "mean", "95 % interval"):
        table.add_column(heading, overflow="fold")
    for e in estimates:
        if e.measure in own:
            texts = (e.scenario, e.controller, e.measure, f"{e.mean:.3g}", bounds(e.low, e.high))
            table.add_row(*map(Text, texts))
    return table


def _without_nan(values: dict[str, Any]) -> dict[str, Any]:
    return {key: None if value != value else value for key, value in values.items()}


def show(estimates: Sequence[Estimate], own: Sequence[str] = ()) -> None:
    """Print `terminal_tables` to stdout.

    Args:
        estimates: Of the measures of one run, as `estimates.summarise` returns them.
        own: Names of the user's own measures, which get a table of their own.
    """
    console.tell(estimates=[_without_nan(asdict(estimate)) for estimate in estimates])
    for table in terminal_tables(estimates):
        console.print(table)
    if own:
        console.print(own_table(estimates, own))
