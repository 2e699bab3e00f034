"""Success against nearness to people and against time: who is on the front."""

from pathlib import Path
from typing import Any

import numpy as np
import textalloc
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import ArrayLike

from socialnav_mj.geometry import Array
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.leaderboard.board import Board
from socialnav_mj.studies.looks import LINES, looks_of, short_title

_AXES = (
    ("intrusion_share_of_steps", "share of steps within 1.2 m, logarithmic"),
    ("time_under_way", "time under way [s], censored, logarithmic"),
)
_MOST = 0.998
"""Success is drawn up to here: on a logit scale 1 is infinitely far."""
_SUCCESSES = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
_TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 5, 7, 10, 12, 15, 20, 30, 50)


def draw_fronts(board: Board, folder: Path, name: str) -> list[Path]:
    """A recording's scenarios side by side, success over both other measures; numbers name the controllers.

    Intervals of success are drawn in the upper row only, the human row's success is dotted, and the front is dashed.
    Success is on a logit scale: .98 is as far from .96 as .5 from .34, since the odds are halved.

    Args:
        board: Of the recording.
        folder: Gets a PNG and an SVG.
        name: Of these.

    Returns:
        Paths of the files.
    """
    with style():
        figure = new_figure(1.6 + 2.6 * len(_AXES))
        grid = figure.subplots(len(_AXES), len(board.scenarios), sharey=True, squeeze=False)
        for number, ((measure, label), row) in enumerate(zip(_AXES, grid, strict=True)):
            for place, (scenario, axes) in enumerate(zip(board.scenarios, row, strict=True)):
                _draw(axes, board, scenario, measure, with_intervals=number == 0)
                if number == 0:
                    axes.set_title(short_title(scenario, place))
            row[0].set_xlabel(label, loc="left")
            row[0].set_ylabel("share of agents that succeed, logit scale")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4, title=board.title)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # places are settled: what is written beside the points stays there
        for (measure, _), row in zip(_AXES, grid, strict=True):
            for scenario, axes in zip(board.scenarios, row, strict=True):
                _number(axes, board, scenario, measure)
        return save(figure, folder, name)


def _draw(axes: Axes, board: Board, scenario: str, measure: str, *, with_intervals: bool) -> None:
    looks = looks_of(board.controllers)
    x, success = _points(board, scenario, measure)
    for k, name in enumerate(board.controllers):
        axes.plot(
            x[k],
            success[k],
            linestyle="",
            color=looks[name].colour,
            marker=looks[name].marker,
            markeredgecolor="black",
            markeredgewidth=0.4,
            label=f"{k + 1} {name}",
        )
        level = board.table.find(scenario, name, "success")
        if with_intervals and level is not None and np.isfinite([level.interval.low, level.interval.high]).all():
            ends = _within([level.interval.low, level.interval.high])
            reach: dict[str, Any] = {
                "color": looks[name].colour,
                "marker": "_",
                "markersize": 3.0,
                "linewidth": 0.9,
                "zorder": 1,
            }
            axes.plot([x[k], x[k]], ends, **reach)
    front = board.front(scenario, measure)
    axes.plot(x[front], success[front], color="#999999", linewidth=0.8, linestyle=LINES[1], zorder=0)
    human = board.table.find(scenario, HUMAN, "success")
    if human is not None:
        axes.axhline(human.interval.mean, color="black", linewidth=0.8, linestyle=":")
    axes.set_yscale("logit")
    axes.set_ylim(min(0.25, 0.9 * success.min()), 0.9982)
    axes.set_xscale("log")
    for axis, ticks in ((axes.xaxis, _TICKS), (axes.yaxis, _SUCCESSES)):
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    axes.grid(visible=True, axis="both")


def _number(axes: Axes, board: Board, scenario: str, measure: str) -> None:
    """Write the controllers' numbers beside their points, none over another or over a point."""
    x, success = _points(board, scenario, measure)
    textalloc.allocate(
        axes,
        x,
        success,
        [str(k + 1) for k in range(len(x))],
        x_scatter=x,
        y_scatter=success,
        textsize=6.5,
        linecolor="#888888",
        linewidth=0.5,
        min_distance=0.03,
        max_distance=0.3,
        avoid_label_lines_overlap=True,
    )


def _points(board: Board, scenario: str, measure: str) -> tuple[Array, Array]:
    """The measure and success of every controller, (k,) and (k,), as they are drawn: 0 is left of all others."""
    count = len(board.controllers)
    x, success = (np.array([board.mean(scenario, k, m) for k in range(count)]) for m in (measure, "success"))
    least = x[x > 0.0].min(initial=np.inf)
    return np.maximum(x, 0.5 * least if np.isfinite(least) else _TICKS[0]), _within(success)


def _within(success: ArrayLike) -> Array:
    return np.clip(success, 1.0 - _MOST, _MOST)
