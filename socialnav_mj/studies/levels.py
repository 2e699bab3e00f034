"""What each method reaches in each scenario: the numbers behind the figures and tables of an experiment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES
from socialnav_mj.report.intervals import Interval, interval_of
from socialnav_mj.studies.panel import COMMON, METHODS, Panel, Term

LEVEL_MEASURES = (
    col.SUCCESS,
    col.SUCCESS_IF_GHOSTS_COUNT,
    col.TIMED_OUT,
    col.FIRST_HIT_PEDESTRIAN,
    col.FIRST_HIT_AGENT,
    col.OVERTURNED,
    col.NEVER_SPAWNED,
    col.INTRUSION_SHARE_OF_STEPS,
    col.AVERAGE_SPEED,
    col.DISTANCE_TO_DISPLACEMENT_SUCCESS,
    f"{col.DISTANCE_TO_DISPLACEMENT_SUCCESS}{COMMON}",
    col.INTIMATE_INTRUSIONS,
    col.INTRUSION_SHARE,
    col.COMPLETION_TIME_SUCCESS,
    f"{col.COMPLETION_TIME_SUCCESS}{COMMON}",
    f"{col.COMPLETION_STEPS_SUCCESS}{COMMON}",
    col.TIME_UNDER_WAY,
    col.MINIMUM_DISTANCE,
)
"""What is tabulated; see `estimates.MEASURES`, and `panel.COMMON` for the ending."""


@dataclass(frozen=True, kw_only=True)
class Level:
    """Mean of a measure of one method in one scenario."""

    scenario: str
    method: str
    training: int | None
    """Training seed, or None for all trainings together, or if nothing learns."""
    measure: str
    interval: Interval
    """In the measure's unit."""
    n_values: int
    """Agents with a value, added up over the trainings."""


def levels(
    panel: Panel,
    measures: Sequence[str] = LEVEL_MEASURES,
    *,
    methods: Sequence[str] = METHODS,
    each_training: bool = True,
) -> list[Level]:
    """Means of all methods.

    Args:
        panel: Of the experiment.
        measures: Of `LEVEL_MEASURES`.
        methods: What is compared; those that the panel lacks are left out.
        each_training: Whether to add a row for each training of the methods that learn.

    Returns:
        In the order of scenarios, methods and measures; all trainings before each.
    """
    result = []
    for scenario in panel.scenarios:
        for method in methods:
            if not panel.has(method, scenario):
                continue
            trained = panel.is_trained(method)
            single: tuple[int | None, ...] = panel.trainings if trained and each_training else ()
            for training in (None, *single):
                for measure in measures:
                    result.append(_level(panel, scenario, method, measure, training))
    return result


def _level(panel: Panel, scenario: str, method: str, measure: str, training: int | None) -> Level:
    term = Term(factor=1.0, method=method, scenario=scenario, measure=measure)
    trained = panel.is_trained(method)
    trainings = panel.trainings if training is None else (training,)
    counted = [panel.values(method, scenario, measure, t)[0] for t in (trainings if trained else (None,))]
    n_values = sum(int(np.isfinite(value).sum()) for value in counted)
    interval = interval_of(
        panel.contrast([term], trainings=trainings),
        trained=trained,
        agents=max(n_values // len(counted), 1) if MEASURES[measure.removesuffix(COMMON)].is_share else None,
    )
    return Level(
        scenario=scenario,
        method=method,
        training=training,
        measure=measure,
        interval=interval,
        n_values=n_values,
    )


@dataclass(frozen=True, kw_only=True)
class LevelTable:
    """Levels to be looked up."""

    rows: tuple[Level, ...]

    def find(self, scenario: str, method: str, measure: str, training: int | None = None) -> Level | None:
        """One level.

        Args:
            scenario: Name of a task.
            method: Of `METHODS`.
            measure: Of `LEVEL_MEASURES`.
            training: Training seed; None for all.

        Returns:
            The level, or None if it is not there.
        """
        wanted = (scenario, method, measure, training)
        return next((r for r in self.rows if (r.scenario, r.method, r.measure, r.training) == wanted), None)

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Scenarios in their order."""
        return tuple(dict.fromkeys(row.scenario for row in self.rows))

    def trainings(self, method: str) -> tuple[int, ...]:
        """Training seeds that have rows of their own.

        Args:
            method: Of `METHODS`.

        Returns:
            Ascending; empty if nothing learns.
        """
        return tuple(sorted({r.training for r in self.rows if r.method == method and r.training is not None}))
