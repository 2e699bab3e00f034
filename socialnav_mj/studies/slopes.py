"""Slope charts: a line for each controller over the conditions, a column for each scenario, a row for each measure."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import isotonic_regression

from socialnav_mj.geometry import Array
from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.conditions import Comparison
from socialnav_mj.studies.looks import looks_of, short_title

_BESIDE = 0.1
"""By which the outermost lines are moved to either side, as a share of the way between two conditions."""
_FOR_NUMBERS = 0.6
"""Room to the right of the lines for their numbers, in ways between two conditions."""
_BEFORE, _FOR_NAMES, _TO_NAMES = 0.1, 0.7, 0.1
"""Room before the lines, the same for names, and where these begin in it: shares of the way from first to last."""


def draw_slopes(comparison: Comparison, rows: Sequence[tuple[str, str]], folder: Path, name: str) -> list[Path]:
    """Means with 95 % intervals over the conditions, of all measures and scenarios; lines are numbered.

    Args:
        comparison: Of one recording.
        rows: Measure and the label of its axis, from top to bottom.
        folder: Gets a PNG and an SVG.
        name: Of the files.

    Returns:
        Paths of the files.
    """
    scenarios, last = comparison.scenarios, len(comparison.conditions) - 1
    with style():
        figure = new_figure(1.7 + 1.9 * len(rows))
        grid = figure.subplots(len(rows), len(scenarios), sharex=True, sharey="row", squeeze=False)
        for place, scenario in enumerate(scenarios):
            grid[0][place].set_title(short_title(scenario, place))
        for (measure, label), line in zip(rows, grid, strict=True):
            ends = [_draw_lines(axes, comparison, s, measure) for s, axes in zip(scenarios, line, strict=True)]
            for axes, own in zip(line, ends, strict=True):
                axes.set_xlim(-0.4, last + _FOR_NUMBERS)
                _label_lines(axes, own, [str(k + 1) for k in range(len(own))], x=1.0, align="right", size=5.5)
            line[0].set_ylabel(label)
        handles, labels = grid[0][0].get_legend_handles_labels()
        numbered = [f"{k + 1} {label}" for k, label in enumerate(labels)]
        figure.legend(handles, numbered, title=comparison.recording, loc="outside upper center", ncols=4)
        return save(figure, folder, name)


def draw_overview(comparison: Comparison, measure: str, label: str, folder: Path, name: str) -> list[Path]:
    """One measure in the first and the last scenario, with each controller's name at its line: for a talk.

    Args:
        comparison: Of one recording.
        measure: Of its measures.
        label: Of the axis.
        folder: Gets a PNG and an SVG.
        name: Of the files.

    Returns:
        Paths of the files.
    """
    scenarios, last = dict.fromkeys((comparison.scenarios[0], comparison.scenarios[-1])), len(comparison.conditions) - 1
    with style():
        figure = new_figure(3.6)
        grid = figure.subplots(1, len(scenarios), sharey=True, squeeze=False)[0]
        ends = [_draw_lines(axes, comparison, s, measure) for s, axes in zip(scenarios, grid, strict=True)]
        for place, (scenario, axes, own) in enumerate(zip(scenarios, grid, ends, strict=True)):
            axes.set_title(short_title(scenario, place))
            axes.set_xlim(-_BEFORE * last, (1.0 + _FOR_NAMES) * last)
            beside = (_BEFORE + 1.0 + _TO_NAMES) / (_BEFORE + 1.0 + _FOR_NAMES)
            _label_lines(axes, own, list(comparison.controllers), x=beside, align="left", size=7.0)
        grid[0].set_ylabel(label)
        return save(figure, folder, name)


def spread_apart(values: Array, gap: float, *, low: float, high: float) -> Array:
    """Places as near to the values as can be, by squares, and so far from each other that labels do not overlap.

    Args:
        values: Shape (k,), one or more.
        gap: Least distance of two places.
        low: Lowest place.
        high: Highest place, if all have room below.

    Returns:
        Shape (k,), in the order of the values.
    """
    order = np.argsort(values, kind="stable")
    steps = gap * np.arange(len(values))
    places = np.empty(len(values))
    # With bounds, the nearest are those without, cut off at them.
    free = isotonic_regression(values[order] - steps).x
    places[order] = np.clip(free, low, max(low, high - steps[-1])) + steps
    return places


def _draw_lines(axes: Axes, comparison: Comparison, scenario: str, measure: str) -> Array:
    """Draw a line for each controller; where they end, shape (n_controllers, 2), NaN for who has no value."""
    conditions, n = comparison.conditions, len(comparison.controllers)
    places = np.arange(len(conditions))
    beside = _BESIDE * np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1)
    ends = np.full((n, 2), np.nan)
    looks = looks_of(comparison.controllers)
    for k, controller in enumerate(comparison.controllers):
        found = [comparison.level(scenario, controller, condition, measure) for condition in conditions]
        values = np.array(
            [(np.nan,) * 3 if f is None else (f.interval.mean, f.interval.low, f.interval.high) for f in found]
        )
        axes.errorbar(
            places + beside[k],
            values[:, 0],
            yerr=np.maximum(np.nan_to_num(np.abs(values[:, 1:] - values[:, :1])), 0.0).T,
            color=looks[controller].colour,
            marker=looks[controller].marker,
            linestyle=looks[controller].line,
            markersize=3.2,
            linewidth=0.9,
            elinewidth=0.5,
            capsize=1.0,
            label=controller,
        )
        ends[k] = places[-1] + beside[k], values[-1, 0]
    axes.set_xticks(places, [condition.name for condition in conditions])
    return ends


def _label_lines(axes: Axes, ends: Array, labels: Sequence[str], *, x: float, align: str, size: float) -> None:
    """Write what each line is called beside its end, at `x` of the axes' width, and lead to it from there."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high)
    there = np.flatnonzero(np.isfinite(ends[:, 1]))
    if not there.size:
        return
    height = axes.get_window_extent().height / axes.figure.dpi * 72.0
    heights = spread_apart((ends[there, 1] - low) / (high - low), 1.25 * size / height, low=0.02, high=0.98)
    for k, y in zip(there, heights, strict=True):
        axes.annotate(
            labels[int(k)],
            ends[k],
            xytext=(x, y),
            textcoords="axes fraction",
            ha=align,
            va="center",
            fontsize=size,
            arrowprops={
                "arrowstyle": "-",
                "linewidth": 0.3,
                "color": "0.6",
                "shrinkA": 1.0,
                "shrinkB": 1.5,
                "relpos": (0.0, 0.5),
            },
        )
