"""Figure 8: success of every method in every setting and scenario."""

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill

import numpy as np

from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.levels import LevelTable
from socialnav_mj.studies.looks import LOOKS, short_title
from socialnav_mj.studies.panel import METHODS

_TITLE_WIDTH = 24
"""Characters of a line of a setting's title: longer ones would leave the panels no room."""


def draw_variants(tables: Mapping[str, LevelTable], titles: Mapping[str, str], folder: Path) -> list[Path]:
    """A sub-figure for each scenario, a line for each setting, the default on top.

    Args:
        tables: Setting: its levels; the default first.
        titles: Setting: what it changes.
        folder: Gets a PNG and an SVG.

    Returns:
        Paths of the files.
    """
    names = list(tables)
    scenarios = tables[names[0]].scenarios
    with style():
        figure = new_figure(1.0 + 0.36 * len(names))
        row = figure.subplots(1, len(scenarios), sharex=True, sharey=True, squeeze=False)[0]
        for place, (scenario, axes) in enumerate(zip(scenarios, row, strict=True)):
            for k, method in enumerate(METHODS):
                look = LOOKS[method]
                found = [tables[name].find(scenario, method, "success") for name in names]
                lines = [(y, level.interval) for y, level in enumerate(found) if level is not None]
                mean = np.array([interval.mean for _, interval in lines])
                ends = np.array([[interval.low, interval.high] for _, interval in lines]).reshape(-1, 2)
                axes.errorbar(
                    mean,
                    [y + 0.16 * (k - 2.0) for y, _ in lines],
                    xerr=np.maximum(np.nan_to_num([mean - ends[:, 0], ends[:, 1] - mean]), 0.0),
                    color=look.colour,
                    marker=look.marker,
                    linestyle="",
                    markeredgecolor="black",
                    markeredgewidth=0.5,
                    label=look.label,
                )
            axes.set_title(short_title(scenario, place))
            axes.set_xlabel("share of successes")
            axes.grid(visible=True, axis="x")
            axes.grid(visible=False, axis="y")
            for y in range(1, len(names)):
                axes.axhline(y - 0.5, color="#BBBBBB", linewidth=0.5)
        row[0].set_yticks(range(len(names)), [fill(titles[name], _TITLE_WIDTH) for name in names])
        row[0].set_ylim(len(names) - 0.5, -0.5)
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=5)
        return save(figure, folder, "figure_8_variants")
