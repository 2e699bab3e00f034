"""A policy that never saw a recording beside those that learned from it, on the very same agents."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pyarrow as pa

from socialnav_mj.report.intervals import interval_of
from socialnav_mj.studies.held_out import HELD_OUT, IN_SAMPLE
from socialnav_mj.studies.levels import Level, LevelTable, levels
from socialnav_mj.studies.panel import REPLAY_IRL, Entry, Panel, Term, make_panel

MEASURES = ("success", "intrusion_share_of_steps", "first_hit_pedestrian", "timed_out")
"""What is tabulated; see `estimates.MEASURES`."""
DIFFERENCES = MEASURES[:2]


@dataclass(frozen=True, kw_only=True)
class SideBySide:
    """All controllers on one recording; made by `side_by_side`."""

    recording: str
    """Its name."""
    window: tuple[float, float]
    """Part of its duration that the in-sample policies learned from, shares of the whole."""
    methods: tuple[str, ...]
    """In the order of the roster."""
    held_out: str
    """Method that never saw the recording."""
    in_sample: tuple[str, ...]
    """Methods that learned from it."""
    levels: LevelTable
    differences: tuple[Level, ...]
    """Held out minus each in-sample method, then minus their mean if they are several; `Level.method` says which."""

    def role(self, method: str) -> str:
        """What a method is to this recording.

        Args:
            method: Of `methods`.

        Returns:
            "held out", "in-sample", or nothing if it did not learn.
        """
        return HELD_OUT if method == self.held_out else IN_SAMPLE if method in self.in_sample else ""


def learned_method(recordings: Sequence[str]) -> str:
    """Name of a learned policy among the methods.

    Args:
        recordings: Names of what it learned from.

    Returns:
        For example "replay_irl(zara01+zara02)".
    """
    return f"{REPLAY_IRL}({'+'.join(recordings)})"


def side_by_side(
    agents: pa.Table,
    roster: Sequence[Entry],
    *,
    held_out: str,
    people: Collection[int],
    recording: str,
    window: tuple[float, float],
) -> SideBySide:
    """Compare policies on the agents that replace some people of a recording.

    Args:
        agents: Columns of `agents.SCHEMA`, of the recording.
        roster: Controllers; each learned method has an entry for every training seed.
        held_out: Method that never saw the recording; all others that learned did.
        people: Ids of those who appear in the window.
        recording: Its name.
        window: Part of the recording that was learned from, shares of its duration.

    Returns:
        Levels and paired differences over those agents alone.
    """
    panel = make_panel(agents, roster, keep=partial(np.isin, test_elements=list(people)))
    methods = tuple(dict.fromkeys(entry.method for entry in roster))
    in_sample = tuple(m for m in methods if panel.is_trained(m) and m != held_out)
    subtracted: dict[str, Sequence[str]] = {f"{held_out} - {m}": (m,) for m in in_sample}
    if len(in_sample) > 1:
        subtracted[f"{held_out} - {IN_SAMPLE}"] = in_sample
    return SideBySide(
        recording=recording,
        window=window,
        methods=methods,
        held_out=held_out,
        in_sample=in_sample,
        levels=LevelTable(rows=tuple(levels(panel, MEASURES, methods=methods))),
        differences=tuple(
            _difference(panel, scenario, name, held_out, others, measure)
            for scenario in panel.scenarios
            for name, others in subtracted.items()
            for measure in DIFFERENCES
        ),
    )


def _difference(panel: Panel, scenario: str, name: str, held_out: str, in_sample: Sequence[str], measure: str) -> Level:
    """Held out minus the mean of in-sample methods; trainings that one of them lacks do not count."""
    factors = {held_out: 1.0, **dict.fromkeys(in_sample, -1.0 / len(in_sample))}
    terms = [Term(factor=f, method=m, scenario=scenario, measure=measure) for m, f in factors.items()]
    paired = [
        np.isfinite([panel.values(method, scenario, measure, training)[0] for method in factors]).all(axis=0)
        for training in panel.trainings
    ]
    return Level(
        scenario=scenario,
        method=name,
        training=None,
        measure=measure,
        interval=interval_of(panel.contrast(terms), trained=True),
        n_values=int(np.sum(paired)),
    )
