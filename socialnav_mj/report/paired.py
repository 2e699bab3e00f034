"""Every agent beside the person it replaced: same start, goal and time, so that the difference is the controller's."""

from collections.abc import Callable, Sequence

import numpy as np
import pyarrow as pa

from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Metric
from socialnav_mj.metrics.registry import METRICS
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import Columns, Estimate, estimate, groups

HUMAN = "human"
"""Name of the controller under which the recorded people themselves are scored."""

DIFFERENCES: dict[str, Callable[[Columns], Array]] = {
    "time": lambda c: c[col.TIME_UNDER_WAY] - c[col.human(col.COMPLETION_TIME)],
    "time_of_arrivals": lambda c: c[col.COMPLETION_TIME] - c[col.human(col.COMPLETION_TIME)],
    "path_of_arrivals": lambda c: np.where(c[col.ARRIVED], c[col.PATH_LENGTH] - c[col.human(col.PATH_LENGTH)], np.nan),
    "intimate_intrusions": lambda c: c[col.INTIMATE_INTRUSIONS] - c[col.human(col.INTIMATE_INTRUSIONS)],
    "intrusion_share": lambda c: c[col.INTRUSION_SHARE] - c[col.human(col.INTRUSION_SHARE)],
    "minimum_distance": lambda c: c[col.MINIMUM_DISTANCE] - c[col.human(col.MINIMUM_DISTANCE)],
}
"""Agent minus person. `time` counts time-outs with the time watched, a lower bound; the others of a failed run are what
they are. NaN where either has no value."""

_KEY = (col.DATASET, col.VARIANT, col.SCENARIO, col.DRAW, col.PERSON)


def pair_with_humans(agents: pa.Table, metrics: Sequence[Metric] = METRICS) -> pa.Table:
    """Fill the columns of what the replaced people had.

    Args:
        agents: Columns of `agents.agents_schema`.
        metrics: Of the table; those that are declared as `paired` are filled in.

    Returns:
        The same rows; null where the run has no human row of the same scenario and draw.
    """
    keys = list(zip(*(agents[name].to_pylist() for name in _KEY), strict=True))
    is_human = [name == HUMAN for name in agents[col.CONTROLLER].to_pylist()]
    human = {key: row for row, (key, own) in enumerate(zip(keys, is_human, strict=True)) if own}
    rows = pa.array([human.get(key) for key in keys], pa.int64())
    for name in (metric.name for metric in metrics if metric.paired):
        place = agents.schema.get_field_index(col.human(name))
        values = agents[name].combine_chunks().take(rows)
        agents = agents.set_column(place, agents.schema.field(place), values)
    return agents


def paired_differences(agents: pa.Table) -> list[Estimate]:
    """Mean difference between agents and the people they replaced, draw by draw.

    The mean over a draw's agents is one number, with the 95 % interval over draws (`estimates.estimate`).

    Args:
        agents: Columns of `agents.SCHEMA`, paired.

    Returns:
        In the table's order of scenarios and controllers, then of `DIFFERENCES`; nothing for the people themselves.
    """
    result = []
    for labels, columns, draws in groups(agents):
        if labels[col.CONTROLLER] == HUMAN:
            continue
        for measure, difference in DIFFERENCES.items():
            values = np.asarray(difference(columns), dtype=float)
            result.append(estimate(values, np.ones_like(values), draws, labels={**labels, "measure": measure}))
    return result
