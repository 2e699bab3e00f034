"""The episodes of a run -> one table with a row for every agent, and what else its tables are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.episode import EpisodeError
from socialnav_mj.files import finished_files
from socialnav_mj.metrics.metric import Metric
from socialnav_mj.metrics.registry import METRICS
from socialnav_mj.processes import in_processes
from socialnav_mj.provenance import differences
from socialnav_mj.report import columns as col
from socialnav_mj.report.agents import Source, scenario_configuration
from socialnav_mj.report.paired import HUMAN, pair_with_humans
from socialnav_mj.report.scores import Scores, clear_old_scores, score, score_once
from socialnav_mj.report.watching import counted


@dataclass(frozen=True, kw_only=True)
class Results:
    """All agents of a run, and the episodes they come from, in the same order."""

    agents: pa.Table
    """Columns of `agents_schema`, paired with the human row."""
    contacts: pa.Table
    """Columns of `collisions.CONTACT_SCHEMA`."""
    overlaps: dict[tuple[str, str, str], list[float]]
    """Share of the replayed pedestrians of each episode that overlap another one, by dataset, variant, scenario."""
    sources: tuple[Source, ...]
    """One for each episode, even without agents."""


def read_results(
    folder: str | Path,
    *,
    controllers: Sequence[str] = (),
    files: Sequence[str] | None = None,
    metrics: Sequence[Metric] = METRICS,
    n_jobs: int = 1,
    anew: bool = False,
) -> Results:
    """Score the episodes of a run; one episode at a time is in the memory of each process.

    What this user has scored before with all metrics, the same episode and code, is not scored again; see `scores`.

    Args:
        folder: The run; its episodes are `episodes/*.npz`.
        controllers: Order of the controllers; others follow alphabetically, the human row is always last.
        files: Names of the episodes to read, which are whole; all by default.
        metrics: That have columns.
        n_jobs: Processes that read.
        anew: Score everything, whatever was scored before.

    Returns:
        Rows ordered by dataset, share, scenario, controller, draw and agent.

    Raises:
        FileNotFoundError: If there is no episode, or a named one is not there.
        EpisodeError: If a file is damaged, if two episodes are the same draw of the same thing, if parts of one are
            missing, or if episodes that would be averaged or compared differ in their configuration; the files are
            named.
    """
    episodes = Path(folder) / "episodes"
    there = finished_files(episodes, ".npz")
    paths = there if files is None else sorted(episodes / name for name in files)
    if not paths:
        raise FileNotFoundError(f"no episodes in {episodes}; expected *.npz files")
    if missing := sorted({*paths} - {*there}):
        raise FileNotFoundError(f"{len(missing)} of {len(paths)} episodes are not there, the first is {missing[0]}")
    if anew or metrics is not METRICS:
        scored = in_processes(score, [(path, metrics) for path in paths], n_jobs=n_jobs)
    else:
        clear_old_scores()
        scored = in_processes(score_once, [(path,) for path in paths], n_jobs=n_jobs)
    read = list(counted(scored, len(paths)))
    places = {name: place for place, name in enumerate(controllers)}

    def key(scores: Scores) -> tuple[Any, ...]:
        source = scores.source
        dataset, variant, scenario, controller = source.group
        place = places.get(controller, len(places))
        share = float(source.metadata["scenario"]["share"])
        last = controller == HUMAN
        return dataset, variant, share, scenario, last, place, controller, source.draw, source.part, source.file

    read.sort(key=key)
    sources = tuple(scores.source for scores in read)
    _check_comparable(sources)
    _check_complete(sources)
    overlaps: dict[tuple[str, str, str], list[float]] = {}
    for scores in read:
        if np.isfinite(scores.overlap):
            overlaps.setdefault(scores.source.group[:3], []).append(scores.overlap)
    return Results(
        agents=pair_with_humans(_agents(read), metrics),
        contacts=pa.concat_tables([scores.contacts for scores in read]),
        overlaps=overlaps,
        sources=sources,
    )


def _agents(read: Sequence[Scores]) -> pa.Table:
    """All agents; those of the parts of a draw in the order of a whole episode, so that no mean differs in a bit."""
    tables = []
    for _, draw in groupby(read, key=lambda scores: (scores.source.group, scores.source.draw)):
        own = [scores.agents for scores in draw]
        tables.append(own[0] if len(own) == 1 else pa.concat_tables(own).sort_by(col.PERSON))
    return pa.concat_tables(tables)


def _check_complete(sources: Sequence[Source]) -> None:
    """Of an episode in parts all parts are there: the last one is written last and knows its number."""
    parts: dict[tuple[Any, ...], list[Source]] = {}
    for source in sources:
        parts.setdefault((*source.group, source.draw), []).append(source)
    for own in parts.values():
        last, count = own[-1], own[-1].part + 1
        if len(own) < count or not last.is_last:
            missing = f"{len(own)} of {count} parts of its draw are there" if last.is_last else "it is the latest part"
            raise EpisodeError(
                f"{last.file} is a part of an episode that is not complete: {missing}; repeat the command that ran it"
            )


def _check_comparable(sources: Sequence[Source]) -> None:
    """Rows of one table must differ in the controller alone, and the episodes of one row in the draw alone."""
    first: dict[tuple[str, ...], tuple[Source, Any]] = {}
    seen: dict[tuple[Any, ...], Source] = {}
    for source in sources:
        dataset, variant, scenario, controller = source.group
        twin = seen.setdefault((*source.group, source.draw, source.part), source)
        if twin is not source:
            name = " / ".join(source.group)
            raise EpisodeError(f"{twin.file} and {source.file} are both draw {source.draw} of {name}; remove one")
        for key, configuration in (
            ((dataset, variant, "scenario", scenario), scenario_configuration(source)),
            ((dataset, variant, "controller", controller), source.metadata["controller_config"]),
            ((dataset, variant, "recording", ""), source.metadata["recording"]),
        ):
            model, expected = first.setdefault(key, (source, configuration))
            if other := differences(expected, configuration):
                raise EpisodeError(
                    f"{model.file} and {source.file} have different configurations of {' / '.join(key).rstrip(' /')}: "
                    f"{'; '.join(other)}; put them in different folders"
                )
