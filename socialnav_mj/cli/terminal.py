"""Results of a run as tables for a terminal."""

from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from socialnav_mj.cli.console import console
from socialnav_mj.report.estimates import Estimate
from socialnav_mj.report.page import by_scenario, with_error

_COLUMNS = (
    ("success", "success", 3),
    ("hit by\npeople", "first_hit_pedestrian", 3),
    ("hit by\nagent", "first_hit_agent", 3),
    ("timed\nout", "timed_out", 3),
    ("time\n[s]", "time_under_way", 1),
    ("path\nratio", "distance_to_displacement", 2),
    ("steps\n<1.2 m", "intimate_intrusions", 1),
    ("speed\n[m/s]", "average_speed", 2),
)
"""Fewer, for 80 characters; the first alone shows its error."""


def terminal_tables(estimates: Sequence[Estimate]) -> list[Table]:
    """One table for each scenario, for a terminal.

    Args:
        estimates: Of `estimates.summarise`.

    Returns:
        Tables with a row for each controller, in the estimates' order.
    """
    tables = []
    for (dataset, variant, scenario), rows in by_scenario(estimates):
        n_draws = max(row["success"].n_draws for _, row in rows)
        table = Table(
            title=Text(f"{dataset} ({variant}), {scenario}"),
            caption=f"means over {n_draws} draw(s), ± standard error; times count time-outs",
            box=box.SIMPLE_HEAD,
            padding=0,
        )
        table.add_column("controller", overflow="fold")
        for heading, _, _ in _COLUMNS:
            table.add_column(Text(heading), justify="right")
        for controller, own in rows:
            means = [f"{own[measure].mean:.{digits}f}" for _, measure, digits in _COLUMNS[1:]]
            table.add_row(Text(controller), with_error(own["success"], _COLUMNS[0][2]), *means)
        tables.append(table)
    return tables


def show(estimates: Sequence[Estimate]) -> None:
    """Print them.

    Args:
        estimates: Of `estimates.summarise`.
    """
    for table in terminal_tables(estimates):
        console.print(table)
