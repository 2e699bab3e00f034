"""One form of the potential field on one recording: what every setting of its gains comes to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute

from socialnav_mj.studies.claims import CLAIMS, Claim
from socialnav_mj.studies.findings import examine
from socialnav_mj.studies.levels import LevelTable, levels
from socialnav_mj.studies.panel import MIXED, POTENTIAL_FIELD, REPLAY_IRL, Entry, make_panel

MEASURES = ("success", "intrusion_share_of_steps", "average_speed", "time_under_way", "timed_out")
"""What is told of every setting."""
OF_THE_FIELD: tuple[Claim, ...] = tuple(
    claim for claim in CLAIMS if any(t.method == POTENTIAL_FIELD for part in claim.parts for t in part.terms)
)
"""Claims that say something of the potential field."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Settings of one form on one recording; the first is the default."""

    recording: str
    form: str
    fields: tuple[str, ...]
    """Specs of the controllers."""
    tables: tuple[LevelTable, ...]
    """Levels of each, under `POTENTIAL_FIELD`; those of the learned controllers are in the first."""
    points: Mapping[str, tuple[bool, ...]]
    """Claim: whether all its comparisons point the paper's way, for each setting; empty if some could not be made."""

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Scenarios that were run."""
        return self.tables[0].scenarios

    def values(self, scenario: str, measure: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """A measure of every setting.

        Args:
            scenario: Name of a task.
            measure: Of `MEASURES`.

        Returns:
            Means over draws, shape (n_settings,), the default first; NaN where nobody has a value.
        """
        found = [table.find(scenario, POTENTIAL_FIELD, measure) for table in self.tables]
        return np.array([np.nan if level is None else level.interval.mean for level in found])

    def learned(self, scenario: str, method: str, measure: str) -> float:
        """A measure of a learned method.

        Args:
            scenario: Name of a task.
            method: `REPLAY_IRL` or `MIXED`.
            measure: Of `MEASURES`.

        Returns:
            Mean over draws and trainings; NaN where nobody has a value.
        """
        level = self.tables[0].find(scenario, method, measure)
        return float("nan") if level is None else level.interval.mean

    def rows(self) -> list[dict[str, Any]]:
        """Every measure of every setting as rows of a table."""
        return [
            {
                "recording": self.recording,
                "form": self.form,
                "controller": field,
                "scenario": scenario,
                **{measure: self.values(scenario, measure)[k] for measure in MEASURES},
            }
            for scenario in self.scenarios
            for k, field in enumerate(self.fields)
        ]

    def claim_rows(self) -> list[dict[str, Any]]:
        """Every claim under every setting as rows of a table."""
        return [
            {
                "recording": self.recording,
                "form": self.form,
                "controller": field,
                "claim": claim,
                "points_the_papers_way": int(holds),
            }
            for claim, each in self.points.items()
            for field, holds in zip(self.fields, each, strict=False)
        ]


def sweep_of(agents: pa.Table, *, recording: str, form: str, rosters: Mapping[str, Sequence[Entry]]) -> Sweep:
    """What the settings of one form come to.

    Args:
        agents: Columns of `agents.SCHEMA`, of one recording.
        recording: Its name.
        form: Name of the controller.
        rosters: Spec of the field: it and what it is compared with; the default first.

    Returns:
        The sweep.
    """
    tables, findings = [], []
    for place, roster in enumerate(rosters.values()):
        names = pa.array([entry.controller for entry in roster])
        panel = make_panel(agents.filter(pa.compute.is_in(agents["controller"], names)), roster)
        methods = (POTENTIAL_FIELD, *((REPLAY_IRL, MIXED) if place == 0 else ()))
        tables.append(LevelTable(rows=tuple(levels(panel, MEASURES, methods=methods, each_training=False))))
        findings.append(examine(panel, OF_THE_FIELD))
    points = {
        claim.key: tuple(all(interval.mean > 0.0 for _, interval, _ in own[k].parts) for own in findings)
        if not any(own[k].missing for own in findings)
        else ()
        for k, claim in enumerate(OF_THE_FIELD)
    }
    return Sweep(recording=recording, form=form, fields=tuple(rosters), tables=tuple(tables), points=points)
