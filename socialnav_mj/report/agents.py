"""Episode files -> one table with a row for every agent."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from socialnav_mj.config import SHARES
from socialnav_mj.episode import Episode, EpisodeError, check_name
from socialnav_mj.metrics.metric import Kind, Metric
from socialnav_mj.metrics.registry import METRICS, per_agent
from socialnav_mj.parts import PART, check_part, number_of_part
from socialnav_mj.report import columns as col

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

    @property
    def part(self) -> int:
        """Place among the parts of its draw; 0 for a whole episode."""
        return number_of_part(self.metadata)

    @property
    def is_last(self) -> bool:
        """Whether it ends its draw, as whole episodes do."""
        return bool(self.metadata[PART]["is_last"]) if PART in self.metadata else True


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
    check_part(metadata)
    recording, scenario = metadata["recording"], metadata["scenario"]
    for key in ("controller", "scenario_name"):
        check_name(key, metadata[key])
    for key in _PARTS["recording"]:
        check_name(f"recording.{key}", recording[key])
    if metadata["draw"] != scenario["seed"]:
        raise EpisodeError(f"it calls itself draw {metadata['draw']!r}, but its scenario has seed {scenario['seed']!r}")
    share = SHARES.get(metadata["scenario_name"], scenario["share"])
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
