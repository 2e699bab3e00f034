"""Which controllers of a table cannot be told apart from its best one."""

import math
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from socialnav_mj.metrics.metric import Better
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES, Measure, draw_means, groups, measured
from socialnav_mj.report.intervals import LEAST, interval_of
from socialnav_mj.report.paired import HUMAN

Place = tuple[str, str, str]
"""Dataset, variant, scenario."""


@dataclass(frozen=True, kw_only=True)
class Standing:
    """Who is best in a measure, and who is not told apart from it."""

    best: str
    ties: frozenset[str]
    """Without the best one."""


def standings(agents: pa.Table) -> dict[tuple[Place, str], Standing]:
    """Best controllers and ties of every measure that speaks for a controller.

    Controllers drove the same agents, so that they are compared draw by draw: one is tied with the best where the 95 %
    interval of their difference covers 0, each comparison by itself. The recorded people take no part.

    Args:
        agents: Columns of `agents.SCHEMA`.

    Returns:
        By place and measure; none where fewer than two controllers share `intervals.LEAST` draws with the best.
    """
    found: dict[Place, dict[str, dict[str, dict[int, float]]]] = {}
    for labels, columns, draws in groups(agents):
        if labels[col.CONTROLLER] == HUMAN:
            continue
        place = (labels[col.DATASET], labels[col.VARIANT], labels[col.SCENARIO])
        for name, measure in MEASURES.items():
            if measure.metric.better is not Better.NEITHER:
                days, means = draw_means(*measured(columns, measure), draws)
                own = dict(zip(days.tolist(), means.tolist(), strict=True))
                found.setdefault(place, {}).setdefault(name, {})[labels[col.CONTROLLER]] = own
    result = {}
    for place, by_measure in found.items():
        for name, means_of in by_measure.items():
            if (standing := _standing(means_of, MEASURES[name])) is not None:
                result[place, name] = standing
    return result


def _standing(means: dict[str, dict[int, float]], measure: Measure) -> Standing | None:
    sign = 1.0 if measure.metric.better is Better.MORE else -1.0
    averages = {name: sum(own.values()) / len(own) for name, own in means.items() if own}
    if not averages:
        return None
    best = max(averages, key=lambda name: sign * averages[name])
    ties, compared = set(), 0
    for name in averages.keys() - {best}:
        shared = sorted(means[name].keys() & means[best].keys())
        if len(shared) < LEAST:
            continue
        compared += 1
        differences = [means[best][draw] - means[name][draw] for draw in shared]
        interval = interval_of(np.array(differences)[:, None])
        if interval.mean == 0.0 if math.isnan(interval.low) else interval.low <= 0.0 <= interval.high:
            ties.add(name)
    return Standing(best=best, ties=frozenset(ties)) if compared else None
