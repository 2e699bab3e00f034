"""One way to read a recording from a file or folder, whatever its format."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, TextIO, get_args

from socialnav_mj.recordings.fields import FormatError, shown
from socialnav_mj.recordings.reading import DEFAULT_READING, FRAME_RATES, AxisOrder, Reading
from socialnav_mj.recordings.recording import Recording
from socialnav_mj.recordings.tables import layout_of, read_text
from socialnav_mj.recordings.trajnet import read_ndjson
from socialnav_mj.recordings.ucy import read_obsmat, read_vsp
from socialnav_mj.recordings.window import window

Variant = Literal["vsp", "obsmat", "text", "ndjson"]
DEFAULT_FRAME_RATE = 25.0
"""Frame rate of the UCY videos, and so of the frame numbers of every format that does not state its own [Hz]."""
FORMATS = """one of
  text:   lines `frame id x y`, or a table with a header that names these columns (else say --columns)
  obsmat: lines of eight numbers `frame id x z y vx vz vy`
  ndjson: lines {"track": {"f": frame, "p": id, "x": x, "y": y}}
  vsp:    a file NAME.vsp, with the homography H.txt beside it"""
"""All formats with what they are recognised by, as error messages list them."""


def sha256(paths: Sequence[Path]) -> str:
    """Checksum of files, read one after the other.

    Args:
        paths: Their contents are joined in this order.

    Returns:
        64 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def source_files(
    path: Path, variant: Variant | None, *, columns: Sequence[str] = ()
) -> tuple[Variant, tuple[Path, ...]]:
    """Which files make up the recording at a path, and their format.

    In a folder, the first that exists is taken: the only `*.vsp` with `H.txt`, `obsmat.txt`, the only `*.ndjson`, the
    only table among `*.txt` and `*.csv`. A `.vsp` file needs `H.txt` beside it. Any other file is recognised by its
    first line: `{` is ndjson, eight numbers are obsmat, four numbers or a header with frame, id, x and y are text.

    Args:
        path: File or folder.
        variant: The format, if it is to be stated rather than recognised.
        columns: Names of a table's columns as `Reading.columns` has them; empty to recognise them.

    Returns:
        The format, and its files in the order in which `read_recording` takes them.

    Raises:
        FileNotFoundError: If the path or a file it needs does not exist.
        ValueError: If the format is unknown, or the folder holds several recordings.
    """
    if variant is not None and variant not in get_args(Variant):
        raise ValueError(f"unknown variant {variant!r}; available: {', '.join(get_args(Variant))}")
    if columns:
        if variant not in (None, "text"):
            raise ValueError(f"columns = {' '.join(columns)} is not allowed for the variant {variant!r}; allowed: text")
        variant = "text"
    if path.is_dir():
        return _files_in_folder(path, variant, columns)
    if not path.is_file():
        raise FileNotFoundError(f"no file or folder {path}")
    found = variant or _recognised(path)
    if found is None:
        line, text = _first_content(path)
        given = f"'{shown(text)}' is not recognised" if line else "nothing in it"
        raise FormatError(path, line or None, given, FORMATS)
    return found, (path, _beside(path, "H.txt")) if found == "vsp" else (path,)


