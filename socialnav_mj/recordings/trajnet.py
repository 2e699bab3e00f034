"""Reader of TrajNet++ ndjson (Kothari et al. 2021)."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.recordings.fields import FormatError, number, shown, text_lines, whole_number
from socialnav_mj.recordings.samples import Row, Samples, samples_of_rows

# Numbers stay text until they are parsed exactly; NaN and Infinity, which Python reads, become text that is refused.
_DECODER = json.JSONDecoder(parse_int=str, parse_float=str, parse_constant=str)


def read_ndjson(path: Path) -> tuple[Samples, float | None]:
    """Read TrajNet++ lines.

    Positions are `{"track": {"f": frame, "p": id, "x": metres, "y": metres}}`; of the scenes,
    `{"scene": {..., "fps": rows a second}}`, only fps is used. Rows of predictions (with `prediction_number`) are no
    recordings and are refused.

    Args:
        path: UTF-8 text, one JSON object a line.

    Returns:
        The rows, and the frame rate that the scenes state: their `fps` counts rows, so it is multiplied by the
        commonest step between two rows of a person; None if no scene states it [Hz].

    Raises:
        FormatError: At the first mistake, or if scenes state different `fps`.
    """
    stated: list[float] = []
    samples = samples_of_rows(path, _tracks(path, stated))
    return samples, stated[0] * _commonest_step(samples) if stated else None


def _tracks(path: Path, rates: list[float]) -> Iterator[Row]:
    """Rows of a file, and into `rates` the `fps` of its scenes."""
    for i, line in enumerate(text_lines(path), 1):
        if not line.strip():
            continue
        match _object(path, i, line):
            case {"track": {"prediction_number": str()}}:
                raise FormatError(path, i, "a predicted position", "recorded positions only")
            case {"track": {"f": str(frame), "p": str(person), "x": str(x), "y": str(y)}}:
                at, who = whole_number(frame, path, i, "f"), whole_number(person, path, i, "p")
                yield i, at, who, number(x, path, i, "x"), number(y, path, i, "y")
            case {"track": _}:
                raise FormatError(path, i, shown(line), "a track with the numbers f, p, x and y")
            case {"scene": {"fps": str(fps)}}:
                rate = number(fps, path, i, "fps")
                if rate <= 0.0 or rates not in ([], [rate]):
                    wanted = f"{rates[0]:g}" if rates else "a number > 0"
                    raise FormatError(path, i, f"fps is {rate:g}", f"{wanted}, the same in all scenes")
                rates[:] = [rate]
            case {"scene": {"fps": _}}:
                raise FormatError(path, i, shown(line), "a number as fps")
            case {"scene": _}:
                pass
            case _:
                raise FormatError(path, i, shown(line), 'an object with "track" or "scene"')


def _object(path: Path, line: int, text: str) -> Any:
    try:
        return _DECODER.decode(text)
    except json.JSONDecodeError as error:
        given = f"no JSON ({error.msg}, column {error.colno})"
    except RecursionError:
        given = "JSON that is nested too deeply"
    raise FormatError(path, line, given, "one JSON object a line")


def _commonest_step(samples: Samples) -> int:
    """Commonest difference between consecutive frames of a person; 1 if nobody has two."""
    order = np.lexsort((samples.frame, samples.person))
    step = np.diff(samples.frame[order])[np.diff(samples.person[order]) == 0]
    values, counts = np.unique(step[step > 0], return_counts=True)
    return int(values[counts.argmax()]) if len(values) else 1
