"""Rows and tables of Markdown pages."""

import re
from collections.abc import Sequence
from math import isnan
from typing import Literal

Sign = Literal["", "+"]

_BREAKS = re.compile("[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]+")
_MEANS = str.maketrans({"<": "&lt;", "`": "\\`", "|": "\\|"})


def plain(text: str) -> str:
    """Text that comes from a file, such as a name, written so that it is text in Markdown and in the HTML made of it.

    Args:
        text: Any.

    Returns:
        One line without tags, code, links and columns of its own.
    """
    return _BREAKS.sub(" ", text).translate(_MEANS).replace("](", "]\\(")


def code(text: str) -> str:
    """Text as code.

    Args:
        text: Any.

    Returns:
        One line between more backticks than it holds in a row.
    """
    text = _BREAKS.sub(" ", text)
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    space = " " if "`" in text else ""
    return f"{fence}{space}{text}{space}{fence}"


def row(cells: Sequence[str]) -> str:
    """One row of a table.

    Args:
        cells: Their text, made `plain`.

    Returns:
        One line, without its line break.
    """
    return "| " + " | ".join(plain(cell) for cell in cells) + " |"


def marked_row(cells: Sequence[str]) -> str:
    """One row of a table whose cells are Markdown already, as what the code says of itself; never text from a file.

    Args:
        cells: Of one line each; only what would end a cell is escaped.

    Returns:
        One line, without its line break.
    """
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def head(headings: Sequence[str]) -> list[str]:
    """First two lines of a table: its headings, and the rule that Markdown wants under them.

    Args:
        headings: Of the columns.

    Returns:
        Two lines of as many cells as there are headings.
    """
    return [row(headings), row(["---"] * len(headings))]


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A whole table, with an empty line behind it.

    Args:
        headings: Of the columns.
        rows: Cells of each row.

    Returns:
        2 + len(rows) + 1 lines.
    """
    return [*head(headings), *(row(cells) for cells in rows), ""]


def number(value: float, digits: int, sign: Sign = "") -> str:
    """A number as a cell.

    Args:
        value: NaN if there is none.
        digits: Behind the point.
        sign: "+" to write the sign of what is positive too, as of a difference.

    Returns:
        "-" where there is nothing to tell.
    """
    return "-" if isnan(value) else f"{value:{sign}.{digits}f}"


def bounds(low: float, high: float, digits: int = 3, sign: Sign = "") -> str:
    """The ends of an interval as a cell.

    Args:
        low: NaN if there is no interval.
        high: The other end.
        digits: Behind the point.
        sign: See `number`.

    Returns:
        "-" where there is nothing to tell.
    """
    return "-" if isnan(low) else f"{number(low, digits, sign)} to {number(high, digits, sign)}"


def interval(mean: float, low: float, high: float, digits: int = 3, sign: Sign = "") -> str:
    """A mean with its interval, as far as there is one, as a cell.

    Args:
        mean: NaN if there is none.
        low: NaN if there is no interval.
        high: The other end.
        digits: Behind the point.
        sign: See `number`.

    Returns:
        "-" where there is nothing to tell.
    """
    alone = isnan(mean) or isnan(low)
    return number(mean, digits, sign) + ("" if alone else f" ({bounds(low, high, digits, sign)})")
