"""The same controllers and draws under several settings, paired: levels, differences to the first, and the ranking."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute

from socialnav_mj.controllers import make_controller, with_policy_of
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.geometry import Array
from socialnav_mj.report.intervals import Interval, interval_of
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.studies.held_out import recording_name
from socialnav_mj.studies.kendall import Tau, kendall
from socialnav_mj.studies.levels import LevelTable, levels
from socialnav_mj.studies.panel import Entry, Panel, Term, make_panel
from socialnav_mj.studies.settings import DEFAULT, SETTINGS
from socialnav_mj.studies.study import Run, SideBySide


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A setting under which everything is run."""

    name: str
    title: str
    task_kwargs: dict[str, Any] = field(default_factory=dict)
    """Keyword arguments of the tasks."""


@dataclass(frozen=True, kw_only=True)
class ConditionStudy(SideBySide):
    """Every controller on every recording under every condition."""

    conditions: tuple[Condition, ...]
    """The first is what the others are compared with."""

    def runs(self) -> list[Run]:
        """One evaluation for each recording and condition.

        Returns:
            In their order, named RECORDING_CONDITION.
        """
        return [self._run(recording, condition) for recording in self.recordings for condition in self.conditions]

    def _run(self, recording: str, condition: Condition) -> Run:
        specs = {spec: with_policy_of(spec, recording) for spec in self.controllers}
        evaluation = Evaluation(
            dataset=recording,
            data_dir=self.data_dir,
            scenarios=self.scenarios,
            controllers=tuple(specs.values()),
            draws=self.draws_of(recording),
            seed=self.seed,
            task_kwargs=condition.task_kwargs,
        )
        entries = tuple(Entry(controller=own, method=spec) for spec, own in specs.items())
        return Run(
            name=run_name(recording, condition),
            evaluation=evaluation,
            roster=(*entries, Entry(controller=HUMAN, method=HUMAN)),
        )


def conditions_of(default: str, *names: str) -> tuple[Condition, ...]:
    """The default setting and others as conditions.

    Args:
        default: What the default one is called.
        *names: Others, of `settings.SETTINGS`.

    Returns:
        The default first.
    """
    others = (Condition(name=n, title=SETTINGS[n].title, task_kwargs=dict(SETTINGS[n].task_kwargs)) for n in names)
    return (Condition(name=default, title=SETTINGS[DEFAULT].title), *others)


