"""All metrics: what the modules of this folder declare as `METRICS`."""

import pkgutil
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from socialnav_mj.episode import Episode
from socialnav_mj.metrics.metric import Metric


def check_metrics(metrics: Sequence[Metric]) -> None:
    """Refuse metrics that cannot stand in one table.

    Args:
        metrics: All whose columns and means go into the same tables.

    Raises:
        ValueError: If two metrics or two means have the same name, or a weight is no metric.
    """
    names = [metric.name for metric in metrics]
    measures = [mean.name or metric.name for metric in metrics for mean in metric.means]
    for listed in (names, measures):
        if twice := sorted({name for name in listed if listed.count(name) > 1}):
            raise ValueError(f"{', '.join(twice)} declared more than once; allowed: names of their own")
    for metric in metrics:
        if unknown := {mean.weight for mean in metric.means} - {"", *names}:
            raise ValueError(f"{metric.name} is weighted by {sorted(unknown)}; available: {', '.join(names)}")


def _declared() -> tuple[Metric, ...]:
    """Metrics of all modules beside this one, by the modules' names and then as they are declared."""
    here = __name__.rpartition(".")[0]
    modules = sorted(module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)]))
    metrics: list[Metric] = []
    for name in modules:
        if f"{here}.{name}" != __name__:
            metrics += getattr(import_module(f"{here}.{name}"), "METRICS", ())
    check_metrics(metrics)
    return tuple(metrics)


METRICS = _declared()
"""Every metric of the project. Tables have an order of their own, see `report.columns`."""


def per_agent(episode: Episode, metrics: Sequence[Metric] = METRICS) -> dict[str, NDArray[Any]]:
    """Score every agent of an episode.

    Args:
        episode: Record of n agents.
        metrics: Those to compute; all of the project by default.

    Returns:
        Arrays of shape (n_agents,) by the metric's name; unit, range and NaN rule are the metric's.
    """
    return {metric.name: metric.function(episode) for metric in metrics}
