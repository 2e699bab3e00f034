"""Scores of an episode, kept in the user's cache by its content: what has not changed is never scored twice.

The cache is the user's own and no part of a run: a run that somebody else gives is scored from its episodes.
"""

import hashlib
import json
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pooch
import pyarrow as pa

from socialnav_mj.episode import Episode, EpisodeError
from socialnav_mj.files import write_whole
from socialnav_mj.metrics.contacts import pedestrian_overlaps
from socialnav_mj.metrics.metric import Metric
from socialnav_mj.metrics.registry import METRICS
from socialnav_mj.parts import scored_agents
from socialnav_mj.report.agents import Source, agents_table
from socialnav_mj.report.collisions import contacts_table
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.sources import made_of

KEPT = 60
"""Scores that nobody asked for are removed after this time [d]."""
_PACKAGE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, kw_only=True)
class Scores:
    """What tables need of one episode."""

    source: Source
    agents: pa.Table
    """Columns of `agents.agents_schema`, not yet paired; of a part, the agents that are scored in it."""
    contacts: pa.Table
    """Columns of `collisions.CONTACT_SCHEMA`."""
    overlap: float
    """Share of the replayed pedestrians that overlap another one; NaN outside the human row."""


def scores_folder() -> Path:
    """Where scores are kept; it may be deleted at any time.

    Returns:
        A folder of the user's cache, which need not be there.
    """
    return Path(pooch.os_cache("socialnav-mj")) / "scores"


def score(path: Path, metrics: Sequence[Metric] = METRICS) -> Scores:
    """Score an episode.

    Args:
        path: Its file.
        metrics: That have columns.

    Returns:
        Its scores.

    Raises:
        FileNotFoundError: If there is no such file.
        EpisodeError: If it is damaged or cannot be scored; names the file.
    """
    episode = Episode.load(path)
    try:
        agents = agents_table(episode, file=path.name, metrics=metrics)
        source = Source(file=path.name, metadata=episode.metadata)
        scored = scored_agents(episode.metadata, episode.agent_person)
        labels = dict(zip(("dataset", "variant", "scenario", "controller"), source.group, strict=True))
        contacts = contacts_table(episode, labels=labels | {"draw": source.draw}, file=path.name)
        agents = agents.filter(pa.array(scored))
        contacts = contacts.filter(pa.array(scored[contacts["agent"].to_numpy()]))
        overlapping = pedestrian_overlaps(episode) > 0 if source.group[3] == HUMAN else np.zeros(0)
        overlap = float(overlapping.mean()) if overlapping.size else float("nan")
    except (EpisodeError, KeyError, TypeError) as error:
        raise EpisodeError(f"{path} cannot be scored: {error}") from error
    return Scores(source=source, agents=agents, contacts=contacts, overlap=overlap)


def score_once(path: Path) -> Scores:
    """Score an episode with the project's metrics, or find what that gave before, with the same code and file.

    Args:
        path: Its file.

    Returns:
        As `score`.

    Raises:
        FileNotFoundError: See `score`.
        EpisodeError: See `score`.
    """
    digest = hashlib.sha256(f"{_code()} {path.name} ".encode() + path.read_bytes()).hexdigest()
    kept = scores_folder() / digest[:2] / f"{digest}.arrows"
    with suppress(OSError, pa.ArrowInvalid, KeyError, ValueError):  # not there, or damaged: it is scored again
        found = _unpacked(kept.read_bytes())
        kept.touch()
        return found
    scores = score(path)
    with suppress(OSError):  # a full disk, or a cache that may not be written
        write_whole(kept, _packed(scores))
    return scores


def clear_old_scores() -> None:
    """Remove scores that nobody has asked for in a long time."""
    oldest = time.time() - KEPT * 86400.0
    for path in scores_folder().glob("*/*.arrows"):
        with suppress(OSError):
            if path.stat().st_mtime < oldest:
                path.unlink()


def scoring_sources() -> dict[str, str]:
    """Digests of all of this package that scores depend on, besides the episode.

    Returns:
        Path: sha256, of this file, of all metrics and of what they import.
    """
    first = _PACKAGE / "__init__.py"  # imports the suite when it is called, which nothing here does
    begin = [Path(__file__).resolve(), *(_PACKAGE / "metrics").glob("*.py")]
    return made_of(begin, _PACKAGE.parent, lambda own: own.is_relative_to(_PACKAGE) and own != first)


@lru_cache(maxsize=1)
def _code() -> str:
    digested = f"{version('numpy')} {version('pyarrow')} {json.dumps(scoring_sources())}"
    return hashlib.sha256(digested.encode()).hexdigest()


def _packed(scores: Scores) -> bytes:
    """Two Arrow streams; the first one's schema has the rest."""
    rest: dict[str, Any] = {"source": scores.source.metadata, "file": scores.source.file, "overlap": scores.overlap}
    sink = pa.BufferOutputStream()
    for table in (scores.agents.replace_schema_metadata({"scores": json.dumps(rest)}), scores.contacts):
        with pa.ipc.new_stream(sink, table.schema) as stream:
            stream.write_table(table)
    content: bytes = sink.getvalue().to_pybytes()
    return content


def _unpacked(content: bytes) -> Scores:
    source = pa.BufferReader(content)
    agents, contacts = (pa.ipc.open_stream(source).read_all() for _ in range(2))
    rest = json.loads(agents.schema.metadata[b"scores"])
    return Scores(
        source=Source(file=rest["file"], metadata=rest["source"]),
        agents=agents.replace_schema_metadata(None),
        contacts=contacts,
        overlap=rest["overlap"],
    )