def read_recording(
    files: tuple[Path, ...],
    *,
    name: str,
    variant: Variant,
    reading: Reading = DEFAULT_READING,
    known_rate: float | None = None,
    known_axis_order: AxisOrder | None = None,
) -> Recording:
    """Read the files of a recording by their format and give the rows their times and unit.

    Args:
        files: As `source_files` returns them.
        name: What the recording is called in tables and episodes.
        variant: Format of the files.
        reading: What the files do not say, or say wrongly, and bounds on what they may hold.
        known_rate: Frame rate that the catalogue states; it yields to the reading's, not to the file's [Hz].
        known_axis_order: What the catalogue says that the homography of a vsp takes; it yields to the reading's.

    Returns:
        Tracks of all people with two rows or more; `frame_rate_origin` says whose frame rate was taken.

    Raises:
        FormatError: At the first mistake in a file.
    """
    stated: float | None = None
    match variant:
        case "vsp":
            axis_order = reading.axis_order or known_axis_order or "xy"
            samples = read_vsp(files[0], files[1], axis_order=axis_order)
        case "obsmat":
            samples = read_obsmat(files[0])
        case "text":
            samples, stated = read_text(files[0], reading.columns)
        case "ndjson":
            samples, stated = read_ndjson(files[0])
    origins = {"given": reading.frame_rate, "catalogue": known_rate, "stated in the file": stated}
    origins["assumed"] = DEFAULT_FRAME_RATE
    origin, rate = next((origin, rate) for origin, rate in origins.items() if rate is not None)
    if not FRAME_RATES[0] <= rate <= FRAME_RATES[1]:
        expected = f"a frame rate from {FRAME_RATES[0]:g} to {FRAME_RATES[1]:g} Hz"
        raise FormatError(files[0], None, f"frames come at {rate:g} Hz", expected)
    recording = samples.recording(
        name=name,
        variant=variant,
        frame_rate=rate,
        frame_rate_origin=origin,
        checksum=sha256(files),
        reading=reading,
    )
    return _part(recording, files[0], reading)


def _part(recording: Recording, path: Path, reading: Reading) -> Recording:
    """What the reading leaves of a recording in time."""
    whole = recording.duration
    begin, end = reading.since or 0.0, whole if reading.until is None else min(reading.until, whole)
    if (begin, end) == (0.0, whole):
        return recording
    if begin >= whole:
        raise FormatError(path, None, f"nobody is there after {begin:g} s", "an earlier --since")
    cut = window(recording, begin / whole, end / whole)
    if not cut.n_people:
        given = f"nobody is there between {begin:g} and {end:g} s" if begin else f"nobody is there before {end:g} s"
        raise FormatError(path, None, given, "an earlier --since or a later --until" if begin else "a later --until")
    return replace(cut, variant=recording.variant)


def _files_in_folder(folder: Path, variant: Variant | None, columns: Sequence[str]) -> tuple[Variant, tuple[Path, ...]]:
    candidates: dict[Variant, list[Path]] = {
        "vsp": sorted(folder.glob("*.vsp")),
        "obsmat": sorted(folder.glob("obsmat.txt")),
        "ndjson": sorted(folder.glob("*.ndjson")),
        "text": [
            p for p in sorted([*folder.glob("*.txt"), *folder.glob("*.csv")]) if columns or _recognised(p) == "text"
        ],
    }
    for kind, files in candidates.items():
        if variant in (None, kind) and files:
            if len(files) > 1:
                names = ", ".join(p.name for p in files)
                raise ValueError(f"{folder} holds {len(files)} recordings ({names}); give the path of one of them")
            return kind, (files[0], _beside(files[0], "H.txt")) if kind == "vsp" else (files[0],)
    wanted = variant or ", ".join(get_args(Variant))
    raise FileNotFoundError(f"{folder} holds no recording of the format {wanted}")


def _beside(path: Path, name: str) -> Path:
    other = path.parent / name
    if not other.is_file():
        raise FileNotFoundError(f"{path} needs its homography (pixels to metres), a file {name} beside it")
    return other


def _recognised(path: Path) -> Variant | None:
    """Format of a file by its name and its first line with content."""
    if path.suffix == ".vsp":
        return "vsp"
    _, line = _first_content(path)
    if line.startswith("{"):
        return "ndjson"
    with _opened(path) as file:
        if layout_of(file) is not None:
            return "text"
    fields = line.replace(",", " ").split()
    try:
        [float(text) for text in fields]
    except ValueError:
        return None
    return "obsmat" if len(fields) == 8 else None


def _first_content(path: Path) -> tuple[int, str]:
    """First line that is no remark, counted from 1, without its remark; (0, "") if there is none."""
    with _opened(path) as file:
        lines = ((i, line.partition("#")[0].strip()) for i, line in enumerate(file, 1))
        return next(((i, line) for i, line in lines if line), (0, ""))


def _opened(path: Path) -> TextIO:
    return path.open(encoding="utf-8-sig", errors="replace")
