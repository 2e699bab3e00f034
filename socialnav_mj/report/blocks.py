"""What a page has besides Markdown: tables whose cells know their interval, and whose rows where they come from."""

import hashlib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

_NUMBER = r"[-+]?\d[\d,]*(?:\.\d+)?"
_WITH_INTERVAL = re.compile(rf"({_NUMBER}) \(({_NUMBER}) to ({_NUMBER})\)")
_TIED_RANKS = re.compile(r"1-\d+")
_FIRST = re.compile(rf"{_NUMBER}(?![\w.])")
_MARGIN = 4.0
"""Of a drawn interval's picture, which is 100 wide."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Text of a cell, and what is drawn of it."""

    shown: str
    """Text, or HTML if it is `markupsafe.Markup`."""
    value: float = math.nan
    """To sort by, and the place of the dot; NaN for text, and where there is nothing to tell."""
    low: float = math.nan
    """Lower end of the interval; NaN if there is none."""
    high: float = math.nan
    reads: str = ""
    """The interval as text."""
    note: str = ""
    """What is told of the cell when it is pointed at."""
    tied: bool = False
    best: bool = False
    is_text: bool = False
    """Whether it is sorted as text."""

    @property
    def has_interval(self) -> bool:
        """Whether there is one to draw."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    @property
    def key(self) -> str | None:
        """What a table is sorted by; empty sorts last, None is the text itself."""
        if self.is_text:
            return None
        return f"{self.value:.17g}" if math.isfinite(self.value) else ""

    @property
    def looks(self) -> str:
        """Names of classes."""
        flags = (("number", not self.is_text), ("tie", self.tied), ("best", self.best))
        return " ".join(name for name, holds in flags if holds)


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where a row comes from."""

    digest: str
    """Of the episodes' state hashes, see `digest_of`."""
    command: str = ""
    """That runs its episodes; empty if nobody knows."""
    trace: str = ""
    """Path of a trace beside the page; empty if there is none."""
    view: str = ""
    """Command that shows an episode of it."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One row of a table."""

    cells: tuple[Cell, ...]
    origin: Origin | None = None


@dataclass(frozen=True, kw_only=True)
class Scale:
    """From a column's values to places in a picture that is 100 wide."""

    low: float
    high: float
    zero: float | None
    """Place of zero, where it is within and not at an end."""

    def place(self, value: float) -> str:
        """Place of a value.

        Args:
            value: Within the scale.

        Returns:
            A number with one digit behind the point.
        """
        return f"{_place(value, self.low, self.high):.1f}"


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table whose intervals are drawn, those of a column to one scale."""

    headings: tuple[str, ...]
    rows: tuple[Row, ...]
    told: tuple[str, ...] = ()
    """What is told of each heading when it is pointed at, empty for nothing; none of them if there are fewer."""

    @property
    def has_origins(self) -> bool:
        """Whether any row says where it comes from."""
        return any(row.origin is not None for row in self.rows)

    def scale(self, column: int) -> Scale:
        """Scale of a column.

        Args:
            column: Index.

        Returns:
            From the least lower end to the greatest upper end.
        """
        return self._scales[column]

    @cached_property
    def _scales(self) -> list[Scale]:
        return [_scale([row.cells[k] for row in self.rows]) for k in range(len(self.headings))]


def digest_of(state_hashes: Sequence[str]) -> str:
    """One hash for many episodes.

    Args:
        state_hashes: Of the episodes, in any order.

    Returns:
        sha256 of the sorted hashes, a line each.
    """
    return hashlib.sha256("\n".join(sorted(state_hashes)).encode()).hexdigest()


def cell_of(text: str, shown: str | None = None) -> Cell:
    """A cell that stands in a Markdown table, with what its text says of a mean and its interval.

    A difference is written with its sign; it is a tie where its interval covers 0. A set of ranks, as "1-3", is a tie
    for the first one.

    Args:
        text: Without Markdown's marks, as `markdown.number` and `markdown.interval` write numbers.
        shown: How it is shown, if not as the text.

    Returns:
        The cell; the number that it is sorted by is the first in it, if it begins with one.
    """
    shown = text if shown is None else shown
    if found := _WITH_INTERVAL.match(text):
        value, low, high = (_value(part) for part in found.groups())
        tied = "+" in found[0] and low <= 0.0 <= high
        return Cell(shown=shown, value=value, low=low, high=high, reads=f"{found[2]} to {found[3]}", tied=tied)
    if found := _FIRST.match(text):
        return Cell(shown=shown, value=_value(found[0]), tied=bool(_TIED_RANKS.fullmatch(text)))
    return Cell(shown=shown, is_text=text != "-")


def _value(text: str) -> float:
    return float(text.replace(",", ""))


def _scale(cells: Sequence[Cell]) -> Scale:
    drawn = [cell for cell in cells if cell.has_interval]
    ends = [end for cell in drawn for end in (cell.low, cell.high, cell.value) if math.isfinite(end)]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    zero = _place(0.0, low, high) if low < 0.0 < high else None
    return Scale(low=low, high=high, zero=None if zero is None else round(zero, 1))


def _place(value: float, low: float, high: float) -> float:
    share = (value - low) / (high - low) if high > low else 0.5
    return _MARGIN + (100.0 - 2.0 * _MARGIN) * min(max(share, 0.0), 1.0)
