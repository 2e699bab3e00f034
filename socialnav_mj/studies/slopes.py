"""Slope charts: a panel for each controller, in which a line for each scenario leads from condition to condition."""

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.conditions import Comparison
from socialnav_mj.studies.looks import LINES, MARKERS, SCENARIO_TITLES, SHADES

ORDER_OF_PANELS = """\
In the figures controllers stand in the order of their mean success under the first condition; bars are 95 % intervals.\
"""
"""How pages explain these figures."""
_COLUMNS = 5
"""Panels side by side, at most."""
_BESIDE = 0.12
"""By which the outermost lines are moved to either side, as a share of the way between two conditions."""
_LETTERS_OF_A_TITLE = 24


def draw_slopes(comparison: Comparison, measure: str, label: str, folder: Path, name: str) -> list[Path]:
    """Means with 95 % intervals over the conditions, of all controllers and scenarios.

    Args:
        comparison: Of one recording.
        measure: Of its measures.
        label: Of the axis.
        folder: Gets a PNG and an SVG.
        name: Of the files.

    Returns:
        Paths of the files.
    """
    controllers = in_order(comparison)
    columns = min(_COLUMNS, len(controllers))
    rows = -(-len(controllers) // columns)
    with style():
        figure = new_figure(0.9 + 1.1 * rows)
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, controller in zip(grid.flat, controllers, strict=False):
            _draw_panel(axes, comparison, controller, measure)
        for axes in grid.flat[len(controllers) :]:
            axes.set_axis_off()
        for k in range(len(controllers) - columns, len(controllers)):
            _name_conditions(grid.flat[k], comparison, with_room=k >= (rows - 1) * columns)
        figure.supylabel(label, fontsize="medium")
        handles, labels = grid[0][0].get_legend_handles_labels()
        look: dict[str, Any] = {"loc": "outside upper center", "ncols": 4, "fontsize": 7.0, "columnspacing": 1.2}
        figure.legend(handles, labels, title=comparison.recording, **look)
        return save(figure, folder, name)


def in_order(comparison: Comparison) -> tuple[str, ...]:
    """The order of the panels, which is the same in all figures of a recording.

    Args:
        comparison: Of one recording.

    Returns:
        Its controllers by the mean over scenarios of the first measure under the first condition, highest first; those
        that have none are last.
    """
    first, measure = comparison.conditions[0], comparison.measures[0]

    def mean(controller: str) -> float:
        found = [comparison.level(scenario, controller, first, measure) for scenario in comparison.scenarios]
        return float(np.mean([level.interval.mean for level in found if level is not None] or [-np.inf]))

    return tuple(sorted(comparison.controllers, key=mean, reverse=True))


def _draw_panel(axes: Axes, comparison: Comparison, controller: str, measure: str) -> None:
    scenarios, places = comparison.scenarios, np.arange(len(comparison.conditions))
    for k, scenario in enumerate(scenarios):
        found = [comparison.level(scenario, controller, condition, measure) for condition in comparison.conditions]
        means, lows, highs = np.array(
            [(np.nan,) * 3 if f is None else (f.interval.mean, f.interval.low, f.interval.high) for f in found]
        ).T
        axes.errorbar(
            places + _BESIDE * (2.0 * k / max(len(scenarios) - 1, 1) - 1.0),
            means,
            yerr=np.maximum(np.nan_to_num([means - lows, highs - means]), 0.0),
            color=SHADES[k % len(SHADES)],
            marker=MARKERS[k % len(MARKERS)],
            linestyle=LINES[k % len(LINES)],
            markersize=2.6,
            linewidth=0.9,
            elinewidth=0.5,
            capsize=1.0,
            label=SCENARIO_TITLES.get(scenario, scenario),
        )
    axes.set_title(fill(controller, _LETTERS_OF_A_TITLE), fontsize=7.0)
    axes.set_xlim(-0.35, places[-1] + 0.35)
    axes.set_xticks(places, [""] * len(places))
    axes.yaxis.set_major_locator(MaxNLocator(4, min_n_ticks=3, steps=[1, 2, 2.5, 5, 10]))
    axes.tick_params(labelsize=6.5)


def _name_conditions(axes: Axes, comparison: Comparison, *, with_room: bool) -> None:
    """Write the conditions below a panel; `with_room` says whether the next row of panels moves away for them."""
    for k, condition in enumerate(comparison.conditions):
        name = axes.annotate(
            condition.name,
            (k, 0.0),
            xytext=(2.0, -5.0),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            fontsize=6.5,
            ha="right",
            va="top",
            rotation=30.0,
            rotation_mode="anchor",
        )
        name.set_in_layout(with_room)
