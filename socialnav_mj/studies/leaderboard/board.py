"""One recording's leaderboard: levels of every controller, and their ranks in each scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.geometry import Array
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.leaderboard.marks import Mark, marks_of
from socialnav_mj.studies.leaderboard.ranks import Ranks, rank
from socialnav_mj.studies.levels import LevelTable, levels
from socialnav_mj.studies.panel import Entry, Panel, Term, make_panel
from socialnav_mj.studies.settings import DEFAULT, SETTINGS

RANKED = {"success": True, "intrusion_share_of_steps": False, "time_under_way": False}
"""Measure: whether more is better."""
MEASURES = (
    *RANKED,
    "intimate_intrusions",
    "first_hit_pedestrian",
    "first_hit_agent",
    "collisions_pedestrian_by_agent",
    "collisions_pedestrian_by_both",
    "collisions_pedestrian_by_partner",
    "braking_imposed",
    "timed_out",
    "average_speed",
    "struck_standing",
    "largest_impact_impulse",
)
"""What is told of every controller."""
AT_MOST = (1, 3, 5)
"""Ranks k for which tables have the share of resampled studies with a rank of at most k."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """Controllers side by side on one recording."""

    recording: str
    setting: str
    """Of `settings.SETTINGS`."""
    controllers: tuple[str, ...]
    table: LevelTable
    """Of the controllers under their names on the board, and the human row."""
    ranks: Mapping[tuple[str, str], Ranks]
    """Scenario and measure of `RANKED`: ranks in the order of the controllers."""
    marks: tuple[Mark, ...]
    """See `marks.marks_of`."""

    @property
    def title(self) -> str:
        """What it is called: recording, and setting if it is not the default one."""
        return self.recording if self.setting == DEFAULT else f"{self.recording}, {SETTINGS[self.setting].title}"

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Scenarios that were run."""
        return self.table.scenarios

    def order(self, scenario: str) -> list[int]:
        """Places of the controllers by falling success.

        Args:
            scenario: Name of a task.

        Returns:
            Indices.
        """
        return sorted(range(len(self.controllers)), key=lambda k: -self.mean(scenario, k, "success"))

    def mean(self, scenario: str, place: int, measure: str) -> float:
        """A controller's mean.

        Args:
            scenario: Name of a task.
            place: Index of the controller.
            measure: Of `MEASURES`.

        Returns:
            Over draws; NaN where there is none.
        """
        level = self.table.find(scenario, self.controllers[place], measure)
        return float("nan") if level is None else level.interval.mean

    def front(self, scenario: str, measure: str) -> list[int]:
        """Controllers that nobody beats in success and another measure at once, by falling success.

        Args:
            scenario: Name of a task.
            measure: Of which less is better.

        Returns:
            Indices.
        """
        found: list[int] = []
        # Of equal success the one that is better in the other measure comes first, and beats the rest.
        ordered = sorted(self.order(scenario), key=lambda k: self.mean(scenario, k, measure))
        for k in sorted(ordered, key=lambda k: -self.mean(scenario, k, "success")):
            if all(self.mean(scenario, k, measure) < self.mean(scenario, other, measure) for other in found):
                found.append(k)
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Every controller, scenario and measure as rows of a table."""
        rows = []
        for scenario in self.scenarios:
            for method in (*self.controllers, HUMAN):
                for measure in MEASURES:
                    level = self.table.find(scenario, method, measure)
                    if level is None:
                        continue
                    ranks = self.ranks.get((scenario, measure)) if method != HUMAN else None
                    place = self.controllers.index(method) if ranks is not None else 0
                    human = self.table.find(scenario, HUMAN, measure)
                    row: dict[str, Any] = {
                        "recording": self.recording,
                        "setting": self.setting,
                        "scenario": scenario,
                        "controller": method,
                        "measure": measure,
                        "mean": level.interval.mean,
                        "low": level.interval.low,
                        "high": level.interval.high,
                        "minus_human": float("nan") if human is None else level.interval.mean - human.interval.mean,
                        "n_draws": level.interval.n_draws,
                        "n_trainings": level.interval.n_trainings,
                        "n_values": level.n_values,
                        "lowest_rank": "" if ranks is None else int(ranks.lowest[place]),
                        "highest_rank": "" if ranks is None else int(ranks.highest[place]),
                    }
                    for k in AT_MOST:
                        at_most = "" if ranks is None else ranks.at_most[place, min(k, len(self.controllers)) - 1]
                        row[f"rank_at_most_{k}"] = at_most
                    rows.append(row)
        return rows

    def pair_rows(self) -> list[dict[str, Any]]:
        """Every pair of controllers, once, as rows of a table; verdict as in `families.compare`."""
        return [
            {
                "recording": self.recording,
                "setting": self.setting,
                "scenario": scenario,
                "measure": measure,
                "controller": one,
                "other": other,
                "difference": self.mean(scenario, i, measure) - self.mean(scenario, j, measure),
                "verdict": int(ranks.better[i, j]) - int(ranks.better[j, i]),
                "probability_of_improvement": ranks.improvement[i, j],
            }
            for (scenario, measure), ranks in self.ranks.items()
            for i, one in enumerate(self.controllers)
            for j, other in enumerate(self.controllers)
            if i < j
        ]


def board_of(agents: pa.Table, roster: Sequence[Entry], *, recording: str, setting: str = DEFAULT) -> Board:
    """The leaderboard of a recording.

    Args:
        agents: Columns of `agents.SCHEMA`, of one recording.
        roster: Controllers under their names on the board, and the human row.
        recording: Its name.
        setting: Of `settings.SETTINGS`.

    Returns:
        The board.
    """
    panel = make_panel(agents, roster)
    methods = list(dict.fromkeys(entry.method for entry in roster))
    controllers = tuple(method for method in methods if method != HUMAN)
    ranks = {
        (scenario, measure): rank(_cells(panel, scenario, controllers, measure), more_is_better=more)
        for scenario in panel.scenarios
        for measure, more in RANKED.items()
    }
    table = LevelTable(rows=tuple(levels(panel, MEASURES, methods=methods, each_training=False)))
    return Board(
        recording=recording,
        setting=setting,
        controllers=controllers,
        table=table,
        ranks=ranks,
        marks=marks_of(panel, controllers),
    )


def _cells(panel: Panel, scenario: str, controllers: Sequence[str], measure: str) -> Array:
    """Means of draws and trainings, (n_draws, n_trainings, k), over draws in which every controller has a value."""
    width = max(len(panel.trainings), 1)
    columns = []
    for name in controllers:
        own = panel.contrast([Term(factor=1.0, method=name, scenario=scenario, measure=measure)])
        columns.append(own if own.shape[1] == width else np.broadcast_to(own, (len(own), width)))
    cells = np.stack(columns, axis=2)
    there = np.isfinite(cells).any(axis=1)
    return cells[np.all(there, axis=1)]
