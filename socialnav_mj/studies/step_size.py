"""How much outcomes depend on the physics step: the same agents at several steps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.evaluation import Done, Evaluation, Job, evaluate, jobs_of
from socialnav_mj.geometry import Array
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES, draw_means, groups, measured
from socialnav_mj.report.intervals import Interval, interval_of
from socialnav_mj.report.markdown import bounds, number, table
from socialnav_mj.report.results import read_results

STEPS = (0.01, 0.2 / 21, 0.005, 0.0025)
"""Physics steps [s]; the first is the one that the others are compared with. The second is hardly shorter, 21 in a
control step instead of 20: what it flips is left to chance rather than to the length of the step."""
SHOWN = (col.SUCCESS, col.TIME_UNDER_WAY, col.INTRUSION_SHARE)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One controller at one step."""

    scenario: str
    controller: str
    step: str
    """The physics step, with its unit."""
    means: dict[str, float]
    """Of `SHOWN`, over draws."""
    shift: Interval
    """Of the success: at this step minus at the first one, paired by draw."""
    flipped: float
    """Share of agents whose success is another one than at the first step."""
    n_agents: int
    n_draws: int


def evaluations(evaluation: Evaluation, steps: Sequence[float] = STEPS) -> dict[str, Evaluation]:
    """An evaluation at every step.

    Args:
        evaluation: What is to be run.
        steps: Physics steps [s], the one to compare with first.

    Returns:
        Step, as text: evaluation.
    """
    return {
        f"{1e3 * step:.3g} ms": replace(evaluation, task_kwargs={**evaluation.task_kwargs, "physics_timestep": step})
        for step in steps
    }


def run(planned: Mapping[str, Evaluation], out: Path, *, command: str = "", n_jobs: int = -1) -> Iterator[Done]:
    """Run what is not there yet; everything that can be wrong is told before anything runs.

    Args:
        planned: Of `evaluations`.
        out: Gets a folder for each step.
        command: Kept beside the episodes.
        n_jobs: Processes; -1 for one a core.

    Returns:
        A note of each episode; see `evaluation.evaluate` for what it raises.
    """
    started = [evaluate(own, _folder(out, name), command=command, n_jobs=n_jobs) for name, own in planned.items()]
    return (done for episodes in started for done in episodes)


def jobs(planned: Mapping[str, Evaluation]) -> list[Job]:
    """Every episode at every step.

    Args:
        planned: Of `evaluations`.

    Returns:
        Jobs, in the order in which they are run.
    """
    return [job for evaluation in planned.values() for job in jobs_of(evaluation)]


def compare(planned: Mapping[str, Evaluation], out: Path, *, n_jobs: int = -1) -> list[Row]:
    """What became of the same agents at every step.

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
    """Means of every controller at every step, and how many agents end otherwise than at the first.

    Args:
        tables: Step, as text: agents, columns of `agents.SCHEMA`; the same controllers, draws and people in all.

    Returns:
        In the order of scenarios and controllers, then of steps.

    Raises:
        ValueError: If a step has other agents than the first.
    """
    reference, *_ = tables
    found: dict[tuple[str, str], list[Row]] = {}
    first: dict[tuple[str, str], tuple[list[Any], Array, Array]] = {}
    for step, cells in tables.items():
        for labels, columns, draws in groups(cells):
            key = (labels[col.SCENARIO], labels[col.CONTROLLER])
            of_draws = {name: draw_means(*measured(columns, MEASURES[name]), draws)[1] for name in SHOWN}
            agents = list(zip(draws.tolist(), columns[col.PERSON].tolist(), strict=True))
            success = columns[col.SUCCESS].astype(float)
            others, before, known = first.setdefault(key, (agents, success, of_draws[col.SUCCESS]))
            if agents != others:
                raise ValueError(f"{step!r} and {reference!r} have different agents of {key}; allowed: the same")
            found.setdefault(key, []).append(
                Row(
                    scenario=key[0],
                    controller=key[1],
                    step=step,
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
        if r.shift.n_draws and r.step != rows[0].step:
            ends = bounds(r.shift.low, r.shift.high, sign="+")
            shift = f"{number(round(r.shift.mean, 3) + 0.0, 3, '+')} ({ends})"
        flipped = "-" if r.step == rows[0].step else f"{r.flipped:.3f}"
        means = [number(r.means[name], MEASURES[name].digits) for name in SHOWN]
        cells.append([r.scenario, r.controller, r.step, means[0], shift, flipped, *means[1:]])
        cells[-1] += [str(r.n_agents), str(r.n_draws)]
    return "\n".join(table(headings, cells)[:-1]) + "\n"


def _folder(out: Path, step: str) -> Path:
    return out / step.replace(" ", "_")
