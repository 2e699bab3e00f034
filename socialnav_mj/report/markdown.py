"""Tables in Markdown."""

import re
from collections.abc import Sequence

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
    """A row of a table.

    Args:
        cells: Their text, made `plain`.

    Returns:
        One line.
    """
    return "| " + " | ".join(plain(cell) for cell in cells) + " |"


def head(headings: Sequence[str]) -> list[str]:
    """What a table begins with.

    Args:
        headings: Of the columns.

    Returns:
        Two lines.
    """
    return [row(headings), row(["---"] * len(headings))]


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A whole table, with an empty line behind it.

    Args:
        headings: Of the columns.
        rows: Cells of each row.

    Returns:
        Lines.
    """
    return [*head(headings), *(row(cells) for cells in rows), ""]
