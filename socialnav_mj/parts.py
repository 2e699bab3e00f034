"""Parts of long episodes as files: how they are named, what they say of themselves, and who is scored in them."""

import re
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import EpisodeError, IntArray

PART = "part"
"""Key of an episode's metadata that only parts have."""
_NUMBERED = re.compile(r"\.part_\d{3,}\.npz$")


def check_part(metadata: Mapping[str, Any]) -> None:
    """What an episode says of being a part is what `Part.metadata` can say.

    Args:
        metadata: Of an episode.

    Raises:
        EpisodeError: If it is something else; names it.
    """
    if PART not in metadata:
        return
    part = metadata[PART]
    if not isinstance(part, dict) or {*part} != {"seconds", "number", "is_last", "scored"}:
        raise EpisodeError(f"part is {part!r:.100}; expected seconds, number, is_last and scored")
    seconds, number, scored = part["seconds"], part["number"], part["scored"]
    if not isinstance(seconds, float) or not (isfinite(seconds) and seconds > 0.0):
        raise EpisodeError(f"part.seconds is {seconds!r:.100}; allowed: finite numbers > 0")
    if not isinstance(number, int) or isinstance(number, bool) or number < 0 or not isinstance(part["is_last"], bool):
        raise EpisodeError(
            f"part.number is {number!r:.100} and is_last {part['is_last']!r:.100}; allowed: 0, 1, ...; true or false"
        )
    if not isinstance(scored, list) or not all(isinstance(person, int) for person in scored):
        raise EpisodeError("part.scored must be a list of people")


def number_of_part(metadata: Mapping[str, Any]) -> int:
    """Place of an episode among the parts of its draw.

    Args:
        metadata: Of the episode.

    Returns:
        From 0; 0 for a whole episode.
    """
    return int(metadata[PART]["number"]) if PART in metadata else 0


def scored_agents(metadata: Mapping[str, Any], agent_person: IntArray) -> NDArray[np.bool_]:
    """Which agents of a record are scored in it.

    Args:
        metadata: Of the episode.
        agent_person: Replaced person of each agent, shape (n,).

    Returns:
        Shape (n,); True for all of a whole episode.

    Raises:
        EpisodeError: If the metadata are not a part's, or name people who are not there.
    """
    if PART not in metadata:
        return np.ones(len(agent_person), dtype=bool)
    check_part(metadata)
    scored = np.array(metadata[PART]["scored"], dtype=np.int64)
    if strangers := np.setdiff1d(scored, agent_person).tolist():
        raise EpisodeError(f"part.scored names person {strangers[0]}, whom no agent replaces")
    return np.isin(agent_person, scored)


def file_of_part(whole: str, metadata: Mapping[str, Any]) -> str:
    """Name of the file of a part.

    The last part has the name that the whole episode would have, and is written last: where it is, all are.

    Args:
        whole: Name of the whole episode's file.
        metadata: Of the part, or of a whole episode.

    Returns:
        `whole`, or with ".part_000" before its suffix.
    """
    if PART not in metadata or metadata[PART]["is_last"]:
        return whole
    path = Path(whole)
    return f"{path.stem}.part_{number_of_part(metadata):03d}{path.suffix}"


def is_before_last(name: str) -> bool:
    """Whether a file is a part of an episode that has later ones.

    Args:
        name: Of the file.

    Returns:
        Whether `file_of_part` numbered it.
    """
    return _NUMBERED.search(name) is not None
