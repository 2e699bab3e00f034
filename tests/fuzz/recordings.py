"""Recordings in every format."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from .target import Target

TINY = Path(__file__).parents[1] / "data" / "tiny" / "tiny.txt"
Row = tuple[int, int, float, float]
"""Frame, id, x, y."""
_HOMOGRAPHY = "0.02 0 7\n0 0.025 6\n0 0 1\n"


def _reading_errors() -> tuple[type[Exception], ...]:
    from socialnav_mj.recordings.fields import FormatError

    return (FormatError,)


def _load_recording(path: Path) -> None:
    from socialnav_mj.recordings import load_recording
    from socialnav_mj.recordings.plausibility import doubts

    recording = load_recording(path, warn=False)
    doubts(recording)
    crowd = recording.at(np.linspace(0.0, recording.duration, 7))
    for values in (crowd.position, crowd.velocity, crowd.heading):
        assert np.isfinite(values[crowd.present]).all(), "a person who is present is nowhere"


def _recording(name: str, suffix: str, *formats: Callable[[list[Row]], str]) -> Target:
    def read(content: bytes, folder: Path) -> None:
        path = folder / f"a{suffix}"
        path.write_bytes(content)
        if suffix == ".vsp":
            (folder / "H.txt").write_text(_HOMOGRAPHY)
        _load_recording(path)

    return Target(
        name=f"readers/{name}",
        # A short one too: it is read faster, and what is damaged in it matters more often.
        seeds=lambda: [write(rows).encode() for write in formats for rows in (_rows(), _rows()[:9])],
        read=read,
        refuses=_reading_errors,
    )


def _read_homography(content: bytes, folder: Path) -> None:
    (folder / "H.txt").write_bytes(content)
    (folder / "a.vsp").write_text(_vsp(_rows()))
    _load_recording(folder / "a.vsp")


@cache
def _rows() -> list[Row]:
    lines = (line.split() for line in TINY.read_text().splitlines() if not line.startswith("#"))
    return [(int(f), int(i), float(x), float(y)) for f, i, x, y in lines]


def _text(rows: list[Row]) -> str:
    return "# frame, id, x, y [m]\n" + "".join(f"{f} {i} {x} {y}\n" for f, i, x, y in rows)


def _csv(rows: list[Row]) -> str:
    return "id,frame,class,y,x\n" + "".join(f'{i},{f},"a b",{y},{x}\n' for f, i, x, y in rows)


def _remarks(rows: list[Row]) -> str:
    return "# framerate: 16.0\n#ID\tFR\tX\tY\tZ\n" + "".join(f"{i}\t{f}\t{x}\t{y}\t0\n" for f, i, x, y in rows)


def _obsmat(rows: list[Row]) -> str:
    return "".join(f"{f:e} {i:e} {x} 0 {y} 1 0 1\n" for f, i, x, y in rows)


def _ndjson(rows: list[Row]) -> str:
    lines = [{"scene": {"id": 0, "p": 1, "s": 0, "e": 190, "fps": 2.5, "tag": [2, []]}}]
    lines += [{"track": {"f": f, "p": i, "x": x, "y": y}} for f, i, x, y in rows]
    return "".join(f"{json.dumps(line)}\n" for line in lines)


def _vsp(rows: list[Row]) -> str:
    lines = ["3 - the number of splines"]
    for person in (1, 2, 3):
        own = [row for row in rows if row[1] == person]
        lines.append(f"{len(own)} - Num of control points")
        lines += [f"{50 * x:.6f} {40 * y:.6f} {f} 90.0 - (2D point, m_id)" for f, _, x, y in own]
    return "\n".join([*lines, "0 - the number of obstacles", ""])


def _catalogue() -> list[bytes]:
    from socialnav_mj.resources import data_folder

    return [(data_folder() / "catalogue.toml").read_bytes()]


def _read_catalogue(content: bytes, folder: Path) -> None:
    from socialnav_mj.recordings.catalogue import read_catalogue

    path = folder / "catalogue.toml"
    path.write_bytes(content)
    for row in read_catalogue(path).values():
        assert (folder / row.folder).resolve().is_relative_to(folder.resolve()), "a folder elsewhere"


RECORDINGS = (
    _recording("text", ".txt", _text),
    _recording("table", ".csv", _csv, _remarks),
    _recording("obsmat", ".txt", _obsmat),
    _recording("ndjson", ".ndjson", _ndjson),
    _recording("vsp", ".vsp", _vsp),
    Target(
        name="readers/homography",
        seeds=lambda: [_HOMOGRAPHY.encode(), b"-0.03 0.002 7.8\n0.001 0.02 5.5\n1e-4 -2e-4 1\n"],
        read=_read_homography,
        refuses=_reading_errors,
    ),
    Target(name="readers/catalogue", seeds=_catalogue, read=_read_catalogue, refuses=_reading_errors),
)