def run_name(recording: str, condition: Condition) -> str:
    """Name of the run of a recording under a condition.

    Args:
        recording: Its name or path.
        condition: The condition.

    Returns:
        RECORDING_CONDITION.
    """
    return f"{recording_name(recording)}_{condition.name}"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One recording under all conditions."""

    recording: str
    controllers: tuple[str, ...]
    conditions: tuple[Condition, ...]
    measures: tuple[str, ...]
    table: LevelTable
    """Methods are `at` of controller and condition."""
    differences: Mapping[tuple[str, str, str, str], Interval]
    """Scenario, controller, name of a condition, measure: condition minus the first, paired by agent."""
    taus: Mapping[tuple[str, str, str], Tau]
    """Scenario, name of a condition, measure: of its ranking with the first condition's."""

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Scenarios that were run."""
        return self.table.scenarios

    def level(self, scenario: str, controller: str, condition: Condition, measure: str) -> Any:
        """One level.

        Args:
            scenario: Name of a task.
            controller: Of `controllers`.
            condition: Of `conditions`.
            measure: Of `measures`.

        Returns:
            A `levels.Level`, or None if it is not there.
        """
        return self.table.find(scenario, at(controller, condition), measure)

    def level_rows(self) -> list[dict[str, Any]]:
        """Every level as rows of a table."""
        return [
            {
                **self._labels(scenario, controller, condition, measure),
                "mean": level.interval.mean,
                "low": level.interval.low,
                "high": level.interval.high,
                "n_draws": level.interval.n_draws,
                "n_values": level.n_values,
            }
            for scenario in self.scenarios
            for controller in self.controllers
            for condition in self.conditions
            for measure in self.measures
            if (level := self.level(scenario, controller, condition, measure)) is not None
        ]

    def difference_rows(self) -> list[dict[str, Any]]:
        """Every difference to the first condition as rows of a table."""
        return [
            {
                "recording": self.recording,
                "scenario": scenario,
                "controller": controller,
                "condition": condition,
                "measure": measure,
                "difference": interval.mean,
                "low": interval.low,
                "high": interval.high,
                "n_draws": interval.n_draws,
            }
            for (scenario, controller, condition, measure), interval in self.differences.items()
        ]

    def tau_rows(self) -> list[dict[str, Any]]:
        """Every rank correlation as rows of a table."""
        return [
            {
                "recording": self.recording,
                "scenario": scenario,
                "condition": condition,
                "measure": measure,
                "kendall_tau": tau.mean,
                "low": tau.low,
                "high": tau.high,
                "pairs_told_apart": tau.told_apart,
                "pairs_turned_over": len(tau.turned_over),
            }
            for (scenario, condition, measure), tau in self.taus.items()
        ]

    def _labels(self, scenario: str, controller: str, condition: Condition, measure: str) -> dict[str, str]:
        names = {"scenario": scenario, "controller": controller, "condition": condition.name, "measure": measure}
        return {"recording": self.recording, **names}


def at(controller: str, condition: Condition) -> str:
    """Name of a controller under a condition, in tables that hold all of them.

    Args:
        controller: Its spec.
        condition: The condition.

    Returns:
        Both, told apart.
    """
    return f"{controller} @ {condition.name}"


def compare(
    study: ConditionStudy,
    results: Mapping[str, Results],
    recording: str,
    measures: Sequence[str],
    ranked: Sequence[str],
) -> Comparison:
    """What the episodes of one recording come to.

    Args:
        study: That was run.
        results: Of each run.
        recording: Its name or path.
        measures: Of `estimates.MEASURES`, told of every controller and condition.
        ranked: Those of them by which controllers are ranked.

    Returns:
        The comparison.
    """
    tables, roster = [], []
    for condition in study.conditions:
        own = results[run_name(recording, condition)].agents
        specs = {make_controller(with_policy_of(spec, recording)).name: spec for spec in study.controllers}
        own = own.filter(pa.compute.is_in(own["controller"], pa.array(list(specs))))
        named = pa.array([at(specs[name], condition) for name in own["controller"].to_pylist()], pa.string())
        tables.append(own.set_column(own.schema.get_field_index("controller"), "controller", named))
        roster += [Entry(controller=at(s, condition), method=at(s, condition)) for s in study.controllers]
    panel = make_panel(pa.concat_tables(tables), roster)
    first, *others = study.conditions
    return Comparison(
        recording=recording_name(recording),
        controllers=study.controllers,
        conditions=study.conditions,
        measures=tuple(measures),
        table=LevelTable(
            rows=tuple(levels(panel, measures, methods=[entry.method for entry in roster], each_training=False))
        ),
        differences={
            (scenario, controller, other.name, measure): _difference(panel, scenario, controller, other, first, measure)
            for scenario in panel.scenarios
            for controller in study.controllers
            for other in others
            for measure in measures
        },
        taus={
            (scenario, other.name, measure): kendall(
                *(_by_draw(panel, scenario, study.controllers, condition, measure) for condition in (first, other))
            )
            for scenario in panel.scenarios
            for other in others
            for measure in ranked
        },
    )


def _difference(
    panel: Panel, scenario: str, controller: str, other: Condition, first: Condition, measure: str
) -> Interval:
    terms = [
        Term(factor=factor, method=at(controller, condition), scenario=scenario, measure=measure)
        for factor, condition in ((1.0, other), (-1.0, first))
    ]
    return interval_of(panel.contrast(terms))


def _by_draw(panel: Panel, scenario: str, controllers: Sequence[str], condition: Condition, measure: str) -> Array:
    """Means of draws, (n_draws, n_controllers)."""
    columns = [
        panel.contrast([Term(factor=1.0, method=at(name, condition), scenario=scenario, measure=measure)]).mean(axis=1)
        for name in controllers
    ]
    return np.stack(columns, axis=1)
