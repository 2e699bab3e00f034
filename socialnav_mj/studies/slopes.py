"""Slope charts: a line for each controller over the conditions, a column for each scenario, a row for each measure."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.conditions import Comparison
from socialnav_mj.studies.looks import LINES, MARKERS, SHADES, short_title

_BESIDE = 0.05
"""By which neighbouring lines are moved apart, as a share of the way between two conditions."""


def draw_slopes(comparison: Comparison, rows: Sequence[tuple[str, str]], folder: Path, name: str) -> list[Path]:
    """Means with 95 % intervals over the conditions.

    Args:
        comparison: Of one recording.
        rows: Measure and the label of its axis, from top to bottom.
        folder: Gets a PNG and an SVG.
        name: Of the files.

    Returns:
        Paths of the files.
    """
    scenarios, conditions = comparison.scenarios, comparison.conditions
    places = np.arange(len(conditions))
    with style():
        figure = new_figure(1.7 + 1.9 * len(rows))
        grid = figure.subplots(len(rows), len(scenarios), sharex=True, sharey="row", squeeze=False)
        for number, ((measure, label), line) in enumerate(zip(rows, grid, strict=True)):
            for place, (scenario, axes) in enumerate(zip(scenarios, line, strict=True)):
                for k, controller in enumerate(comparison.controllers):
                    found = [comparison.level(scenario, controller, c, measure) for c in conditions]
                    ends = np.array(
                        [
                            (np.nan,) * 3 if f is None else (f.interval.mean, f.interval.low, f.interval.high)
                            for f in found
                        ]
                    )
                    reach = np.maximum(np.nan_to_num(np.abs(ends[:, 1:] - ends[:, :1])), 0.0).T
                    beside = _BESIDE * (k - 0.5 * (len(comparison.controllers) - 1)) / len(comparison.controllers)
                    axes.errorbar(
                        places + 4.0 * beside,
                        ends[:, 0],
                        yerr=reach,
                        color=SHADES[k % len(SHADES)],
                        marker=MARKERS[k // len(SHADES) % len(MARKERS)],
                        linestyle=LINES[k // len(SHADES) % len(LINES)],
                        markersize=3.2,
                        linewidth=0.9,
                        elinewidth=0.5,
                        capsize=1.0,
                        label=f"{k + 1} {controller}",
                    )
                    axes.annotate(
                        str(k + 1),
                        (places[-1] + 4.0 * beside, ends[-1, 0] if np.isfinite(ends[-1, 0]) else 0.0),
                        xytext=(4, -2),
                        textcoords="offset points",
                        fontsize=5.5,
                    )
                axes.set_xlim(-0.4, len(conditions) - 0.5)
                axes.set_xticks(places, [c.name for c in conditions])
                if number == 0:
                    title = short_title(scenario, place)
                    axes.set_title(f"{comparison.recording}, {title}" if place == 0 else title)
            line[0].set_ylabel(label)
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
        return save(figure, folder, name)
