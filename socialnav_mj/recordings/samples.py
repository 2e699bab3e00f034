"""From the rows of an annotation (frame, person, position) to a `Recording`; what all file formats share."""

import logging
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.recording import Recording

logger = logging.getLogger(__name__)

Row = tuple[int, int, int, float, float]
"""Line counted from 1, frame, person, x [m], y [m]."""


class FormatError(ValueError):
    """A mistake in a recording's file; the message names file, line, what is there and what was expected."""

    def __init__(self, path: Path, line: int | None, given: str, expected: str) -> None:
        """Compose the message.

        Args:
            path: The file.
            line: Counted from 1; None if the mistake is in no single line.
            given: What the file says.
            expected: What it should say.
        """
        place = f"{path}" if line is None else f"{path}, line {line}"
        super().__init__(f"{place}: {given}; expected {expected}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """The rows of an annotation, in the order of the file."""

    path: Path
    """The file the rows come from."""
    line: NDArray[np.int64]
    """(k,) line of each row, counted from 1."""
    frame: NDArray[np.int64]
    """(k,)."""
    person: NDArray[np.int64]
    """(k,) id."""
    position: Array
    """(k, 2) [m]."""

    def recording(self, *, name: str, variant: str, frame_rate: float, checksum: str) -> Recording:
        """Sort the rows into tracks; the earliest frame of all becomes time 0.

        A person with a single row has no motion and cannot be interpolated: it is left out, and a warning with the
        ids is logged.

        Args:
            name: Of the recording.
            variant: Of the recording.
            frame_rate: Frames per second [Hz].
            checksum: sha256 of the source.

        Returns:
            The recording.

        Raises:
            FormatError: If a person has two rows for one frame, or nobody has two rows.
        """
        order = np.lexsort((self.frame, self.person))
        frame, person, line = self.frame[order], self.person[order], self.line[order]
        twice = np.flatnonzero((np.diff(person) == 0) & (np.diff(frame) == 0))
        if twice.size:
            first, second = sorted((int(line[twice[0]]), int(line[twice[0] + 1])))
            given = (
                f"person {person[twice[0]]} has a second position at frame {frame[twice[0]]} (the first: line {first})"
            )
            raise FormatError(self.path, second, given, "one position per person and frame")
        ids, first_row, count = np.unique(person, return_index=True, return_counts=True)
        kept = count >= 2
        if not kept.all():
            logger.warning(
                "%s: left out %d people with a single position: ids %s",
                self.path,
                np.count_nonzero(~kept),
                ", ".join(map(str, ids[~kept])),
            )
        if not kept.any():
            raise FormatError(self.path, None, f"{len(ids)} people with at most one position", "people with at least 2")
        time = (frame - frame.min()) / frame_rate
        rows = [slice(start, start + k) for start, k in zip(first_row[kept], count[kept], strict=True)]
        return Recording(
            name=name,
            variant=variant,
            frame_rate=frame_rate,
            ids=ids[kept],
            times=tuple(time[r] for r in rows),
            positions=tuple(self.position[order][r] for r in rows),
            checksum=checksum,
        )


def samples_of_rows(path: Path, rows: list[Row]) -> Samples:
    """Columns of rows.

    Args:
        path: The file they come from.
        rows: In the order of the file.

    Returns:
        The samples.

    Raises:
        FormatError: If there are none.
    """
    if not rows:
        raise FormatError(path, None, "no positions", "at least one")
    line, frame, person, x, y = zip(*rows, strict=True)
    return Samples(
        path=path,
        line=np.array(line),
        frame=np.array(frame),
        person=np.array(person),
        position=np.column_stack([x, y]).astype(float),
    )


def number(text: str, path: Path, line: int, what: str) -> float:
    """Parse a finite number.

    Args:
        text: The field.
        path: The file, for the message.
        line: Counted from 1, for the message.
        what: Name of the field, for the message.

    Returns:
        The number.

    Raises:
        FormatError: If it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise FormatError(path, line, f"{what} is {text!r}", "a finite number")
    return value


def whole_number(text: str, path: Path, line: int, what: str) -> int:
    """Parse a whole number, which may be written like 7, 7.0 or 7.0e+00.

    Args:
        text: The field.
        path: The file, for the message.
        line: Counted from 1, for the message.
        what: Name of the field, for the message.

    Returns:
        The number.

    Raises:
        FormatError: If it is none.
    """
    value = number(text, path, line, what)
    if value != int(value):
        raise FormatError(path, line, f"{what} is {text!r}", "a whole number")
    return int(value)


def text_lines(path: Path) -> list[str]:
    """Lines of a text file.

    Args:
        path: The file.

    Returns:
        The lines without their ends.

    Raises:
        FormatError: If it is not UTF-8 text.
    """
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(path, None, f"byte {error.start} is not UTF-8", "a text file") from error
