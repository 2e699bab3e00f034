"""README.md of the leaderboard."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from socialnav_mj.report.intervals import ONE_RECORDING
from socialnav_mj.report.markdown import code, head, interval, marked_row, number, plain, table
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.cells import interval_cell, mean_cell
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.leaderboard.board import RANKED, Board
from socialnav_mj.studies.leaderboard.families import Family, compare, there, verdict
from socialnav_mj.studies.leaderboard.marks import FAIR_SUCCESS, HIGH_SUCCESS
from socialnav_mj.studies.leaderboard.row_origins import RowOrigin
from socialnav_mj.studies.looks import SCENARIO_TITLES
from socialnav_mj.studies.settings import DEFAULT

_FIGURE = (
    "Success on a logit scale, on which equal distances are equal ratios of the odds; bars: its 95 % intervals; "
    "dashed: who is on the front; dotted: recorded people."
)
_HOW_TO_READ = f"""\
Every controller drove the same agents among the same people. *Rank set*: the ranks that a controller can have; all \
rank sets of a table hold together in 95 % of studies, so that two whose sets overlap without a sure difference are \
tied, whatever their means. There is no single score: success, nearness to people and time are ranked apart, and a \
**bold** name is on the front of success and nearness: nobody has more success and fewer steps within 1.2 m at once. \
*Hits on people* are counted for 100 agents, by who moved into whom: the agent alone, both, the person alone. \
*Impact*: momentum of an agent's hardest collision. *Cost*: CPU time for an agent and step over that of the physics. \
tables/leaderboard.csv has the distance to the recorded people as well, and how often each has a rank of at most 1, \
3 or 5 in resampled draws; tables/pairs.csv the probability of improvement of each pair. \
{ONE_RECORDING} Each recording is a task of its own; the last \
table says how ranks differ between them, which is all that is known of a recording that is not here.
"""
_FAMILIES = """\
Each controller that chooses among others beside all of its parts and the paper's 2 m switch: difference of success \
and of the share of steps within 1.2 m, child minus parent, by scenario; **bold** where the two are distinguishable, \
all pairs of the table together. The verdict is *success* or *nearness* if the child is distinguishably better there \
than every other, *front* if it is better than each of them in one of the two and worse in neither, else *no*."""


def leaderboard_page(
    boards: Sequence[Board],
    *,
    families: Sequence[Family],
    costs: Mapping[str, float],
    origins: Sequence[RowOrigin],
    provenance: Mapping[str, Any],
) -> str:
    """Text of the study's README.md.

    Args:
        boards: One for each recording and setting.
        families: Controllers that choose among others.
        costs: CPU time of a controller over that of the physics, by its name on the board.
        origins: Of all rows.
        provenance: Command, experiment, recordings, runs.

    Returns:
        Markdown.
    """
    lines = ["# Leaderboard", "", f"Command: `{provenance['command']}`", "", _HOW_TO_READ, *_counted(boards), ""]
    lines += [_picture(boards[0]), "", _FIGURE, ""]
    if any(board.marks for board in boards):
        lines += ["## Marks", "", *_marks(boards), ""]
    if families:
        lines += ["## Is a mixture better than its best part?", "", *_families(boards, families), ""]
    for board in boards:
        lines += [f"## {board.title}", "", *([] if board is boards[0] else [_picture(board), ""])]
        for scenario in board.scenarios:
            heading = SCENARIO_TITLES.get(scenario, scenario)
            lines += [f"### {heading}", "", *_scenario(board, scenario, costs), ""]
    lines += ["## Ranks over recordings and scenarios", "", *_over_all(boards), ""]
    lines += ["## A row by itself", "", *_origins(origins), ""]
    return "\n".join([*lines, *traceability(provenance, provenance["recordings"])]) + "\n"


def figure_of(board: Board) -> str:
    """Name of the figure of a board, without folder and ending.

    Args:
        board: The board.

    Returns:
        After its recording and setting.
    """
    return f"fronts_{board.recording}" + ("" if board.setting == DEFAULT else f"_{board.setting}")


def _picture(board: Board) -> str:
    return f"![fronts of {board.title}](figures/{figure_of(board)}.png)"


def _counted(boards: Sequence[Board]) -> list[str]:
    """How many draws and trainings stand behind each board."""
    rows = []
    for board in boards:
        own = [level for level in board.table.rows if level.measure == "success"]
        several = {level.method: level.interval.n_trainings for level in own if level.interval.n_trainings > 1}
        draws = max(level.interval.n_draws for level in own)
        rows.append([board.title, str(draws), ", ".join(f"{name}: {n}" for name, n in several.items()) or "-"])
    return [
        *table(["board", "draws", "several trainings"], rows),
        "",
        "What is said of controllers with several trainings is said of other trainings too; of others, of the one "
        "that ran.",
    ]


