"""The paper's figures 1 to 5, and figure 6: the hybrid over its switch distance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.style import OUTLINE, new_figure, save, style
from socialnav_mj.studies.levels import Level, LevelTable
from socialnav_mj.studies.looks import LINES, LOOKS, MARKERS, SCENARIO_TITLES, SHADES, short_title
from socialnav_mj.studies.panel import COMMON, METHODS, MIXED, POTENTIAL_FIELD, REPLAY_IRL, ROBOTS

DOT: dict[str, Any] = {
    "linestyle": "",
    "marker": "o",
    "markersize": 3.2,
    "color": "white",
    "markeredgecolor": "black",
}
"""One training alone."""
BAND: dict[str, Any] = {"color": "#000000", "alpha": 0.12, "linewidth": 0.0}
"""The recorded people's interval."""
PAPER_DISTANCE = 2.0
"""Where the paper's mixed policy switches [m]."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A measure that a figure shows."""

    measure: str
    label: str
    """Of the axis, with its unit."""
    top: float | None = None
    """Upper end of the axis; by the data if None."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """One of the paper's figures."""

    name: str
    rows: tuple[Row, ...]
    bars: bool
    """One sub-figure with bars for each scenario, else lines over the scenarios."""


FIGURES: tuple[Drawing, ...] = (
    Drawing(
        name="figure_1_success",
        rows=(Row(measure="success", label="share of agents that succeed", top=1.0),),
        bars=True,
    ),
    Drawing(name="figure_2_speed", rows=(Row(measure="average_speed", label="average speed [m/s]"),), bars=False),
    Drawing(
        name="figure_3_distance_to_displacement",
        rows=(
            Row(measure=f"distance_to_displacement_success{COMMON}", label="path / displacement\nsame agents for all"),
            Row(measure="distance_to_displacement_success", label="path / displacement\nown successes"),
        ),
        bars=False,
    ),
    Drawing(
        name="figure_4_intrusions",
        rows=(
            Row(measure="intimate_intrusions", label="steps within 1.2 m\nper agent"),
            Row(measure="intrusion_share_of_steps", label="share of steps\nwithin 1.2 m"),
        ),
        bars=True,
    ),
    Drawing(
        name="figure_5_completion_time",
        rows=(
            Row(measure=f"completion_time_success{COMMON}", label="completion time [s]\nsame agents for all"),
            Row(measure="time_under_way", label="time under way [s]\nall agents, censored"),
        ),
        bars=True,
    ),
)


def draw_figures(table: LevelTable, folder: Path) -> list[Path]:
    """Draw the paper's figures 1 to 5 from the levels of the default setting.

    Args:
        table: Levels of the default setting.
        folder: Gets a PNG and an SVG of each.

    Returns:
        Paths of the files.
    """
    paths = []
    with style():
        for drawing in FIGURES:
            figure = _bars(table, drawing) if drawing.bars else _lines(table, drawing)
            paths += save(figure, folder, drawing.name)
    return paths


