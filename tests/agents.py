"""Synthetic tables of agents, whose truth is known, for the experiment's statistics, claims and figures."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.report.agents import SCHEMA
from socialnav_mj.studies.panel import CAPPED, HUMAN, MIXED, POTENTIAL_FIELD, REPLAY_IRL, Entry

SHARES = {"scenario_1": 0.1, "scenario_2": 0.3, "scenario_3": 0.7, "scenario_4": 0.9}


def roster_of(trainings: Sequence[int]) -> tuple[Entry, ...]:
    """Controllers of an experiment, named after their method and training."""
    return (
        Entry(controller="pf", method=POTENTIAL_FIELD),
        Entry(controller="cap", method=CAPPED),
        *(Entry(controller=f"irl{k}", method=REPLAY_IRL, training_seed=k) for k in trainings),
        *(Entry(controller=f"mix{k}", method=MIXED, training_seed=k) for k in trainings),
        Entry(controller=HUMAN, method=HUMAN),
    )


def rows_of(controller: str, scenario: str, draw: int, columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of one episode: every column a list with a value for each agent, or one value for all.

    Columns that are not given are 0, False or empty; person k of a draw is agent k.
    """
    n = max(len(values) for values in columns.values() if isinstance(values, (list, np.ndarray)))
    constant = {"dataset": "made", "variant": "text", "scenario": scenario, "share": SHARES[scenario]}
    rows = []
    for k in range(n):
        given = {
            name: values[k] if isinstance(values, (list, np.ndarray)) else values for name, values in columns.items()
        }
        rows.append({**constant, "controller": controller, "draw": draw, "agent": k, "person": k, **given})
    return rows


def table_of(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """A table with all columns of the agents' table."""
    empty = {pa.string(): "", pa.bool_(): False, pa.int64(): 0, pa.float64(): 0.0}
    columns = []
    for field in SCHEMA:
        values = [row.get(field.name, empty[field.type]) for row in rows]
        columns.append(pa.array([v.item() if isinstance(v, np.generic) else v for v in values], field.type))
    return pa.table(columns, schema=SCHEMA)


METHOD_VALUES: dict[str, dict[str, list[float]]] = {
    "pf": {"success": [0.5, 0.6, 0.8, 0.9], "speed": [0.9] * 4, "path": [1.0] * 4, "steps": [60.0, 50.0, 30.0, 20.0]},
    "cap": {"success": [0.5, 0.6, 0.8, 0.9], "speed": [0.8] * 4, "path": [1.1] * 4, "steps": [50.0, 40.0, 25.0, 15.0]},
    "irl": {"success": [0.6, 0.7, 0.7, 0.8], "speed": [0.7] * 4, "path": [1.3] * 4, "steps": [30.0, 25.0, 15.0, 10.0]},
    "mix": {
        "success": [0.7, 0.8, 0.9, 0.95],
        "speed": [0.72, 0.76, 0.8, 0.85],
        "path": [1.25, 1.2, 1.15, 1.05],
        "steps": [31.0, 26.0, 15.5, 10.2],
    },
    "human": {"success": [0.85] * 4, "speed": [0.8] * 4, "path": [1.1] * 4, "steps": [70.0, 60.0, 30.0, 10.0]},
}
"""Means in scenarios 1 to 4 of an experiment in which everything that the paper says is so."""


def experiment_table(
    values: Mapping[str, Mapping[str, Sequence[float]]] = METHOD_VALUES,
    *,
    trainings: Sequence[int] = (0, 1, 2),
    n_draws: int = 4,
    n_agents: int = 40,
    noise: float = 0.01,
    scenarios: Sequence[str] = tuple(SHARES),
) -> pa.Table:
    """Agents whose means are given: the same agents fail first under every controller; draws and trainings wander.

    Args:
        values: Method's short name: quantity: mean in each scenario.
        trainings: Training seeds.
        n_draws: Number of draws.
        n_agents: Agents a draw, in all scenarios.
        noise: Standard deviation of a draw's, and of a training's, relative deviation.
        scenarios: Names of tasks.

    Returns:
        Columns of `agents.SCHEMA`.
    """
    random = np.random.default_rng(1)
    names = {e.controller: e.controller.rstrip("0123456789") for e in roster_of(trainings)}
    drift = {name: 1.0 + noise * random.standard_normal() * (name != kind) for name, kind in names.items()}
    rank = (np.arange(n_agents) + 0.5) / n_agents
    rows: list[dict[str, Any]] = []
    for place, scenario in enumerate(scenarios):
        for draw in range(n_draws):
            luck = 1.0 + noise * random.standard_normal()
            for name, kind in names.items():
                own = {quantity: means[place] for quantity, means in values[kind].items()}
                wander = drift[name] * luck * (1.0 + 0.2 * noise * random.standard_normal())
                # Shares and counts are whole numbers of agents and steps: without this all draws would be equal.
                success = rank < own["success"] * wander + 0.03 * (random.random() - 0.5)
                steps = round(own["steps"] * wander) + random.integers(-1, 2, n_agents)
                time = 10.0 * own["path"] / own["speed"] * wander
                rows += rows_of(
                    name,
                    scenario,
                    draw,
                    {
                        "success": success,
                        "arrived": True,
                        "average_speed": own["speed"] * wander,
                        "distance_to_displacement": own["path"] * wander,
                        "completion_time": time,
                        "completion_steps": round(5 * time),
                        "time_under_way": time,
                        "active_steps": 100,
                        "intimate_intrusions": steps,
                        "intrusion_share": own["steps"] / 100.0 * wander,
                        "first_partner": np.where(success, "", "pedestrian"),
                    },
                )
    return table_of(rows)
