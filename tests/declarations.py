"""What the declaration of a metric promises, checked on an episode."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode
from socialnav_mj.metrics import Better, Kind, Metric
from socialnav_mj.metrics.missing import NEVER

TYPES = {Kind.FLAG: "b", Kind.COUNT: "if", Kind.NUMBER: "f", Kind.NAME: "i"}


def broken(metric: Metric, episode: Episode) -> list[str]:
    """Promises of a declaration that the metric's values do not keep: shape, type, missing values, range."""
    values = metric.function(episode)
    found = []
    if values.shape != (episode.n_agents,):
        return [f"{metric.name} has shape {values.shape}"]
    if values.dtype.kind not in TYPES[metric.kind] or values.dtype.itemsize != (1 if metric.kind is Kind.FLAG else 8):
        found.append(f"{metric.name} is {metric.kind} and has type {values.dtype}")
    missing = metric.missing.where(episode)
    if not np.array_equal(np.isnan(values), missing):
        found.append(f"{metric.name} is {values}; NaN is promised for {missing} ({metric.missing.rule})")
    there = values[~np.isnan(values)].astype(float)
    if np.isinf(there).any() and not metric.infinite:
        found.append(f"{metric.name} is {values} and must be finite")
    finite = there[np.isfinite(there)]
    low, high = metric.limits
    if np.any(finite < low - 1e-12) or np.any(finite > high + 1e-12):
        found.append(f"{metric.name} is {values}; allowed: {low} to {high}")
    if metric.kind is Kind.COUNT and np.any(finite != np.round(finite)):
        found.append(f"{metric.name} is {values}; allowed: whole numbers")
    if metric.kind is Kind.NAME and not set(finite) <= {-1, *metric.names}:
        found.append(f"{metric.name} is {values}; allowed: -1 or one of {dict(metric.names)}")
    return found


def constant(episode: Episode, value: Any) -> NDArray[Any]:
    """The same for every agent."""
    return np.full(episode.n_agents, value)


def comfort(**changes: Any) -> Metric:
    """A metric of a user: 0.25 for every agent."""
    given = {"name": "comfort", "function": partial(constant, value=0.25), "formula": "made up", "missing": NEVER}
    return Metric(**{**given, "better": Better.MORE, "unit": "m", "low": 0.0, "high": 1.0, **changes})
