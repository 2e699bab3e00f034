"""One way to read a recording from a file or folder, whatever its format."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, get_args

from socialnav_mj.recordings.recording import Recording
from socialnav_mj.recordings.samples import FormatError
from socialnav_mj.recordings.trajnet import read_ndjson, read_text
from socialnav_mj.recordings.ucy import AxisOrder, read_obsmat, read_vsp

Variant = Literal["vsp", "obsmat", "text", "ndjson"]
DEFAULT_FRAME_RATE = 25.0
"""Of the UCY videos, and so of the frame numbers of every format that does not state its own [Hz]."""


def sha256(paths: Sequence[Path]) -> str:
    """Checksum of files, read one after the other.

    Args:
        paths: The files.

    Returns:
        64 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def source_files(path: Path, variant: Variant | None) -> tuple[Variant, tuple[Path, ...]]:
    """Which files make up the recording at a path, and their format.

    In a folder, the first that exists is taken: the only `*.vsp` with `H.txt`, `obsmat.txt`, the only `*.ndjson`, the
    only `*.txt` of four columns. A `.vsp` file needs `H.txt` beside it. Any other file is recognised by its first
    line: `{` is ndjson, eight numbers are obsmat, four are text.

    Args:
        path: File or folder.
        variant: The format, if it is to be stated rather than recognised.

    Returns:
        The format and its files.

    Raises:
        FileNotFoundError: If the path or a file it needs does not exist.
        ValueError: If the format is unknown, or the folder holds several recordings or none.
    """
    if variant is not None and variant not in get_args(Variant):
        raise ValueError(f"unknown variant {variant!r}; available: {', '.join(get_args(Variant))}")
    if path.is_dir():
        return _files_in_folder(path, variant)
    if not path.is_file():
        raise FileNotFoundError(f"no file or folder {path}")
    found = variant or _recognised(path)
    if found is None:
        raise FormatError(path, None, "not recognised", f"one of the formats {', '.join(get_args(Variant))}")
    return found, (path, _beside(path, "H.txt")) if found == "vsp" else (path,)


def read_recording(
    files: tuple[Path, ...],
    *,
    name: str,
    variant: Variant,
    frame_rate: float | None = None,
    axis_order: AxisOrder = "xy",
) -> Recording:
    """Read a recording.

    Args:
        files: As `source_files` returns them.
        name: Of the recording.
        variant: The format.
        frame_rate: Of the frame numbers; None takes what the file states (ndjson), else `DEFAULT_FRAME_RATE` [Hz].
        axis_order: What the homography of a vsp takes.

    Returns:
        The recording.

    Raises:
        FormatError: At the first mistake in a file.
    """
    stated: float | None = None
    match variant:
        case "vsp":
            samples = read_vsp(files[0], files[1], axis_order=axis_order)
        case "obsmat":
            samples = read_obsmat(files[0])
        case "text":
            samples = read_text(files[0])
        case "ndjson":
            samples, stated = read_ndjson(files[0])
    rate = frame_rate or stated or DEFAULT_FRAME_RATE
    return samples.recording(name=name, variant=variant, frame_rate=rate, checksum=sha256(files))


def _files_in_folder(folder: Path, variant: Variant | None) -> tuple[Variant, tuple[Path, ...]]:
    candidates: dict[Variant, list[Path]] = {
        "vsp": sorted(folder.glob("*.vsp")),
        "obsmat": sorted(folder.glob("obsmat.txt")),
        "ndjson": sorted(folder.glob("*.ndjson")),
        "text": [p for p in sorted(folder.glob("*.txt")) if _recognised(p) == "text"],
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
    with path.open(encoding="utf-8", errors="replace") as file:
        line = next((text for text in (line.partition("#")[0].strip() for line in file) if text), "")
    if line.startswith("{"):
        return "ndjson"
    fields = line.replace(",", " ").split()
    try:
        [float(text) for text in fields]
    except ValueError:
        return None
    by_columns: dict[int, Variant] = {8: "obsmat", 4: "text"}
    return by_columns.get(len(fields))
