"""The start page of a run's traces, as Markdown."""

import math
from collections.abc import Sequence

from socialnav_mj.report.markdown import number, plain, table
from socialnav_mj.trace.start import Facts


def start_page(title: str, found: Sequence[Facts]) -> str:
    """A table of traces.

    Args:
        title: What they are of, such as the run's folder.
        found: Of each trace.

    Returns:
        Markdown.
    """
    lines = [
        f"# {plain(title)}",
        "",
        "Every trace is a recording in the panel on the left: a click shows it. The arrow at the top leads back here.",
        "",
    ]
    rows = [
        [f.scenario, f.controller, str(f.draw), number(f.success, 3), f.dataset, f.state_hash[:12], f.path.name]
        for f in sorted(found, key=_order)
    ]
    return "\n".join([*lines, *table(["scenario", "controller", "draw", "success", "crowd", "state", "file"], rows)])


def _order(facts: Facts) -> tuple[str, float, str, int]:
    """The best first in each scenario."""
    return facts.scenario, math.inf if math.isnan(facts.success) else -facts.success, facts.controller, facts.draw
