"""Reader of tables of text: columns by place, by a header's names, or as the reading says."""

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from socialnav_mj.recordings.fields import FormatError, number, shown, text_lines, whole_number
from socialnav_mj.recordings.reading import COLUMNS
from socialnav_mj.recordings.samples import Row, Samples, samples_of_rows

HEADINGS = {
    "frame": "frame fr f frameid framenumber framenum frameindex frameno",
    "id": "id person personid ped pedid pedestrian pedestrianid agent agentid track trackid p pid",
    "x": "x posx xpos positionx worldx xcenter xworld xm",
    "y": "y posy ypos positiony worldy ycenter yworld ym",
}
"""Per column the names that a header may give it, without case, blanks, signs, and a unit in brackets or after /."""
_COLUMN_OF = {name: column for column, names in HEADINGS.items() for name in names.split()}
_FRAME_RATE = re.compile(r"#.*\bframe[ _]?rate\s*[:=]\s*([0-9][0-9.]*)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where a table's lines hold what."""

    columns: tuple[str, ...]
    """What each column is; names apart from frame, id, x, y are not read."""
    delimiter: str | None
    """Between two fields; None for blanks, tabs and commas in any number."""
    first: int
    """Line of the first row, counted from 1."""


def layout_of(lines: Iterable[str], columns: Sequence[str] = ()) -> Layout | None:
    """Recognise a table by its first line with content, and the remarks before it.

    Args:
        lines: Lines of the file; read up to the first with content.
        columns: Name of each column in the order of the file; empty to recognise them.

    Returns:
        Columns, delimiter and first row; None if the lines are no table, or nothing says what its columns are.
    """
    remark: list[str] = []
    for i, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            remark = re.split(r"[\s,;]+", text.strip("# ")) if text else remark
            continue
        delimiter = next((sign for sign in ";,\t" if sign in text), None)
        fields = _fields(text, delimiter)
        named = tuple(_column(name) for name in fields)
        is_header = not any(_is_number(field) for field in fields)
        if columns:
            return Layout(columns=tuple(columns), delimiter=delimiter, first=i + is_header)
        if is_header:
            return Layout(columns=named, delimiter=delimiter, first=i + 1) if _is_complete(named) else None
        above = tuple(_column(name) for name in remark)
        if _is_complete(above) and len(above) == len(fields):
            return Layout(columns=above, delimiter=delimiter, first=i)
        plain = text.partition("#")[0]
        # An empty field between two commas would be lost.
        if len(plain.replace(",", " ").split()) == len(COLUMNS) and not re.search(r",\s*,", plain):
            return Layout(columns=COLUMNS, delimiter=None, first=i)
        return None
    return None


def read_text(path: Path, columns: Sequence[str] = ()) -> tuple[Samples, float | None]:
    """Read a table with the columns frame, id, x, y among others.

    The columns are those given, or those that a header names (the first line, or a remark with one word a column), or,
    of four, frame id x y. With a header or given columns, fields are separated by semicolons, commas, tabs or blanks,
    whichever the first line has; else by blanks, tabs or commas in any number. Empty lines and lines that begin with
    `#` are skipped; a remark `framerate: 16` before the first row states the frame rate (as PedPy and JuPedSim write).

    Args:
        path: UTF-8 text.
        columns: Names in the order of the file; empty to recognise them.

    Returns:
        The rows, and the frame rate that a remark states; None if none does [Hz].

    Raises:
        FormatError: At the first mistake.
    """
    lines = text_lines(path)
    layout = layout_of(lines, columns)
    if layout is None:
        raise FormatError(path, None, "no table", "lines of frame id x y, or a header that names these columns")
    rate = None
    for i, line in enumerate(lines[: layout.first], 1):
        if found := _FRAME_RATE.match(line.strip()):
            rate = number(found[1], path, i, "the frame rate")
            if rate <= 0.0:
                raise FormatError(path, i, f"the frame rate is {rate:g}", "a number > 0")
    return samples_of_rows(path, _rows(path, lines, layout)), rate


def _rows(path: Path, lines: list[str], layout: Layout) -> Iterator[Row]:
    width = len(layout.columns)
    frame, person, x, y = (layout.columns.index(name) for name in COLUMNS)
    for i, fields in _split(path, lines, layout):
        if len(fields) != width:
            kind = "numbers" if layout.columns == COLUMNS else "fields"
            raise FormatError(path, i, f"{len(fields)} {kind}", f"{width}: {' '.join(layout.columns)}")
        at, who = whole_number(fields[frame], path, i, "frame"), whole_number(fields[person], path, i, "id")
        yield i, at, who, number(fields[x], path, i, "x"), number(fields[y], path, i, "y")


def _split(path: Path, lines: list[str], layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Lines with content, counted from 1, and their fields."""
    skipped = layout.first - 1
    if layout.delimiter is None:
        for i, line in enumerate(lines[skipped:], layout.first):
            if fields := line.partition("#")[0].replace(",", " ").split():
                yield i, fields
        return
    reader = csv.reader(lines[skipped:], delimiter=layout.delimiter, skipinitialspace=True, strict=True)
    try:
        for fields in reader:
            if any(fields) and not fields[0].lstrip().startswith("#"):
                yield skipped + reader.line_num, fields
    except csv.Error as error:
        raise FormatError(path, skipped + reader.line_num, f"no table ({error})", "fields, quoted or not") from None


def _fields(line: str, delimiter: str | None) -> list[str]:
    try:
        return line.split() if delimiter is None else next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return []


def _column(name: str) -> str:
    """What a heading means; itself, cut to what a message can hold, if it is not known."""
    plain = re.sub(r"[\[(/].*", "", name.casefold())
    return _COLUMN_OF.get(re.sub(r"[^a-z0-9]", "", plain), shown(name.strip()))


def _is_complete(columns: Sequence[str]) -> bool:
    return all(columns.count(name) == 1 for name in COLUMNS)


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
