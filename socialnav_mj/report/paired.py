"""Every agent beside the person it replaced: same start, goal and time, so that the difference is the controller's."""

from collections.abc import Callable

import numpy as np
import pyarrow as pa

from socialnav_mj.geometry import Array
from socialnav_mj.report.estimates import Columns, Estimate, estimate, groups

HUMAN = "human"
"""Name of the controller under which the recorded people themselves are scored."""

HUMAN_COLUMNS = {
    f"human_{name}": name
    for name in ("completion_time", "path_length", "intimate_intrusions", "intrusion_share", "minimum_distance")
}
"""Column of the agents' table: column of the person's own row that it repeats."""

DIFFERENCES: dict[str, Callable[[Columns], Array]] = {
    "time": lambda c: c["time_under_way"] - c["human_completion_time"],
    "time_of_arrivals": lambda c: c["completion_time"] - c["human_completion_time"],
    "path_of_arrivals": lambda c: np.where(c["arrived"], c["path_length"] - c["human_path_length"], np.nan),
    "intimate_intrusions": lambda c: c["intimate_intrusions"] - c["human_intimate_intrusions"],
    "intrusion_share": lambda c: c["intrusion_share"] - c["human_intrusion_share"],
    "minimum_distance": lambda c: c["minimum_distance"] - c["human_minimum_distance"],
}
"""Agent minus person. `time` counts time-outs with the time watched, a lower bound; the others of a failed run are what
they are. NaN where either has no value."""

_KEY = ("dataset", "variant", "scenario", "draw", "person")


def pair_with_humans(agents: pa.Table) -> pa.Table:
    """Fill the columns of `HUMAN_COLUMNS`.

    Args:
        agents: Columns of `agents.SCHEMA`.

    Returns:
        The same rows; null where the run has no human row of the same scenario and draw.
    """
    keys = list(zip(*(agents[name].to_pylist() for name in _KEY), strict=True))
    is_human = [name == HUMAN for name in agents["controller"].to_pylist()]
    human = {key: row for row, (key, own) in enumerate(zip(keys, is_human, strict=True)) if own}
    rows = pa.array([human.get(key) for key in keys], pa.int64())
    for column, source in HUMAN_COLUMNS.items():
        place = agents.schema.get_field_index(column)
        values = agents[source].combine_chunks().take(rows)
        agents = agents.set_column(place, agents.schema.field(place), values)
    return agents


def paired_differences(agents: pa.Table) -> list[Estimate]:
    """Mean difference between agents and the people they replaced, draw by draw.

    The mean over a draw's agents is one number, and the 95 % interval a bootstrap over draws (`estimates.estimate`).

    Args:
        agents: Columns of `agents.SCHEMA`, paired.

    Returns:
        In the table's order of scenarios and controllers, then of `DIFFERENCES`; nothing for the people themselves.
    """
    result = []
    for labels, columns, draws in groups(agents):
        if labels["controller"] == HUMAN:
            continue
        for measure, difference in DIFFERENCES.items():
            values = np.asarray(difference(columns), dtype=float)
            result.append(estimate(values, np.ones_like(values), draws, labels={**labels, "measure": measure}))
    return result
