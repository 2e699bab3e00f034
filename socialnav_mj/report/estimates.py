"""Averages over agents and draws: the draw is the unit, because agents of one draw share a crowd."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Mean, Metric
from socialnav_mj.metrics.registry import METRICS
from socialnav_mj.report.columns import CONTROLLER, DATASET, DRAW, SCENARIO, SUCCESS, VARIANT, place
from socialnav_mj.report.intervals import interval_of

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True, kw_only=True)
class Measure:
    """What is averaged over agents: a metric, and over whom."""

    metric: Metric
    mean: Mean

    def __call__(self, columns: Columns) -> Array:
        """Value of every agent.

        Args:
            columns: Of the agents' table, each of shape (n,).

        Returns:
            Shape (n,); NaN where an agent has none or does not count.
        """
        values = columns[self.metric.name]
        if self.mean.share_of:
            return values == self.mean.share_of
        return np.where(columns[SUCCESS] > 0, values, np.nan) if self.mean.successes else values

    @property
    def name(self) -> str:
        """In summary.csv."""
        return self.mean.name or self.metric.name

    @property
    def heading(self) -> str:
        """In report.md, with the unit in brackets."""
        label = self.mean.heading or self.metric.label
        return f"{label} [{self.metric.unit}]" if self.metric.unit else label

    @property
    def narrow_heading(self) -> str:
        """In a terminal; one or two lines."""
        return self.mean.narrow or self.heading

    @property
    def digits(self) -> int:
        """Behind the point, in report.md."""
        return self.metric.digits

    @property
    def narrow_digits(self) -> int:
        """Behind the point, in a terminal."""
        return self.digits if self.mean.narrow_digits is None else self.mean.narrow_digits

    @property
    def limits(self) -> tuple[float, float]:
        """Least and greatest mean."""
        return (0.0, 1.0) if self.mean.share_of else self.metric.limits

    @property
    def is_share(self) -> bool:
        """Whether its means are shares in [0, 1]."""
        return self.limits == (0.0, 1.0)


def measures_of(metrics: Sequence[Metric]) -> dict[str, Measure]:
    """All measures that are made of metrics.

    Args:
        metrics: Of one report.

    Returns:
        By name, in the order of `columns.ORDER`.
    """
    found = [Measure(metric=metric, mean=mean) for metric in metrics for mean in metric.means]
    return {m.name: m for m in sorted(found, key=lambda m: place(m.name, m.metric.name))}


MEASURES = measures_of(METRICS)
"""What is averaged in a report with all metrics of the project. `completion_time` is over arrivals, `..._success` over
successes alone, `time_under_way` over everybody who spawned, time-outs censored. `intrusion_share` weighs agents
equally, `intrusion_share_of_steps` weighs active steps equally. `minimum_time_to_collision` is over agents that were
ever on collision course, `largest_...` over agents with a collision."""

WEIGHTS = {name: measure.mean.weight for name, measure in MEASURES.items() if measure.mean.weight}
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


def summarise(agents: pa.Table, measures: Mapping[str, Measure] = MEASURES) -> list[Estimate]:
    """Every measure of every controller in every scenario.

    Args:
        agents: Columns of `agents.agents_schema`.
        measures: Of the same metrics.

    Returns:
        In the table's order of controllers and scenarios, then in the order of the measures.
    """
    return [
        estimate(values, weights, draws, labels={**labels, "measure": name}, share=measure.is_share)
        for labels, columns, draws in groups(agents)
        for name, measure in measures.items()
        for values, weights in [measured(columns, measure)]
    ]


def estimate(
    values: Array, weights: Array, draws: NDArray[np.int64], *, labels: dict[str, str], share: bool = False
) -> Estimate:
    """Mean with its uncertainty, clustered by draw; the interval is `intervals.interval_of` the draws' means.

    Args:
        values: One for each agent, shape (n,); NaN where it has none.
        weights: Of the agents within their draw, shape (n,), >= 0.
        draws: Draw of each agent, shape (n,).
        labels: The descriptive fields of the Estimate.
        share: Whether the mean is a share in [0, 1].

    Returns:
        The estimate.
    """
    _, means = draw_means(values, weights, draws)
    n_agents = int(_defined(values, weights).sum())
    interval = interval_of(means[:, None], agents=n_agents if share else None)
    several = interval.n_draws >= 2
    return Estimate(
        **labels,
        mean=interval.mean,
        standard_error=float(means.std(ddof=1) / np.sqrt(len(means))) if several else float("nan"),
        low=interval.low,
        high=interval.high,
        n_draws=interval.n_draws,
        n_agents=n_agents,
        note=interval.note,
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
    names = (DATASET, VARIANT, SCENARIO, CONTROLLER)
    keys = list(zip(*(table[name].to_pylist() for name in names), strict=True))
    rows: dict[tuple[str, ...], list[int]] = {}
    for row, key in enumerate(keys):
        rows.setdefault(key, []).append(row)
    for key, chosen in rows.items():
        part = table.take(chosen)
        columns = {name: part[name].to_numpy() for name in part.column_names}
        yield dict(zip(names, key, strict=True)), columns, columns[DRAW]


def measured(columns: Columns, measure: Measure) -> tuple[Array, Array]:
    """A measure of every agent, and the agent's weight within its draw.

    Args:
        columns: Of some agents.
        measure: Of a metric that they have.

    Returns:
        Both of shape (n,); the value is NaN where there is none.
    """
    values = np.asarray(measure(columns), dtype=float)
    weight = measure.mean.weight
    return values, columns[weight].astype(float) if weight else np.ones_like(values)
