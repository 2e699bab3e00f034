"""Figure of agents beside the people they replaced; controllers differ in colour, mark and lightness."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from socialnav_mj.report.estimates import Estimate
from socialnav_mj.report.intervals import LEAST
from socialnav_mj.report.style import new_figure, save, style

PANELS = (
    ("time", "time, censored [s]"),
    ("path_of_arrivals", "path of arrivals [m]"),
    ("intrusion_share", "share of steps within 1.2 m"),
    ("minimum_distance", "minimum distance [m]"),
)
"""Key of `paired.DIFFERENCES` and the axis' label."""

LEGEND_WIDTH = 120
"""Characters that fit beside each other; every entry has a mark and a margin, 8 wide."""
_MARKS = "osD^vPX<>*"
_COLOURS = ("#DDAA33", "#004488", "#BB5566", "#55AAAA", "#762A83", "#88BB44", "#000000")


def draw_paired(differences: Sequence[Estimate], folder: Path) -> list[Path]:
    """Draw the paired differences, one panel a measure, scenarios along x, zero being the person itself.

    Args:
        differences: Of `paired.paired_differences`.
        folder: Gets a PNG and an SVG, the same bytes for the same numbers.

    Returns:
        Their paths; none if there is no number.
    """
    shown = [e for e in differences if not math.isnan(e.mean)]
    if not shown:
        return []
    places = list(dict.fromkeys((e.dataset, e.variant, e.scenario) for e in shown))
    controllers = list(dict.fromkeys(e.controller for e in shown))
    with style():
        columns = max(1, min(5, len(controllers), LEGEND_WIDTH // (max(map(len, controllers)) + 8)))
        figure = new_figure(4.8 + 0.17 * math.ceil(len(controllers) / columns))
        for (measure, label), axes in zip(PANELS, figure.subplots(2, 2).flat, strict=True):
            _draw(axes, [e for e in shown if e.measure == measure], places, controllers)
            axes.set_ylabel(label)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        title = "Agents minus the people they replaced"  # above the legend: a title of the figure would lie under it
        figure.legend(handles, labels, loc="outside upper center", ncols=columns, title=title, title_fontsize=9.5)
        barred = any(not math.isnan(e.low) for e in shown)
        bars = "; bars: 95 % interval over draws" if barred else f"; no intervals for fewer than {LEAST} draws"
        figure.supxlabel(f"0: as the person itself{bars}", fontsize=8.0)
        return save(figure, folder, "paired_humans")


def _draw(axes: Any, shown: Sequence[Estimate], places: Sequence[tuple[str, ...]], controllers: Sequence[str]) -> None:
    several = len({place[:2] for place in places}) > 1
    names = [" ".join(place[::2]) if several else place[2] for place in places]
    axes.axhline(0.0, color="0.0", linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    for i, controller in enumerate(controllers):
        own = [e for e in shown if e.controller == controller]
        shift = 0.5 * (i - 0.5 * (len(controllers) - 1)) / max(1, len(controllers))
        x = [places.index((e.dataset, e.variant, e.scenario)) + shift for e in own]
        low = [0.0 if math.isnan(e.low) else e.mean - e.low for e in own]
        high = [0.0 if math.isnan(e.high) else e.high - e.mean for e in own]
        axes.errorbar(
            x,
            [e.mean for e in own],
            yerr=[low, high],
            fmt=_MARKS[i % len(_MARKS)],
            color=_COLOURS[i % len(_COLOURS)],
            markeredgecolor="0.0",
            linewidth=1.0,
            label=controller,
        )
    axes.set_xticks(range(len(places)), [name.replace("_", " ") for name in names])
    axes.set_xlim(-0.5, len(places) - 0.5)
