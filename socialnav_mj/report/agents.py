"""Episode files -> one table with a row for every agent."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

import tasks
from socialnav_mj.episode import Episode, EpisodeError, check_name
from socialnav_mj.files import finished_files
from socialnav_mj.metrics.contacts import pedestrian_overlaps
from socialnav_mj.metrics.metric import Kind, Metric
from socialnav_mj.metrics.registry import METRICS, per_agent
from socialnav_mj.processes import in_processes
from socialnav_mj.report import columns as col
from socialnav_mj.report.collisions import contacts_table
from socialnav_mj.report.paired import HUMAN, pair_with_humans

_TYPES = {Kind.FLAG: pa.bool_(), Kind.COUNT: pa.int64(), Kind.NUMBER: pa.float64(), Kind.NAME: pa.string()}


def agents_schema(metrics: Sequence[Metric] = METRICS) -> pa.Schema:
    """Columns of the agents' table: whose row it is, metrics, what the replaced person had, where it comes from.

    Args:
        metrics: That have columns; null where the metric is missing.

    Returns:
        Names and types, metrics in the order of `columns.ORDER`.
    """
    ordered = sorted(metrics, key=lambda metric: col.place(metric.name))
    return pa.schema(
        [
            (col.DATASET, pa.string()),
            (col.VARIANT, pa.string()),
            (col.SCENARIO, pa.string()),
            (col.SHARE, pa.float64()),
            (col.CONTROLLER, pa.string()),
            (col.DRAW, pa.int64()),
            (col.AGENT, pa.int64()),
            (col.PERSON, pa.int64()),
            *((metric.name, _TYPES[metric.kind]) for metric in ordered),
            *((col.human(metric.name), _TYPES[metric.kind]) for metric in ordered if metric.paired),
            (col.EPISODE, pa.string()),
            (col.STATE_HASH, pa.string()),
        ]
    )


SCHEMA = agents_schema()
"""Of a report with all metrics of the project."""

_METADATA = ("controller", "controller_config", "scenario", "scenario_name", "draw", "recording", "state_hash")
_PARTS = {"recording": ("name", "variant", "checksum"), "scenario": ("seed", "share")}


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where one episode's rows come from: its file and what the file says about itself."""

    file: str
    """Name of the episode's file."""
    metadata: dict[str, Any]
    """The episode's metadata."""

    @property
    def group(self) -> tuple[str, str, str, str]:
        """(dataset, variant, scenario, controller): episodes that differ in the draw alone share it."""
        recording = self.metadata["recording"]
        name = self.metadata["scenario_name"]
        return str(recording["name"]), str(recording["variant"]), str(name), str(self.metadata["controller"])

    @property
    def draw(self) -> int:
        """Seed of the permutation of people."""
        return int(self.metadata["draw"])


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


def agents_table(episode: Episode, *, file: str = "", metrics: Sequence[Metric] = METRICS) -> pa.Table:
    """One row for every agent of an episode.

    Args:
        episode: The record; its metadata fill the descriptive columns.
        file: Name of its file, for the column `episode`.
        metrics: That have columns.

    Returns:
        Columns of `agents_schema`, rows in the order of the agents, not yet paired.

    Raises:
        EpisodeError: If the metadata lack a key that is needed, or contradict themselves.
    """
    check_names(episode.metadata)
    source = Source(file=file, metadata=episode.metadata)
    dataset, variant, scenario, controller = source.group
    n = episode.n_agents
    values: dict[str, NDArray[Any] | list[Any]] = dict(per_agent(episode, metrics))
    for metric in metrics:
        if metric.kind is Kind.NAME:
            values[metric.name] = [metric.names.get(int(value)) for value in values[metric.name]]
        if metric.paired:
            values[col.human(metric.name)] = [None] * n
    values |= {col.AGENT: np.arange(n), col.PERSON: episode.agent_person}
    constant = {
        col.DATASET: dataset,
        col.VARIANT: variant,
        col.SCENARIO: scenario,
        col.SHARE: float(episode.metadata["scenario"]["share"]),
        col.CONTROLLER: controller,
        col.DRAW: source.draw,
        col.EPISODE: file,
        col.STATE_HASH: str(episode.metadata["state_hash"]),
    }
    schema = agents_schema(metrics)
    arrays = [
        pa.array([constant[field.name]] * n, field.type)
        if field.name in constant
        else pa.array(values[field.name], from_pandas=True).cast(field.type)
        for field in schema
    ]
    return pa.table(arrays, schema=schema)


