"""Readers of TrajNet-style text (frame id x y) and of TrajNet++ ndjson (Kothari et al. 2021)."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.recordings.samples import FormatError, Row, Samples, number, samples_of_rows, text_lines, whole_number


def read_text(path: Path) -> Samples:
    """Read lines `frame id x y`, separated by spaces, tabs or commas; empty lines and lines after `#` are skipped.

    Args:
        path: The file.

    Returns:
        The rows.

    Raises:
        FormatError: At the first mistake.
    """
    rows: list[Row] = []
    for i, line in enumerate(text_lines(path), 1):
        values = line.partition("#")[0].replace(",", " ").split()
        if not values:
            continue
        if len(values) != 4:
            raise FormatError(path, i, f"{len(values)} numbers", "4: frame id x y")
        frame, person = whole_number(values[0], path, i, "frame"), whole_number(values[1], path, i, "id")
        rows.append((i, frame, person, number(values[2], path, i, "x"), number(values[3], path, i, "y")))
    return samples_of_rows(path, rows)


def read_ndjson(path: Path) -> tuple[Samples, float | None]:
    """Read TrajNet++ lines.

    Positions are `{"track": {"f": frame, "p": id, "x": metres, "y": metres}}`; of the scenes,
    `{"scene": {..., "fps": rows a second}}`, only fps is used. Rows of predictions (with `prediction_number`) are no
    recordings and are refused.

    Args:
        path: The file.

    Returns:
        The rows, and the frame rate that the scenes state: their `fps` counts rows, so it is multiplied by the
        commonest step between two rows of a person; None if no scene states it [Hz].

    Raises:
        FormatError: At the first mistake, or if scenes state different `fps`.
    """
    rows: list[Row] = []
    row_rate: float | None = None
    for i, line in enumerate(text_lines(path), 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
        except json.JSONDecodeError as error:
            raise FormatError(
                path, i, f"no JSON ({error.msg}, column {error.colno})", "one JSON object a line"
            ) from None
        match entry:
            case {"track": {"prediction_number": int()}}:
                raise FormatError(path, i, "a predicted position", "recorded positions only")
            case {"track": {"f": frame, "p": person, "x": x, "y": y}}:
                at, who = whole_number(str(frame), path, i, "f"), whole_number(str(person), path, i, "p")
                rows.append((i, at, who, number(str(x), path, i, "x"), number(str(y), path, i, "y")))
            case {"track": _}:
                raise FormatError(path, i, f"track {_short(entry['track'])}", "a track with f, p, x and y")
            case {"scene": {"fps": fps}}:
                stated = number(str(fps), path, i, "fps")
                if stated <= 0.0 or row_rate not in (None, stated):
                    raise FormatError(
                        path, i, f"fps is {stated:g}", f"{row_rate or 'a number > 0'}, the same in all scenes"
                    )
                row_rate = stated
            case {"scene": _}:
                pass
            case _:
                raise FormatError(path, i, _short(entry), 'an object with "track" or "scene"')
    samples = samples_of_rows(path, rows)
    return samples, None if row_rate is None else row_rate * _commonest_step(samples)


def _commonest_step(samples: Samples) -> int:
    """Commonest difference between consecutive frames of a person; 1 if nobody has two."""
    order = np.lexsort((samples.frame, samples.person))
    step = np.diff(samples.frame[order])[np.diff(samples.person[order]) == 0]
    values, counts = np.unique(step[step > 0], return_counts=True)
    return int(values[counts.argmax()]) if len(values) else 1


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
