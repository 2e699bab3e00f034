"""The section of report.md on the user's own metrics."""

import math
from collections.abc import Mapping, Sequence

from socialnav_mj.recordings.known import crowd_of
from socialnav_mj.report.estimates import Estimate, Measure
from socialnav_mj.report.markdown import bounds, head, number, plain, row


def own_section(estimates: Sequence[Estimate], measures: Mapping[str, Measure]) -> list[str]:
    """Means and intervals of the user's own metrics.

    Args:
        estimates: Of all measures of the run.
        measures: Those of the own metrics, by name.

    Returns:
        Lines; none without own metrics.
    """
    shown = [estimate for estimate in estimates if estimate.measure in measures]
    if not shown:
        return []
    lines = ["## Own metrics", ""]
    lines += [f"- **{name}**: {plain(measure.metric.formula)}" for name, measure in measures.items()]
    headings = ("crowd", "scenario", "controller", "metric", "mean ± error", "95 % interval", "draws", "agents")
    lines += ["", *head(list(headings))]
    for own in shown:
        measure = measures[own.measure]
        error = "" if math.isnan(own.standard_error) else f" ± {number(own.standard_error, measure.digits)}"
        cells = [crowd_of(own.dataset, own.variant), own.scenario, own.controller, measure.heading]
        cells += [f"{number(own.mean, measure.digits)}{error}", bounds(own.low, own.high)]
        lines.append(row([*cells, str(own.n_draws), str(own.n_agents)]))
    return [*lines, ""]
