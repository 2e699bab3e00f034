"""All agents of an experiment side by side: every controller drove the same agents, so they are compared in pairs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES, WEIGHTS, Columns, draw_means
from socialnav_mj.report.paired import HUMAN

POTENTIAL_FIELD, CAPPED, REPLAY_IRL, MIXED = "potential_field", "potential_field_capped", "replay_irl", "mixed"
ROBOTS = (POTENTIAL_FIELD, CAPPED, REPLAY_IRL, MIXED)
METHODS = (*ROBOTS, HUMAN)
"""What is compared; the learned ones once for each training."""

COMMON = "_common"
"""Ending of measures that are taken over the agents that all controllers brought home."""
SUCCESS = MEASURES[col.SUCCESS]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What one controller of the tables is in the experiment."""

    controller: str
    """Its name in the tables."""
    method: str
    """Of `METHODS`, or another name of what is compared."""
    training_seed: int | None = None
    """Of the policy in it; None if there is nothing trained."""


@dataclass(frozen=True, kw_only=True)
class Term:
    """A mean over agents, times a factor."""

    factor: float
    method: str
    scenario: str
    measure: str
    """Of `MEASURES`, with `COMMON` behind it for the agents that all controllers brought home."""


@dataclass(frozen=True)
class _Cell:
    """One controller in one scenario, with a row for every agent of the panel."""

    columns: Columns
    rows: NDArray[np.int64]
    """Place of the panel's agents in the columns, -1 where the controller has none."""

    def values(self, column: Callable[[Columns], Array]) -> Array:
        values = np.append(np.asarray(column(self.columns), dtype=float), np.nan)
        return values[self.rows]


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Agents (rows) by controllers, for each scenario; made by `make_panel`."""

    scenarios: tuple[str, ...]
    """In the order of the share of agents."""
    trainings: tuple[int, ...]
    """Training seeds, ascending."""
    draws: dict[str, NDArray[np.int64]]
    """Scenario: draw of each agent, shape (n,)."""
    kept: dict[str, NDArray[np.bool_]]
    """Scenario: which agents count, shape (n,)."""
    common: dict[str, NDArray[np.bool_]]
    """Scenario: which agents succeeded under every controller, the people themselves apart, shape (n,)."""
    _cells: dict[tuple[str, str, int | None], _Cell] = field(repr=False)

    def has(self, method: str, scenario: str) -> bool:
        """Whether there are agents of a method in a scenario.

        Args:
            method: Of `METHODS`.
            scenario: Name of a task.

        Returns:
            True if there are.
        """
        return any(key[:2] == (method, scenario) for key in self._cells)

    def is_trained(self, method: str) -> bool:
        """Whether a method has one controller for each training.

        Args:
            method: Of `METHODS`.

        Returns:
            True if it has.
        """
        return any(key[0] == method and key[2] is not None for key in self._cells)

    def contrast(self, terms: Sequence[Term], *, trainings: Sequence[int] = ()) -> Array:
        """Sum of terms for each draw and training, paired by agent.

        Within a scenario an agent counts if it has a value in every term; learned methods are compared training by
        training, with a method that learns nothing beside each.

        Args:
            terms: At least one.
            trainings: Which; all by default.

        Returns:
            Shape (n_draws, n_trainings), or (n_draws, 1) if no term learns; NaN where no agent counts.
        """
        trained = any(self.is_trained(term.method) for term in terms)
        columns: Sequence[int | None] = (tuple(trainings) or self.trainings) if trained else (None,)
        draws = np.unique(np.concatenate([self.draws[scenario] for scenario in {t.scenario for t in terms}]))
        return np.stack([self._column(terms, training, draws) for training in columns], axis=1)

    def _column(self, terms: Sequence[Term], training: int | None, draws: NDArray[np.int64]) -> Array:
        total = np.zeros(len(draws))
        for scenario in dict.fromkeys(term.scenario for term in terms):
            own = [term for term in terms if term.scenario == scenario]
            values = [self.values(t.method, scenario, t.measure, training) for t in own]
            counted = np.all([np.isfinite(value) & (weight > 0.0) for value, weight in values], axis=0)
            for term, (value, weight) in zip(own, values, strict=True):
                unit, means = draw_means(value[counted], weight[counted], self.draws[scenario][counted])
                of_draws = np.full(len(draws), np.nan)
                of_draws[np.searchsorted(draws, unit)] = means
                total += term.factor * of_draws
        return total

    def same_agents(self, scenario: str) -> tuple[int, int]:
        """How many agents the measures with `COMMON` are about.

        Args:
            scenario: Name of a task.

        Returns:
            Agents that every controller brought home without a collision, and all that count.
        """
        kept = self.kept[scenario]
        return int(np.sum(kept & self.common[scenario])), int(np.sum(kept))

    def values(self, method: str, scenario: str, measure: str, training: int | None) -> tuple[Array, Array]:
        """A measure of every agent, and the agent's weight within its draw.

        Args:
            method: Of `METHODS`.
            scenario: Name of a task.
            measure: See `Term`.
            training: Training seed; ignored for a method that learns nothing.

        Returns:
            Both of shape (n,); the value is NaN where there is none or the agent does not count.
        """
        cell = self._cells.get((method, scenario, training if self.is_trained(method) else None))
        if cell is None:
            return np.full(len(self.draws[scenario]), np.nan), np.ones(len(self.draws[scenario]))
        name = measure.removesuffix(COMMON)
        counted = self.kept[scenario] & (self.common[scenario] if measure.endswith(COMMON) else True)
        value = np.where(counted, cell.values(MEASURES[name]), np.nan)
        weight = cell.values(lambda c: c[WEIGHTS[name]]) if name in WEIGHTS else np.ones_like(value)
        return value, weight


def make_panel(
    agents: pa.Table, roster: Sequence[Entry], *, keep: Callable[[NDArray[np.int64]], NDArray[np.bool_]] | None = None
) -> Panel:
    """Put the agents of a table side by side.

    Args:
        agents: Columns of `agents.SCHEMA`, of one recording.
        roster: Which controllers count, and as what; those that are not in the table have no values.
        keep: Persons' ids, shape (n,), to whether they count; all by default.

    Returns:
        The panel.

    Raises:
        ValueError: If two controllers are the same method and training, or the table has more than one recording.
    """
    recordings = set(zip(agents[col.DATASET].to_pylist(), agents[col.VARIANT].to_pylist(), strict=True))
    if len(recordings) > 1:
        raise ValueError(f"agents of {len(recordings)} recordings ({sorted(recordings)}); allowed: of one")
    entry_of = _by_role(roster)
    shares = dict(zip(agents[col.SCENARIO].to_pylist(), agents[col.SHARE].to_pylist(), strict=True))
    scenarios = tuple(sorted(shares, key=lambda name: (shares[name], name)))
    columns = {name: agents[name].to_numpy() for name in agents.column_names}
    draws, kept, common, cells = {}, {}, {}, {}
    for scenario in scenarios:
        here = columns[col.SCENARIO] == scenario
        key = np.unique(np.stack([columns[col.DRAW][here], columns[col.PERSON][here]], axis=1), axis=0)
        draws[scenario] = key[:, 0]
        kept[scenario] = np.ones(len(key), dtype=bool) if keep is None else keep(key[:, 1])
        common[scenario] = np.ones(len(key), dtype=bool)
        for (method, training), entry in entry_of.items():
            chosen = np.flatnonzero(here & (columns[col.CONTROLLER] == entry.controller))
            if not chosen.size:
                continue
            own = {name: values[chosen] for name, values in columns.items()}
            place = {agent: row for row, agent in enumerate(zip(own[col.DRAW], own[col.PERSON], strict=True))}
            rows = np.array([place.get((draw, person), -1) for draw, person in key], dtype=np.int64)
            cells[method, scenario, training] = _Cell(own, rows)
            if method != HUMAN:
                common[scenario] &= cells[method, scenario, training].values(SUCCESS) > 0.0
    return Panel(
        scenarios=scenarios,
        trainings=tuple(sorted({training for _, training in entry_of if training is not None})),
        draws=draws,
        kept=kept,
        common=common,
        _cells=cells,
    )


def _by_role(roster: Sequence[Entry]) -> Mapping[tuple[str, int | None], Entry]:
    result: dict[tuple[str, int | None], Entry] = {}
    for entry in roster:
        twin = result.setdefault((entry.method, entry.training_seed), entry)
        if twin is not entry:
            raise ValueError(
                f"{twin.controller!r} and {entry.controller!r} are both {entry.method} of training seed "
                f"{entry.training_seed}"
            )
    return result
