"""Draws the figure of the house in CONTRIBUTING.md from the architecture test's table and the rooms' first lines.

Run `python tests/house.py` after a change of either; `test_docs.py` holds that the figure is current.
"""

import ast
from itertools import zip_longest
from pathlib import Path
from textwrap import wrap

from test_architecture import ROOT, ROWS

PAGE = ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- house: python tests/house.py -->\n```text\n", "```\n<!-- end of house -->"
WIDTH = 100


def source_of(room: str) -> Path:
    """The file whose first line says what a room is for."""
    base = ROOT if room == "tasks" else ROOT / "socialnav_mj"
    path = base.joinpath(*room.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def purpose(room: str) -> str:
    """First line of a room's docstring, as plain text without its full stop."""
    text = ast.get_docstring(ast.parse(source_of(room).read_text(encoding="utf-8")))
    assert text, f"{source_of(room)} does not say what it is for"
    return text.splitlines()[0].rstrip(".").replace("`", "")


def figure() -> str:
    """The table of rooms as a house of text: a storey for each row, a line for each room."""
    rooms = [sorted(row) for row in ROWS]
    name = max(len(room) for row in rooms for room in row)
    text = WIDTH - name - 7
    rule = f"+{'-' * (name + 2)}+{'-' * (text + 2)}+"
    lines = [rule]
    for row in rooms:
        for room in row:
            for label, line in zip_longest([room], wrap(purpose(room), text), fillvalue=""):
                lines.append(f"| {label:{name}} | {line:{text}} |")
        lines.append(rule)
    return "\n".join(lines) + "\n"


def with_figure(page: str) -> str:
    """A page with its figure drawn anew."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + figure() + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(with_figure(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
