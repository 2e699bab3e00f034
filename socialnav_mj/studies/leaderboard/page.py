"""README.md of the leaderboard."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from socialnav_mj.report.intervals import ONE_RECORDING
from socialnav_mj.report.markdown import table
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.cells import interval_cell, mean_cell
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.leaderboard.board import RANKED, Board
from socialnav_mj.studies.looks import SCENARIO_TITLES

_HOW_TO_READ = f"""\
Every controller drove the same agents among the same people. *Rank set*: the ranks that a controller can have; all \
rank sets of a table hold together in 95 % of studies, so that two whose sets overlap without a sure difference are \
tied, whatever their means. There is no single score: success, nearness to people and time are ranked apart, and a \
**bold** name is on the front of success and nearness: nobody has more success and fewer steps within 1.2 m at once. \
*Impact*: momentum of an agent's hardest collision. {ONE_RECORDING} Each recording is a task of its own; the last \
table says how ranks differ between them, which is all that is known of a recording that is not here.
"""


def leaderboard_page(boards: Sequence[Board], *, provenance: Mapping[str, Any]) -> str:
    """Text of the study's README.md.

    Args:
        boards: One for each recording.
        provenance: Command, experiment, recordings, runs.

    Returns:
        Markdown.
    """
    lines = ["# Leaderboard", "", f"Command: `{provenance['command']}`", "", _HOW_TO_READ]
    lines += ["![fronts](figures/fronts.png)", ""]
    for board in boards:
        lines += [f"## {board.recording}", ""]
        for scenario in board.scenarios:
            lines += [f"### {SCENARIO_TITLES.get(scenario, scenario)}", "", *_scenario(board, scenario), ""]
    lines += ["## Ranks over recordings and scenarios", "", *_over_all(boards), ""]
    return "\n".join([*lines, *traceability(provenance, provenance["recordings"])]) + "\n"


def _scenario(board: Board, scenario: str) -> list[str]:
    rows = []
    front = board.front(scenario, "intrusion_share_of_steps")
    for k in board.order(scenario):
        name = board.controllers[k]
        rows.append([f"**{name}**" if k in front else name, *_cells(board, scenario, board.controllers[k])])
        rows[-1] += [_set(board, scenario, measure, k) for measure in RANKED]
    rows.append([HUMAN, *_cells(board, scenario, HUMAN), *("-" for _ in RANKED)])
    heads = ["controller", "success", "steps within 1.2 m", "share of steps", "time, censored [s]"]
    heads += ["hit first by a pedestrian / agent", "timed out", "impact [N s]"]
    return table([*heads, "ranks: success", "ranks: share of steps", "ranks: time"], rows)


def _cells(board: Board, scenario: str, method: str) -> list[str]:
    def find(measure: str) -> Any:
        return board.table.find(scenario, method, measure)

    return [
        interval_cell(find("success")),
        mean_cell(find("intimate_intrusions"), 1),
        interval_cell(find("intrusion_share_of_steps")),
        mean_cell(find("time_under_way"), 1),
        f"{mean_cell(find('first_hit_pedestrian'), 3)} / {mean_cell(find('first_hit_agent'), 3)}",
        mean_cell(find("timed_out"), 3),
        mean_cell(find("largest_impact_impulse"), 1),
    ]


def _set(board: Board, scenario: str, measure: str, place: int) -> str:
    ranks = board.ranks[scenario, measure]
    low, high = int(ranks.lowest[place]), int(ranks.highest[place])
    return f"{low}" if low == high else f"{low}-{high}"


def _over_all(boards: Sequence[Board]) -> list[str]:
    """Least and greatest rank of each controller over all tasks, and its rank by mean in the middle."""
    rows = []
    for place, name in enumerate(boards[0].controllers):
        cells = []
        for measure, more in RANKED.items():
            found = [board.ranks[scenario, measure] for board in boards for scenario in board.scenarios]
            means = [
                [board.mean(scenario, k, measure) for k in range(len(board.controllers))]
                for board in boards
                for scenario in board.scenarios
            ]
            own = [1 + sum((v > each[place]) if more else (v < each[place]) for v in each) for each in means]
            sets = f"{min(int(r.lowest[place]) for r in found)}-{max(int(r.highest[place]) for r in found)}"
            first = float(np.mean([r.at_most[place, 0] for r in found]))
            cells.append(f"{np.median(own):g} ({sets}), first in {first:.0%}")
        rows.append([name, *cells])
    heads = [
        f"{what}: median rank (all rank sets), first in resampled draws"
        for what in ("success", "share of steps", "time")
    ]
    return table(["controller", *heads], rows)
