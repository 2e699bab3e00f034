"""Averages over agents and draws: the draw is the unit, because agents of one draw share a crowd."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy.stats import bootstrap

from socialnav_mj.geometry import Array

CONFIDENCE = 0.95
MINIMUM_DRAWS = 3
"""Fewer draws give no interval."""
N_RESAMPLES = 9999

Columns = dict[str, NDArray[Any]]

MEASURES: dict[str, Callable[[Columns], Array]] = {
    "success": lambda c: c["success"],
    "timed_out": lambda c: c["timed_out"],
    "overturned": lambda c: c["overturned"],
    "never_spawned": lambda c: c["never_spawned"],
    "first_hit_pedestrian": lambda c: c["first_partner"] == "pedestrian",
    "first_hit_agent": lambda c: c["first_partner"] == "agent",
    "completion_time": lambda c: c["completion_time"],
    "completion_time_success": lambda c: np.where(c["success"] > 0, c["completion_time"], np.nan),
    "completion_steps": lambda c: c["completion_steps"],
    "completion_steps_success": lambda c: np.where(c["success"] > 0, c["completion_steps"], np.nan),
    "time_under_way": lambda c: c["time_under_way"],
    "distance_to_displacement": lambda c: c["distance_to_displacement"],
    "distance_to_displacement_success": lambda c: np.where(c["success"] > 0, c["distance_to_displacement"], np.nan),
    "average_speed": lambda c: c["average_speed"],
    "intimate_intrusions": lambda c: c["intimate_intrusions"],
    "intrusion_share": lambda c: c["intrusion_share"],
    "intrusion_share_of_steps": lambda c: c["intrusion_share"],
    "minimum_distance": lambda c: c["minimum_distance"],
    "collisions_pedestrian": lambda c: c["collisions_pedestrian"],
    "collisions_agent": lambda c: c["collisions_agent"],
    "spawn_delay": lambda c: c["spawn_delay"],
    **{
        name: itemgetter(name)
        for name in (
            "spl",
            "path_irregularity",
            "failures_to_progress",
            "maximum_speed",
            "maximum_tilt",
            "mean_acceleration",
            "maximum_acceleration",
            "mean_jerk",
            "maximum_jerk",
            "time_not_moving",
            "mean_distance",
            "intimate_zone_share",
            "personal_zone_share",
            "social_zone_share",
            "public_zone_share",
            "space_compliance",
            "minimum_time_to_collision",
            "social_work",
            "wedged_collisions",
            "repeated_collisions",
            "struck_standing",
            "largest_closing_speed",
            "largest_peak_force",
        )
    },
}
"""What is averaged: value of every agent, NaN where it has none. `completion_time` is over arrivals, `..._success` over
successes alone, `time_under_way` over everybody who spawned, time-outs censored. `intrusion_share` weighs agents
equally, `intrusion_share_of_steps` weighs active steps equally. `minimum_time_to_collision` is over agents that were
ever on collision course, `largest_...` over agents with a collision."""

WEIGHTS: dict[str, str] = {"intrusion_share_of_steps": "active_steps"}
"""Columns that weigh agents within a draw; all others weigh equally."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Mean of one measure of one controller in one scenario."""

    dataset: str
    variant: str
    scenario: str
    controller: str
    measure: str
    """Key of `MEASURES`."""
    mean: float
    """Mean of the draws' means; NaN if no agent has a value."""
    standard_error: float
    """Standard deviation of the draws' means over the root of their number; NaN for fewer than 2 draws."""
    low: float
    """Lower end of the 95 % interval; NaN if `note` says why there is none."""
    high: float
    """Upper end."""
    n_draws: int
    """Draws with at least one agent that has a value."""
    n_agents: int
    """Agents that have a value."""
    note: str
    """Why something is missing or special; else empty."""


