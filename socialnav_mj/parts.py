"""Long episodes in parts, each a record of its own: whose runs end in it, and all that they met."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import Cast
from socialnav_mj.episode import EpisodeError, IntArray

PART = "part"
"""Key of an episode's metadata that only parts have."""
_NUMBERED = re.compile(r"\.part_\d{3,}\.npz$")
NOT_YET = -1
"""Control step of what has not happened."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """What the record of a part holds, of the cast of the whole episode.

    Every agent is scored in one part, that in which its run ends. The record goes back to when the first of them came
    in, and has everybody who was there since then; the runs of the others may be cut at either end.
    """

    number: int
    """From 0."""
    is_last: bool
    begin: int
    """First control step."""
    end: int
    """Last control step, included."""
    agents: IntArray
    """Indices of all agents that it holds, ascending."""
    scored: NDArray[np.bool_]
    """Which of them are scored here, same shape."""
    pedestrians: IntArray
    """Indices of all people that it holds, ascending."""

    @property
    def n_samples(self) -> int:
        """Control steps of the record."""
        return self.end - self.begin + 1

    def metadata(self, seconds: float, cast: Cast) -> dict[str, Any]:
        """What the episode says of being a part.

        Args:
            seconds: Length that was asked for [s].
            cast: Of the whole episode.

        Returns:
            JSON values: seconds, number, is_last, and scored, the replaced people of the agents that are scored.
        """
        scored = cast.agent_person[self.agents[self.scored]]
        return {"seconds": seconds, "number": self.number, "is_last": self.is_last, "scored": scored.tolist()}


class Parting:
    """Cuts an episode as it goes on."""

    def __init__(self, cast: Cast, *, length: float) -> None:
        """Begin with nothing.

        Args:
            cast: Of the whole episode.
            length: Control steps of a part, at least; the last one may be shorter. Infinity for one part.
        """
        self._cast, self._length = cast, length
        self._since, self._number = -1, 0

    def is_due(self, step: int, end: IntArray) -> bool:
        """Whether a part can be cut.

        Args:
            step: The control step that would be its last.
            end: Control step at which each agent's run ended, shape (n,).

        Returns:
            Whether it would be long enough and anybody would be scored in it.
        """
        return step - max(self._since, 0) >= self._length and bool(np.any((end > self._since) & (end <= step)))

    def cut(self, step: int, *, spawn: IntArray, end: IntArray, is_last: bool = False) -> Part:
        """End a part.

        Args:
            step: Its last control step.
            spawn: Control step at which each agent came in, shape (n,).
            end: Control step at which its run ended, shape (n,).
            is_last: Whether the episode is over: who has not ended is scored in it as well.

        Returns:
            The part; the next one begins after it.
        """
        cast, is_whole = self._cast, is_last and not self._number
        scored = (end > self._since) & (end <= step) | is_last & (end == NOT_YET)
        begin = 0 if is_whole else int(spawn[scored & (spawn != NOT_YET)].min(initial=step))
        there = (spawn != NOT_YET) & (spawn <= step) & ((end == NOT_YET) | (end >= begin))
        agents = np.flatnonzero(there | scored)
        people = (cast.pedestrian_first_step <= step) & (cast.pedestrian_last_step >= begin)
        part = Part(
            number=self._number,
            is_last=is_last,
            begin=begin,
            end=step,
            agents=agents,
            scored=scored[agents],
            pedestrians=np.flatnonzero(people | is_whole),
        )
        self._since, self._number = step, self._number + 1
        return part


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
