"""Long episodes cut into parts, each a record of its own: whose runs end in it, and all that they met."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import Cast
from socialnav_mj.episode import IntArray

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