def read_results(
    folder: str | Path,
    *,
    controllers: Sequence[str] = (),
    files: Sequence[str] | None = None,
    metrics: Sequence[Metric] = METRICS,
    n_jobs: int = 1,
) -> Results:
    """Score the episodes of a run; one episode at a time is in the memory of each process.

    Args:
        folder: The run; its episodes are `episodes/*.npz`.
        controllers: Order of the controllers; others follow alphabetically, the human row is always last.
        files: Names of the episodes to read; all by default.
        metrics: That have columns.
        n_jobs: Processes that read.

    Returns:
        Rows ordered by dataset, share, scenario, controller, draw and agent.

    Raises:
        FileNotFoundError: If there is no episode, or a named one is not there.
        EpisodeError: If a file is damaged, if two episodes are the same draw of the same thing, or if episodes that
            would be averaged or compared differ in their configuration; the files are named.
    """
    episodes = Path(folder) / "episodes"
    there = finished_files(episodes, ".npz")
    paths = there if files is None else sorted(episodes / name for name in files)
    if not paths:
        raise FileNotFoundError(f"no episodes in {episodes}; expected *.npz files")
    if missing := sorted({*paths} - {*there}):
        raise FileNotFoundError(f"{len(missing)} of {len(paths)} episodes are not there, the first is {missing[0]}")
    read = list(in_processes(_read, [(path, metrics) for path in paths], n_jobs=n_jobs))
    places = {name: place for place, name in enumerate(controllers)}

    def key(item: tuple[Source, pa.Table, pa.Table, float]) -> tuple[Any, ...]:
        source = item[0]
        dataset, variant, scenario, controller = source.group
        place = places.get(controller, len(places))
        share = float(source.metadata["scenario"]["share"])
        return dataset, variant, share, scenario, controller == HUMAN, place, controller, source.draw, source.file

    read.sort(key=key)
    sources = tuple(source for source, *_ in read)
    _check_comparable(sources)
    overlaps: dict[tuple[str, str, str], list[float]] = {}
    for source, _, _, share in read:
        if source.group[3] == HUMAN and np.isfinite(share):
            overlaps.setdefault(source.group[:3], []).append(share)
    return Results(
        agents=pair_with_humans(pa.concat_tables([agents for _, agents, _, _ in read]), metrics),
        contacts=pa.concat_tables([contacts for _, _, contacts, _ in read]),
        overlaps=overlaps,
        sources=sources,
    )


def _read(path: Path, metrics: Sequence[Metric]) -> tuple[Source, pa.Table, pa.Table, float]:
    """An episode's description, agents, collisions, and the share of its pedestrians that overlap another one."""
    episode = Episode.load(path)
    try:
        agents = agents_table(episode, file=path.name, metrics=metrics)
        source = Source(file=path.name, metadata=episode.metadata)
        labels = dict(zip(("dataset", "variant", "scenario", "controller"), source.group, strict=True))
        contacts = contacts_table(episode, labels=labels | {"draw": source.draw}, file=path.name)
        overlapping = pedestrian_overlaps(episode) > 0 if source.group[3] == HUMAN else np.zeros(0)
        share = float(overlapping.mean()) if overlapping.size else float("nan")
        return source, agents, contacts, share
    except (EpisodeError, KeyError, TypeError) as error:
        raise EpisodeError(f"{path} cannot be scored: {error}") from error


def check_names(metadata: dict[str, Any]) -> None:
    """Draw and scenario by which an episode is filed are those that it was run with, and its names are names.

    Args:
        metadata: Of an episode.

    Raises:
        EpisodeError: If something is missing, contradicts the scenario's configuration, or is no name.
    """
    missing = [key for key in _METADATA if key not in metadata]
    for key, parts in _PARTS.items():
        given = metadata.get(key)
        missing += [f"{key}.{part}" for part in parts if not isinstance(given, dict) or part not in given]
    if missing:
        raise EpisodeError(f"its metadata lack {', '.join(missing)}; there are {', '.join(sorted(metadata))}")
    recording, scenario = metadata["recording"], metadata["scenario"]
    for key in ("controller", "scenario_name"):
        check_name(key, metadata[key])
    for key in _PARTS["recording"]:
        check_name(f"recording.{key}", recording[key])
    if metadata["draw"] != scenario["seed"]:
        raise EpisodeError(f"it calls itself draw {metadata['draw']!r}, but its scenario has seed {scenario['seed']!r}")
    share = tasks.SHARES.get(metadata["scenario_name"], scenario["share"])
    if share != scenario["share"]:
        raise EpisodeError(
            f"it calls itself {metadata['scenario_name']!r}, which replaces a share of {share} of the people, but its "
            f"scenario replaces {scenario['share']!r}"
        )


def scenario_configuration(source: Source) -> dict[str, Any]:
    """The scenario of an episode without what sets its draws apart.

    Args:
        source: An episode's description.

    Returns:
        `Scenario.as_dict` without the seed.
    """
    return {key: value for key, value in source.metadata["scenario"].items() if key != "seed"}


def _check_comparable(sources: Sequence[Source]) -> None:
    """Rows of one table must differ in the controller alone, and the episodes of one row in the draw alone."""
    first: dict[tuple[str, ...], tuple[Source, Any]] = {}
    seen: dict[tuple[Any, ...], Source] = {}
    for source in sources:
        dataset, variant, scenario, controller = source.group
        twin = seen.setdefault((*source.group, source.draw), source)
        if twin is not source:
            name = " / ".join(source.group)
            raise EpisodeError(f"{twin.file} and {source.file} are both draw {source.draw} of {name}; remove one")
        for key, configuration in (
            ((dataset, variant, "scenario", scenario), scenario_configuration(source)),
            ((dataset, variant, "controller", controller), source.metadata["controller_config"]),
            ((dataset, variant, "recording", ""), source.metadata["recording"]),
        ):
            model, expected = first.setdefault(key, (source, configuration))
            if json.dumps(configuration, sort_keys=True) != json.dumps(expected, sort_keys=True):
                raise EpisodeError(
                    f"{model.file} and {source.file} have different configurations of {' / '.join(key).rstrip(' /')}: "
                    f"{expected} and {configuration}; put them in different folders"
                )
