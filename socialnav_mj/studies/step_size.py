"""How much outcomes depend on the physics step: the same agents at several steps, and in a hardly different world."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.config import Scenario
from socialnav_mj.evaluation import Done, Evaluation, Job, evaluate, jobs_of
from socialnav_mj.geometry import Array
from socialnav_mj.report import columns as col
from socialnav_mj.report.agents import read_results
from socialnav_mj.report.estimates import MEASURES, draw_means, groups, measured
from socialnav_mj.report.intervals import Interval, interval_of
from socialnav_mj.report.markdown import bounds, number, table

STEPS = (0.01, 0.005, 0.0025)
"""Physics steps [s]; the first is the one that the others are compared with."""
NUDGE = 1e-6
"""How much wider the people of the hardly different world are [m]: nothing that anybody could measure, so that what it
flips is left to chance, whatever the step."""
SHOWN = (col.SUCCESS, col.TIME_UNDER_WAY, col.INTRUSION_SHARE)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One controller in one world."""

    scenario: str
    controller: str
    world: str
    """The physics step, or the nudge."""
    means: dict[str, float]
    """Of `SHOWN`, over draws."""
    shift: Interval
    """Of the success: this world's minus the first one's, paired by draw."""
    flipped: float
    """Share of agents whose success is another one than in the first world."""
    n_agents: int
    n_draws: int


def worlds(steps: Sequence[float] = STEPS) -> dict[str, dict[str, Any]]:
    """What is compared.

    Args:
        steps: Physics steps [s], the one to compare with first.

    Returns:
        Name: settings of the scenario.
    """
    found: dict[str, dict[str, Any]] = {f"{1e3 * step:g} ms": {"physics_timestep": step} for step in steps}
    wider = {"physics_timestep": steps[0], "pedestrian_radius": Scenario.pedestrian_radius + NUDGE}
    return {**found, f"{1e3 * steps[0]:g} ms, people {1e6 * NUDGE:g} um wider": wider}


def evaluations(evaluation: Evaluation, steps: Sequence[float] = STEPS) -> dict[str, Evaluation]:
    """An evaluation in every world.

    Args:
        evaluation: What is to be run.
        steps: Physics steps [s].

    Returns:
        World: evaluation.
    """
    return {
        name: Evaluation(**{**vars(evaluation), "task_kwargs": {**evaluation.task_kwargs, **settings}})
        for name, settings in worlds(steps).items()
    }


def run(planned: Mapping[str, Evaluation], out: Path, *, command: str = "", n_jobs: int = -1) -> Iterator[Done]:
    """Run what is not there yet; everything that can be wrong is told before anything runs.

    Args:
        planned: Of `evaluations`.
        out: Gets a folder for each world.
        command: Kept beside the episodes.
        n_jobs: Processes; -1 for one a core.

    Returns:
        A note of each episode; see `evaluation.evaluate` for what it raises.
    """
    started = [evaluate(own, _folder(out, name), command=command, n_jobs=n_jobs) for name, own in planned.items()]
    return (done for episodes in started for done in episodes)


def jobs(planned: Mapping[str, Evaluation]) -> list[Job]:
    """Every episode of every world.

    Args:
        planned: Of `evaluations`.

    Returns:
        Jobs, in the order in which they are run.
    """
    return [job for evaluation in planned.values() for job in jobs_of(evaluation)]


def compare(planned: Mapping[str, Evaluation], out: Path, *, n_jobs: int = -1) -> list[Row]:
    """What became of the same agents in every world.

    Args:
        planned: Of `evaluations`, run by `run`.
        out: Its folder.
        n_jobs: Processes that score episodes.

    Returns:
        Of `side_by_side`.
    """
    tables = {
        name: read_results(
            _folder(out, name), files=[job.file_name for job in jobs_of(evaluation)], n_jobs=n_jobs
        ).agents
        for name, evaluation in planned.items()
    }
    controllers = next(iter(planned.values())).controllers
    return [row for row in side_by_side(tables) if row.controller in controllers]


def side_by_side(tables: Mapping[str, pa.Table]) -> list[Row]:
    """Means of every controller in every world, and how many agents end otherwise than in the first.

    Args:
        tables: World: agents, columns of `agents.SCHEMA`; the same controllers, draws and people in all.

    Returns:
        In the order of scenarios and controllers, then of worlds.

    Raises:
        ValueError: If a world has other agents than the first.
    """
    reference, *_ = tables
    found: dict[tuple[str, str], list[Row]] = {}
    first: dict[tuple[str, str], tuple[list[Any], Array, Array]] = {}
    for world, cells in tables.items():
        for labels, columns, draws in groups(cells):
            key = (labels[col.SCENARIO], labels[col.CONTROLLER])
            of_draws = {name: draw_means(*measured(columns, MEASURES[name]), draws)[1] for name in SHOWN}
            agents = list(zip(draws.tolist(), columns[col.PERSON].tolist(), strict=True))
            success = columns[col.SUCCESS].astype(float)
            others, before, known = first.setdefault(key, (agents, success, of_draws[col.SUCCESS]))
            if agents != others:
                raise ValueError(f"{world!r} and {reference!r} have different agents of {key}; allowed: the same")
            found.setdefault(key, []).append(
                Row(
                    scenario=key[0],
                    controller=key[1],
                    world=world,
                    means={name: float(means.mean()) for name, means in of_draws.items()},
                    shift=interval_of((of_draws[col.SUCCESS] - known)[:, None]),
                    flipped=float(np.mean(success != before)),
                    n_agents=len(agents),
                    n_draws=len(set(draws.tolist())),
                )
            )
    return [row for rows in found.values() for row in rows]


def step_table(rows: Sequence[Row]) -> str:
    """Rows as a table of Markdown.

    Args:
        rows: Of `side_by_side`.

    Returns:
        Lines with a line break behind each.
    """
    headings = ["scenario", "controller", "physics step", "success", "difference (95 % interval)", "flipped"]
    headings += [f"{MEASURES[name].heading}" for name in SHOWN[1:]] + ["agents", "draws"]
    cells = []
    for r in rows:
        shift = "-"
        if r.shift.n_draws and r.world != rows[0].world:
            ends = bounds(r.shift.low, r.shift.high, sign="+")
            shift = f"{number(r.shift.mean, 3, '+')} ({ends})"
        flipped = "-" if r.world == rows[0].world else f"{r.flipped:.3f}"
        means = [number(r.means[name], MEASURES[name].digits) for name in SHOWN]
        cells.append([r.scenario, r.controller, r.world, means[0], shift, flipped, *means[1:]])
        cells[-1] += [str(r.n_agents), str(r.n_draws)]
    return "\n".join(table(headings, cells)[:-1]) + "\n"


def _folder(out: Path, world: str) -> Path:
    return out / world.replace(",", "").replace(" ", "_")
