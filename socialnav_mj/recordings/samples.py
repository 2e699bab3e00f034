"""From the rows of an annotation (frame, person, position) to a `Recording`; what all file formats share."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.fields import FormatError
from socialnav_mj.recordings.reading import Reading
from socialnav_mj.recordings.recording import Recording

logger = logging.getLogger(__name__)

Index = NDArray[np.int64]
Row = tuple[int, int, int, float, float]
"""Line counted from 1, frame, person, x, y."""

FARTHEST = 1e7
"""Largest coordinate; from a pole to the equator, so that map coordinates are allowed [m]."""
_ROW = [("line", np.int64), ("frame", np.int64), ("person", np.int64), ("x", np.float64), ("y", np.float64)]
_LISTED = 10
"""So many ids are named in a warning."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """The rows of an annotation, in the order of the file."""

    path: Path
    """The file the rows come from."""
    line: Index
    """(k,) line of each row, counted from 1."""
    frame: Index
    """(k,)."""
    person: Index
    """(k,) id."""
    position: Array
    """(k, 2), in the unit that the reading states."""

    def recording(
        self, *, name: str, variant: str, frame_rate: float, frame_rate_origin: str, checksum: str, reading: Reading
    ) -> Recording:
        """Sort the rows into tracks; the earliest frame of all becomes time 0.

        A person with a single row has no motion and cannot be interpolated: it is left out, and a warning with the
        ids is logged.

        Args:
            name: What the recording is to be called.
            variant: Format that the rows were read from.
            frame_rate: Frames per second, which turns frames into times [Hz].
            frame_rate_origin: Who says it, as `Recording.frame_rate_origin` has it.
            checksum: sha256 of the source files.
            reading: Unit of the positions, the bounds on time, and the settings that the recording keeps.

        Returns:
            Tracks in metres and seconds, in ascending order of ids.

        Raises:
            FormatError: If a person has two rows for one frame, nobody has two rows, or a time or a position is
                beyond its bound.
        """
        position = self._metres(reading)
        self._check_duration(frame_rate, reading.max_duration)
        order = np.lexsort((self.frame, self.person))
        frame, person, position = self.frame[order], self.person[order], position[order]
        self._check_once(frame, person, order)
        time = (frame - frame.min()) / frame_rate
        self._check_gaps(time, person, order, reading.max_gap)
        ids, first_row, count = np.unique(person, return_index=True, return_counts=True)
        kept = count >= 2
        if not kept.all():
            alone = ids[~kept]
            listed = ", ".join(map(str, alone[:_LISTED])) + (", ..." if len(alone) > _LISTED else "")
            logger.warning("%s: left out %d people with a single position: ids %s", self.path, len(alone), listed)
        if not kept.any():
            raise FormatError(self.path, None, f"{len(ids)} people with at most one position", "people with at least 2")
        rows = [slice(start, start + k) for start, k in zip(first_row[kept], count[kept], strict=True)]
        return Recording(
            name=name,
            variant=variant,
            frame_rate=frame_rate,
            frame_rate_origin=frame_rate_origin,
            ids=ids[kept],
            times=tuple(time[r] for r in rows),
            positions=tuple(position[r] for r in rows),
            checksum=checksum,
            reading=reading.settings(),
        )

    def _metres(self, reading: Reading) -> Array:
        with np.errstate(over="ignore"):
            position = self.position * reading.unit
        far = np.flatnonzero(~(np.abs(position) <= FARTHEST).all(axis=1))
        if far.size:
            x, y = position[far[0]]
            given = f"the position ({x:g}, {y:g}) m"
            raise FormatError(self.path, int(self.line[far[0]]), given, f"coordinates within {FARTHEST:g} m of 0")
        return position

    def _check_duration(self, frame_rate: float, longest: float) -> None:
        duration = int(np.ptp(self.frame)) / frame_rate
        if duration > longest:
            # The frame that is far from most others is the one to look at; of two, the later line.
            far = np.abs(self.frame - int(np.median(self.frame)))
            row = int(np.flatnonzero(far == far.max())[-1])
            given = f"frame {self.frame[row]} makes the recording {duration:g} s long at {frame_rate:g} Hz"
            expected = f"at most {longest:g} s (--max-duration lifts it)"
            raise FormatError(self.path, int(self.line[row]), given, expected)

    def _check_once(self, frame: Index, person: Index, order: Index) -> None:
        twice = np.flatnonzero((np.diff(person) == 0) & (np.diff(frame) == 0))
        if twice.size:
            row = twice[0]
            first, second = sorted((int(self.line[order[row]]), int(self.line[order[row + 1]])))
            given = f"person {person[row]} has a second position at frame {frame[row]} (the first: line {first})"
            raise FormatError(self.path, second, given, "one position per person and frame")

    def _check_gaps(self, time: Array, person: Index, order: Index, longest: float) -> None:
        gap = np.where(np.diff(person) == 0, np.diff(time), 0.0)
        wide = np.flatnonzero(gap > longest)
        if wide.size:
            row = wide[0]
            before, line = int(self.line[order[row]]), int(self.line[order[row + 1]])
            given = f"person {person[row]} is not seen for {gap[row]:g} s (before: line {before})"
            expected = f"a gap of at most {longest:g} s (--max-gap lifts it)"
            raise FormatError(self.path, line, given, expected)


def samples_of_rows(path: Path, rows: Iterable[Row]) -> Samples:
    """Gather rows into columns.

    Args:
        path: The file they come from.
        rows: In the order of the file; taken one by one, so that a long file costs 40 bytes a row.

    Returns:
        As many samples as rows, in their order.

    Raises:
        FormatError: If there are no rows.
    """
    table = np.fromiter(rows, dtype=_ROW)
    if not len(table):
        raise FormatError(path, None, "no positions", "at least one")
    line, frame, person = (np.ascontiguousarray(table[name]) for name in ("line", "frame", "person"))
    return Samples(path=path, line=line, frame=frame, person=person, position=np.column_stack([table["x"], table["y"]]))
