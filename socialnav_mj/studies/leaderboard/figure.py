"""Success against nearness to people and against time: who is on the front."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.leaderboard.board import Board
from socialnav_mj.studies.looks import LINES, looks_of, short_title

_AXES = (
    ("intrusion_share_of_steps", "share of steps within 1.2 m"),
    ("time_under_way", "time under way [s], censored"),
)


def draw_fronts(boards: Sequence[Board], folder: Path) -> list[Path]:
    """The first recording's scenarios side by side, success over both other measures; numbers name the controllers.

    Args:
        boards: One for each recording; the first is drawn.
        folder: Gets a PNG and an SVG.

    Returns:
        Paths of the files.
    """
    board = boards[0]
    scenarios, looks = board.scenarios, looks_of(board.controllers)
    with style():
        figure = new_figure(1.6 + 2.1 * len(_AXES))
        grid = figure.subplots(len(_AXES), len(scenarios), sharex="row", sharey="col", squeeze=False)
        for number, ((measure, label), row) in enumerate(zip(_AXES, grid, strict=True)):
            for place, (scenario, axes) in enumerate(zip(scenarios, row, strict=True)):
                for k, name in enumerate(board.controllers):
                    axes.errorbar(
                        board.mean(scenario, k, measure),
                        board.mean(scenario, k, "success"),
                        yerr=_reach(board, scenario, name),
                        linestyle="",
                        color=looks[name].colour,
                        marker=looks[name].marker,
                        markeredgecolor="black",
                        markeredgewidth=0.4,
                        label=f"{k + 1} {name}",
                    )
                    axes.annotate(
                        str(k + 1),
                        (board.mean(scenario, k, measure), board.mean(scenario, k, "success")),
                        xytext=(4, 3),
                        textcoords="offset points",
                        fontsize=6.5,
                    )
                front = board.front(scenario, measure)
                points = np.array([[board.mean(scenario, k, m) for m in (measure, "success")] for k in front])
                axes.plot(*points.T, color="#999999", linewidth=0.8, linestyle=LINES[1], zorder=0)
                human = board.table.find(scenario, HUMAN, "success")
                if human is not None:
                    axes.axhline(human.interval.mean, color="black", linewidth=0.8, linestyle=":")
                if number == 0:
                    axes.set_title(
                        f"{board.recording}, {short_title(scenario, place)}"
                        if place == 0
                        else short_title(scenario, place)
                    )
                axes.grid(visible=True, axis="both")
            row[0].set_xlabel(label, loc="left")
            row[0].set_ylabel("share of agents that succeed")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
        return save(figure, folder, "fronts")


def _reach(board: Board, scenario: str, name: str) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    level = board.table.find(scenario, name, "success")
    if level is None:
        return np.zeros((2, 1))
    interval = level.interval
    return np.maximum(np.nan_to_num([[interval.mean - interval.low], [interval.high - interval.mean]]), 0.0)
