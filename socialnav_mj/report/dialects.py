"""The metrics of a run as other benchmarks define them, so that a table can be laid beside theirs."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.dialects import DIALECTS, compute
from socialnav_mj.processes import in_processes
from socialnav_mj.report.agents import Source
from socialnav_mj.report.estimates import Estimate, estimate


def dialect_estimates(
    folder: str | Path, sources: Sequence[Source], dialect: str, *, n_jobs: int = 1
) -> list[Estimate]:
    """Every metric of a dialect, of every controller in every scenario.

    Args:
        folder: The run; its episodes are `episodes/*.npz`.
        sources: Its episodes, those of one row of a table one after another.
        dialect: Key of `metrics.dialects.DIALECTS`.
        n_jobs: Processes that read episodes.

    Returns:
        In the order of the sources and of the dialect; agents whose value is NaN or infinite do not count.

    Raises:
        ValueError: If there is no such dialect.
    """
    if dialect not in DIALECTS:
        raise ValueError(f"unknown dialect {dialect!r}; available: {', '.join(DIALECTS)}")
    paths = [Path(folder) / "episodes" / source.file for source in sources]
    values = dict(in_processes(_read, [(path, dialect) for path in paths], n_jobs=n_jobs))
    result = []
    for (dataset, variant, scenario, controller), group in groupby(
        zip(sources, paths, strict=True), key=lambda item: item[0].group
    ):
        own = [(source.draw, values[path]) for source, path in group]
        labels = {"dataset": dataset, "variant": variant, "scenario": scenario, "controller": controller}
        for metric in own[0][1]:
            of_agents = np.concatenate([found[metric] for _, found in own])
            draws = np.concatenate([np.full(len(found[metric]), draw) for draw, found in own])
            own_labels = {**labels, "measure": metric}
            share = bool(np.isin(of_agents[np.isfinite(of_agents)], (0.0, 1.0)).all())
            result.append(estimate(of_agents, np.ones_like(of_agents), draws, labels=own_labels, share=share))
    return result


def _read(path: Path, dialect: str) -> tuple[Path, dict[str, Array]]:
    return path, compute(Episode.load(path), dialect)
