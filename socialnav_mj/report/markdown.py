"""Tables in Markdown."""

from collections.abc import Sequence


def row(cells: Sequence[str]) -> str:
    """A row of a table.

    Args:
        cells: Their text; a bar in it is escaped.

    Returns:
        One line.
    """
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


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