def draw_sweep(sweep: Mapping[float, LevelTable], table: LevelTable, folder: Path) -> list[Path]:
    """Draw figure 6: the hybrid over its switch distance, from the potential field (0) to ReplayIRL (infinity).

    Args:
        sweep: Switch distance [m]: levels of that run; the method of interest is `mixed`.
        table: Levels of the two pure methods.
        folder: Gets a PNG and an SVG.

    Returns:
        Paths of the files.
    """
    rows = (
        Row(measure="success", label="share of agents that succeed"),
        Row(measure="intrusion_share_of_steps", label="share of steps within 1.2 m"),
        Row(measure="time_under_way", label="time under way [s], censored"),
    )
    distances = sorted(sweep)
    end = distances[-1] + 1.0
    with style():
        figure = new_figure(2.9)
        for axes, row in zip(figure.subplots(1, len(rows)), rows, strict=True):
            for k, scenario in enumerate(table.scenarios):
                found = [
                    (0.0, table.find(scenario, POTENTIAL_FIELD, row.measure)),
                    *((d, sweep[d].find(scenario, MIXED, row.measure)) for d in distances),
                    (end, table.find(scenario, REPLAY_IRL, row.measure)),
                ]
                # Side by side, or the error bars of the scenarios would hide each other.
                shift = 0.05 * (k - 1.5)
                points = [(x + shift, level) for x, level in found if level is not None]
                look = {"color": SHADES[k % 4], "marker": MARKERS[k % 4], "linestyle": LINES[k % 4]}
                _error_bars(axes, points, label=SCENARIO_TITLES.get(scenario, scenario), **look)
            axes.axvline(PAPER_DISTANCE, color="#666666", linewidth=0.8)
            axes.annotate(
                f"the paper's {PAPER_DISTANCE:g} m",
                (PAPER_DISTANCE, 1.0),
                (0, 2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=7.0,
                color="#444444",
            )
            axes.set_ylabel(row.label)
            axes.set_xlabel("switch distance [m]")
            axes.set_xticks([0.0, *distances, end], ["PF", *(f"{d:g}" for d in distances), "IRL"], fontsize=6.5)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
        return save(figure, folder, "figure_6_switch_distance")


def _bars(table: LevelTable, drawing: Drawing) -> Figure:
    scenarios = table.scenarios
    figure = new_figure(0.9 + 1.75 * len(drawing.rows))
    grid = figure.subplots(len(drawing.rows), len(scenarios), sharey="row", squeeze=False)
    for line, (row, axes_row) in enumerate(zip(drawing.rows, grid, strict=True)):
        for place, (scenario, axes) in enumerate(zip(scenarios, axes_row, strict=True)):
            for x, method in enumerate(ROBOTS):
                _bar(axes, x, table, scenario, method, row.measure)
            _human_band(axes, table.find(scenario, HUMAN, row.measure))
            axes.set_xticks([])
            axes.set_xlim(-0.6, len(ROBOTS) - 0.4)
            if line == 0:
                axes.set_title(short_title(scenario, place))
        # After all panels: a limit set before would be the first one's.
        axes_row[0].set_ylim(0.0, row.top)
        axes_row[0].set_ylabel(row.label)
    _legend(figure, bars=True)
    return figure


def _bar(axes: Axes, x: int, table: LevelTable, scenario: str, method: str, measure: str) -> None:
    level = table.find(scenario, method, measure)
    if level is None or not np.isfinite(level.interval.mean):
        return
    look = LOOKS[method]
    axes.bar(x, level.interval.mean, width=0.8, color=look.colour, hatch=look.hatch, hatchcolor="white")
    axes.errorbar(
        x - 0.12,
        level.interval.mean,
        yerr=_reach(level),
        color="black",
        linewidth=1.1,
        zorder=4,
        path_effects=[OUTLINE],
    )
    trainings = table.trainings(method)
    for k, training in enumerate(trainings):
        single = table.find(scenario, method, measure, training)
        if single is not None:
            place = x + 0.05 + 0.3 * (k + 0.5) / len(trainings)
            axes.plot(place, single.interval.mean, zorder=6, **DOT)


def _human_band(axes: Axes, level: Level | None) -> None:
    if level is None or not np.isfinite(level.interval.mean):
        return
    look = LOOKS[HUMAN]
    axes.axhline(level.interval.mean, color="white", linewidth=2.4, zorder=4.5)
    axes.axhline(level.interval.mean, color=look.colour, linestyle=look.line, linewidth=1.2, zorder=5)
    if np.isfinite(level.interval.low):
        axes.axhspan(level.interval.low, level.interval.high, zorder=0.5, **BAND)


def _lines(table: LevelTable, drawing: Drawing) -> Figure:
    scenarios = table.scenarios
    figure = new_figure(2.9)
    grid = figure.subplots(1, len(drawing.rows), sharey=True, squeeze=False)[0]
    for axes, row in zip(grid, drawing.rows, strict=True):
        for k, method in enumerate(METHODS):
            found = [(x + 0.07 * (k - 2.0), table.find(s, method, row.measure)) for x, s in enumerate(scenarios)]
            points = [(x, level) for x, level in found if level is not None]
            look = LOOKS[method]
            _error_bars(axes, points, color=look.colour, marker=look.marker, linestyle=look.line)
        shares = [
            SCENARIO_TITLES.get(s, s).removeprefix("scenario ").removesuffix(" agents").replace(": ", "\n")
            for s in scenarios
        ]
        axes.set_xticks(range(len(scenarios)), shares)
        axes.set_xlim(-0.4, len(scenarios) - 0.6)
        axes.set_xlabel("scenario, share of people replaced by agents")
        axes.set_ylabel(row.label)
    _legend(figure, bars=False)
    return figure


def _error_bars(axes: Axes, points: Sequence[tuple[float, Level]], **look: Any) -> None:
    points = [(x, level) for x, level in points if np.isfinite(level.interval.mean)]
    if not points:
        return
    reach = np.concatenate([_reach(level) for _, level in points], axis=1)
    axes.errorbar(
        [x for x, _ in points],
        [level.interval.mean for _, level in points],
        yerr=reach,
        markeredgecolor="black",
        markeredgewidth=0.5,
        elinewidth=0.9,
        **look,
    )


def _reach(level: Level) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """How far the interval goes down and up, shape (2, 1); 0 where there is none."""
    mean = level.interval.mean
    ends = np.array([[mean - level.interval.low], [level.interval.high - mean]])
    return np.maximum(np.nan_to_num(ends), 0.0)


def _legend(figure: Figure, *, bars: bool) -> None:
    handles: list[Patch | Line2D] = []
    for method in METHODS:
        look = LOOKS[method]
        if bars and method != HUMAN:
            handles.append(Patch(facecolor=look.colour, hatch=look.hatch, hatchcolor="white", label=look.label))
        else:
            marker = "" if bars else look.marker
            handles.append(Line2D([], [], color=look.colour, linestyle=look.line, marker=marker, label=look.label))
    if bars:
        dot = Line2D([], [], **DOT)
        dot.set_label("each training")
        handles += [dot, Patch(label="human, 95 % interval", **BAND)]
    columns = len(handles) if len(handles) <= 6 else (len(handles) + 1) // 2
    figure.legend(handles=handles, loc="outside upper center", ncols=columns)
