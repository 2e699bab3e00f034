"""The table of metrics in docs/metrics.md, made from their declarations; `make docs` writes it."""

import math
from collections.abc import Sequence
from pathlib import Path

from socialnav_mj.files import write_whole
from socialnav_mj.metrics.metric import Kind, Metric
from socialnav_mj.metrics.registry import METRICS
from socialnav_mj.report.columns import place
from socialnav_mj.report.markdown import head, marked_row

BEGIN = "<!-- Made by `make docs` from the declarations in socialnav_mj/metrics. -->"
END = "<!-- End of what `make docs` makes. -->"


def definitions(metrics: Sequence[Metric] = METRICS) -> list[str]:
    """What each metric is.

    Args:
        metrics: To be listed.

    Returns:
        Lines of a Markdown table, in the order of `columns.ORDER`.
    """
    rows = (
        [f"`{m.name}`", m.formula, unit_and_range(m), m.better.value, m.missing.rule, m.source]
        for m in sorted(metrics, key=lambda metric: place(metric.name))
    )
    headings = ["metric", "formula", "unit, range", "better", "NaN", "source; where others differ"]
    return [*head(headings), *map(marked_row, rows), ""]


def unit_and_range(metric: Metric) -> str:
    """Unit and possible values of a metric in words.

    Args:
        metric: To be described.

    Returns:
        For example "s, >= 0", "[0, 1]", "count" or "0: pedestrian, 1: agent".
    """
    if metric.kind is Kind.FLAG:
        return "0 or 1"
    if metric.kind is Kind.NAME:
        return ", ".join(f"{value}: {name}" for value, name in metric.names.items())
    if metric.kind is Kind.COUNT and not metric.unit:
        return "count"
    low, high = (_number(limit) for limit in metric.limits)
    limits = f"[{low}, {high}]" if low and high else f">= {low}" if low else f"<= {high}" if high else ""
    words = [metric.unit, limits, "or inf" if metric.infinite else ""]
    return ", ".join(word for word in words if word)


def _number(limit: float) -> str:
    """Short form of a limit; empty if there is none."""
    if math.isinf(limit):
        return ""
    return "pi" if limit == math.pi else f"{limit:g}"


def with_definitions(page: str, metrics: Sequence[Metric] = METRICS) -> str:
    """Replace the table of a page.

    Args:
        page: Markdown with the lines `BEGIN` and `END`.
        metrics: To be listed.

    Returns:
        The page with the table of today between them.

    Raises:
        ValueError: If the page lacks one of the two lines.
    """
    if not 0 <= page.find(BEGIN) < page.find(END):
        raise ValueError(f"the page lacks {BEGIN!r} or, after it, {END!r}")
    before, _, rest = page.partition(BEGIN)
    return "\n".join([f"{before}{BEGIN}", "", *definitions(metrics), END]) + rest.partition(END)[2]


def write_definitions(path: str | Path) -> Path:
    """Bring the table of a page up to date.

    Args:
        path: Of docs/metrics.md.

    Returns:
        The path.
    """
    return write_whole(path, with_definitions(Path(path).read_text(encoding="utf-8")).encode())
