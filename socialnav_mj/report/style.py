"""One look for all figures: told apart by colour, by hatch or marker, and in greyscale."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from socialnav_mj.files import written_whole

WIDTH = 7.2
"""Of every figure: a text width of two columns [inch]."""
DOTS_PER_INCH = 200
OUTLINE = withStroke(linewidth=2.4, foreground="white")
"""Behind dark lines that cross dark bars."""


_SETTINGS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that every machine sets the same text
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "errorbar.capsize": 2.5,
    "hatch.linewidth": 0.7,
    "svg.fonttype": "none",  # text stays text: it can be searched and read aloud
    "svg.hashsalt": "socialnav_mj",
}


@contextmanager
def style() -> Iterator[None]:
    """Settings of all figures, for as long as the block lasts."""
    with mpl.rc_context(_SETTINGS):
        yield


def new_figure(height: float) -> Figure:
    """An empty figure that belongs to no window system; to be made and drawn inside `style`.

    Args:
        height: [inch].

    Returns:
        A figure of the common width.
    """
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG, each whole; equal figures give equal bytes.

    Args:
        figure: To be written.
        folder: Where to.
        name: Without ending.

    Returns:
        Paths of the two files.
    """
    paths = []
    for ending, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
        path = folder / f"{name}.{ending}"
        with written_whole(path) as part:
            figure.savefig(part, dpi=DOTS_PER_INCH, metadata=metadata)
        paths.append(path)
    return paths