def summarise(agents: pa.Table) -> list[Estimate]:
    """Every measure of every controller in every scenario.

    Args:
        agents: Columns of `agents.SCHEMA`.

    Returns:
        In the table's order of controllers and scenarios, then in the order of `MEASURES`.
    """
    return [
        estimate(values, weights, draws, labels={**labels, "measure": measure})
        for labels, columns, draws in groups(agents)
        for measure in MEASURES
        for values, weights in [measured(columns, measure)]
    ]


def estimate(values: Array, weights: Array, draws: NDArray[np.int64], *, labels: dict[str, str]) -> Estimate:
    """Mean with its uncertainty, clustered by draw.

    The interval is the bias-corrected and accelerated bootstrap over the draws' means (Efron 1987), with a fixed seed.
    With few draws it is too narrow, as every bootstrap is.

    Args:
        values: One for each agent, shape (n,); NaN where it has none.
        weights: Of the agents within their draw, shape (n,), >= 0.
        draws: Draw of each agent, shape (n,).
        labels: The descriptive fields of the Estimate.

    Returns:
        The estimate.
    """
    _, means = draw_means(values, weights, draws)
    count = len(means)
    mean = standard_error = low = high = float("nan")
    note = ""
    if count >= 1:
        mean = float(means.mean())
    if count >= 2:
        standard_error = float(means.std(ddof=1) / np.sqrt(count))
    if count == 0:
        note = "no agent has a value"
    elif count < MINIMUM_DRAWS:
        note = f"{count} draw{'s' if count > 1 else ''}; an interval needs {MINIMUM_DRAWS}"
    elif np.ptp(means) <= 1e-12 * max(1.0, abs(mean)):
        low = high = mean
        note = "all draws are equal"
    else:
        interval = bootstrap(
            (means,), np.mean, confidence_level=CONFIDENCE, n_resamples=N_RESAMPLES, rng=np.random.default_rng(0)
        ).confidence_interval
        low, high = float(interval.low), float(interval.high)
    return Estimate(
        **labels,
        mean=mean,
        standard_error=standard_error,
        low=low,
        high=high,
        n_draws=count,
        n_agents=int(_defined(values, weights).sum()),
        note=note,
    )


def draw_means(values: Array, weights: Array, draws: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array]:
    """Weighted mean of every draw that has an agent with a value.

    Args:
        values: One for each agent, shape (n,); NaN where it has none.
        weights: Of the agents within their draw, shape (n,), >= 0.
        draws: Draw of each agent, shape (n,).

    Returns:
        The draws, ascending, and their means, both of shape (k,).
    """
    defined = _defined(values, weights)
    values, weights = values[defined], weights[defined]
    unit, index = np.unique(draws[defined], return_inverse=True)
    return unit, np.bincount(index, weights * values) / np.bincount(index, weights)


def _defined(values: Array, weights: Array) -> NDArray[np.bool_]:
    return np.isfinite(values) & (weights > 0.0)


def groups(table: pa.Table) -> Iterator[tuple[dict[str, str], Columns, NDArray[np.int64]]]:
    """Rows of one controller in one scenario together.

    Args:
        table: Has the columns dataset, variant, scenario, controller and draw.

    Yields:
        What the rows share, their columns (null numbers are NaN) and their draws, in the order of first appearance.
    """
    names = ("dataset", "variant", "scenario", "controller")
    keys = list(zip(*(table[name].to_pylist() for name in names), strict=True))
    rows: dict[tuple[str, ...], list[int]] = {}
    for row, key in enumerate(keys):
        rows.setdefault(key, []).append(row)
    for key, chosen in rows.items():
        part = table.take(chosen)
        columns = {name: part[name].to_numpy() for name in part.column_names}
        yield dict(zip(names, key, strict=True)), columns, columns["draw"]


def measured(columns: Columns, measure: str) -> tuple[Array, Array]:
    """A measure of every agent, and the agent's weight within its draw.

    Args:
        columns: Of some agents.
        measure: Key of `MEASURES`.

    Returns:
        Both of shape (n,); the value is NaN where there is none.
    """
    values = np.asarray(MEASURES[measure](columns), dtype=float)
    return values, columns[WEIGHTS[measure]].astype(float) if measure in WEIGHTS else np.ones_like(values)