def _marks(boards: Sequence[Board]) -> list[str]:
    lines = [
        f"*Strong*: success of at least {HIGH_SUCCESS} in every scenario, and surely (paired intervals of 95 %) fewer "
        "steps within 1.2 m than ReplayIRL and less time than the paper's potential field in every scenario. *Calm*: "
        f"success of at least {FAIR_SUCCESS}, and surely at most half of ReplayIRL's steps, in every scenario. "
        "Numbers: success, and steps for each agent minus ReplayIRL's with their interval, by scenario.",
        "",
    ]
    for board in boards:
        rows = []
        for name in dict.fromkeys(mark.controller for mark in board.marks):
            own = [mark for mark in board.marks if mark.controller == name]
            held = {"strong": all(m.is_strong for m in own), "calm": all(m.is_calm for m in own)}
            words = [word for word, holds in held.items() if holds]
            rows.append(
                [
                    name,
                    ", ".join(words) or "-",
                    " / ".join(number(m.success.mean, 3) for m in own),
                    " / ".join(interval(m.steps.mean, m.steps.low, m.steps.high, 1, "+") for m in own),
                    " / ".join(interval(m.time.mean, m.time.low, m.time.high, 1, "+") for m in own),
                ]
            )
        heads = ["controller", "marks", "success", "steps - ReplayIRL's", "time - potential field's [s]"]
        lines += [f"{board.title}:", "", *table(heads, rows), ""] if rows else []
    return lines


def _families(boards: Sequence[Board], families: Sequence[Family]) -> list[str]:
    lines = [_FAMILIES, ""]
    for board in boards:
        rows = []
        for family in there(families, board):
            verdicts = " / ".join(verdict(board, family, scenario) for scenario in board.scenarios)
            found = compare(board, family)
            for parent in family.parents:
                own = [row for row in found if row["parent"] == parent]
                cells = [
                    " / ".join(_difference(row) for row in own if row["measure"] == measure)
                    for measure in ("success", "intrusion_share_of_steps")
                ]
                rows.append([family.child, parent, *cells, verdicts])
        heads = ["controller", "part", "success", "share of steps", "verdict by scenario"]
        lines += [f"{board.title}:", "", *table(heads, rows), ""] if rows else []
    missing = {name: family.child for family in families for name in family.missing}
    lines += [f"Not on the board: {name}, a part of {child}." for name, child in missing.items()]
    return lines


def _difference(row: Mapping[str, Any]) -> str:
    text = f"{row['difference']:+.3f}"
    return f"**{text}**" if row["verdict"] else text


def _scenario(board: Board, scenario: str, costs: Mapping[str, float]) -> list[str]:
    rows = []
    front = board.front(scenario, "intrusion_share_of_steps")
    for k in board.order(scenario):
        name = board.controllers[k]
        rows.append([f"**{name}**" if k in front else name, *_cells(board, scenario, board.controllers[k])])
        rows[-1] += [_set(board, scenario, measure, k) for measure in RANKED]
        rows[-1] += [number(costs.get(board.controllers[k], float("nan")), 2)] if costs else []
    rows.append([HUMAN, *_cells(board, scenario, HUMAN), *("-" for _ in RANKED), *(["-"] if costs else [])])
    heads = ["controller", "success", "steps within 1.2 m", "share of steps", "time, censored [s]"]
    heads += ["first collision with a pedestrian / agent", "hits on people: agent / both / person"]
    heads += ["imposed braking [steps]", "timed out", "impact [N s]"]
    heads += ["ranks: success", "ranks: share of steps", "ranks: time"]
    return table([*heads, "cost"] if costs else heads, rows)


def _cells(board: Board, scenario: str, method: str) -> list[str]:
    def find(measure: str) -> Any:
        return board.table.find(scenario, method, measure)

    return [
        interval_cell(find("success")),
        mean_cell(find("intimate_intrusions"), 1),
        interval_cell(find("intrusion_share_of_steps")),
        mean_cell(find("time_under_way"), 1),
        f"{mean_cell(find('first_hit_pedestrian'), 3)} / {mean_cell(find('first_hit_agent'), 3)}",
        " / ".join(_hundred(find(f"collisions_pedestrian_by_{who}")) for who in ("agent", "both", "partner")),
        mean_cell(find("braking_imposed"), 1),
        mean_cell(find("timed_out"), 3),
        mean_cell(find("largest_impact_impulse"), 1),
    ]


def _hundred(level: Any) -> str:
    return "-" if level is None else number(100.0 * level.interval.mean, 1)


def _set(board: Board, scenario: str, measure: str, place: int) -> str:
    ranks = board.ranks[scenario, measure]
    low, high = int(ranks.lowest[place]), int(ranks.highest[place])
    return f"{low}" if low == high else f"{low}-{high}"


def _origins(origins: Sequence[RowOrigin]) -> list[str]:
    rows = [
        [
            plain(origin.run),
            plain(origin.controller),
            code(origin.command),
            " / ".join(digest[:12] for digest in origin.digests),
        ]
        for origin in origins
    ]
    return [
        "Each command writes the episodes of its row, a report, and a rerun trace of the first draw of each scenario "
        "(`socialnav-mj view`). *Hashes*: by scenario, the first digits of the sha256 of the episodes' state hashes, "
        "which the report says too.",
        "",
        *head(["board", "controller", "command", "hashes"]),
        *(marked_row(cells) for cells in rows),
    ]


def _over_all(boards: Sequence[Board]) -> list[str]:
    """Least and greatest rank of each controller over all tasks, and its rank by mean in the middle."""
    boards = [board for board in boards if board.setting == DEFAULT]
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
