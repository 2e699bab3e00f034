"""Known recordings: where they come from, where they are looked for, what they must contain."""

import logging
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pooch

from socialnav_mj.recordings.fields import FormatError, shown, text_lines
from socialnav_mj.recordings.plausibility import doubts
from socialnav_mj.recordings.readers import Variant, read_recording, sha256, source_files
from socialnav_mj.recordings.reading import DEFAULT_READING, FRAME_RATES, AxisOrder, Reading
from socialnav_mj.recordings.recording import Recording
from socialnav_mj.resources import data_folder

logger = logging.getLogger(__name__)

UNKNOWN = "unknown"
"""Stands for a sha256 that whoever wrote the catalogue could not compute; such files are never called verified."""
DATA_VARIABLE = "SOCIALNAV_MJ_DATA"
"""Environment variable that names a data directory."""


@dataclass(frozen=True, kw_only=True)
class CatalogueRow:
    """A table of `data/catalogue.toml`: what a recording is, where its files are and how they are read."""

    name: str
    title: str
    folder: str
    """Below a data directory, or below the embedded `data` folder if there is no url."""
    url: str | None
    """Address below which the folder's files are downloaded; None for an embedded recording."""
    source: str
    licence: str
    frame_rate: float
    """Of the frame numbers in the files [Hz]."""
    scale: str
    """How the files' unit becomes metres, in words."""
    axis_order: AxisOrder
    """Whether the homography of the vsp takes (x, y) or (y, x)."""
    variants: Mapping[Variant, Mapping[str, str]]
    """Per variant: file names with their sha256 (or "unknown"), in reading order; the first variant is the default."""
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    """Addresses of files that are not below `url`."""
    simulated: bool = False
    """Whether a simulation made the people."""

    def address(self, file: str) -> str:
        """Where a file is downloaded from."""
        return self.elsewhere.get(file, f"{self.url}{file}")


@cache
def catalogue() -> Mapping[str, CatalogueRow]:
    """All known recordings by name, from `data/catalogue.toml`.

    Returns:
        Name: row, in the order of the file; read once a process.
    """
    return read_catalogue(data_folder() / "catalogue.toml")


def read_catalogue(path: Path) -> dict[str, CatalogueRow]:
    """Read a catalogue.

    Args:
        path: A TOML file with a table a recording, whose keys are the fields of `CatalogueRow`.

    Returns:
        Rows in the order of the file.

    Raises:
        FormatError: If it is something else, or a field is not what it should be.
    """
    try:
        rows = tomllib.loads("\n".join(text_lines(path)))
    except (ValueError, RecursionError) as error:  # an integer of 5,000 digits is a plain ValueError
        raise FormatError(path, None, f"no TOML ({shown(str(error))})", "a table a recording") from None
    return {name: _row(path, name, {**_DEFAULTS, **row} if isinstance(row, dict) else {}) for name, row in rows.items()}


_DEFAULTS: dict[str, Any] = {"url": None, "elsewhere": {}, "simulated": False}
"""Of fields that a row may leave out."""


def _row(path: Path, name: str, values: dict[str, Any]) -> CatalogueRow:
    def require(holds: bool, what: str, expected: str) -> None:
        if not holds:
            raise FormatError(path, None, f"{what} of the recording '{shown(name)}' is not allowed", expected)

    wanted = {own.name for own in fields(CatalogueRow)} - {"name"}
    require(values.keys() == wanted, "the set of fields", ", ".join(sorted(wanted)))
    for key in ("title", "folder", "source", "licence", "scale"):
        require(isinstance(values[key], str), key, "a text")
    require(_is_below(values["folder"]), "folder", "a path below the data directory")
    url, rate = values["url"], values["frame_rate"]
    require(url is None or (isinstance(url, str) and url.startswith("https://")), "url", "https://...")
    is_number = isinstance(rate, float | int) and not isinstance(rate, bool)
    require(is_number and FRAME_RATES[0] <= rate <= FRAME_RATES[1], "frame_rate", "a number of Hz")
    require(values["axis_order"] in get_args(AxisOrder), "axis_order", " or ".join(get_args(AxisOrder)))
    require(isinstance(values["simulated"], bool), "simulated", "true or false")
    places = values["elsewhere"]
    require(
        isinstance(places, dict) and all(isinstance(at, str) and at.startswith("https://") for at in places.values()),
        "elsewhere",
        "file names with https://...",
    )
    variants = values["variants"]
    require(isinstance(variants, dict) and bool(variants), "variants", "a table a variant")
    for variant, files in variants.items():
        require(variant in get_args(Variant), f"variant {shown(variant)}", ", ".join(get_args(Variant)))
        require(isinstance(files, dict) and bool(files), variant, "file names with their sha256")
        for file, digest in files.items():
            plain = "/" not in file and _is_below(file)
            known = digest == UNKNOWN or bool(re.fullmatch("[0-9a-f]{64}", str(digest)))
            require(plain and known, variant, "file names with their sha256")
    return CatalogueRow(name=name, **values)


def _is_below(path: str) -> bool:
    return path.isprintable() and bool(path) and not Path(path).is_absolute() and ".." not in Path(path).parts


def catalogue_row(name: str) -> CatalogueRow:
    """What the catalogue says of a recording.

    Args:
        name: As it stands in `data/catalogue.toml`.

    Returns:
        Source, frame rate, scale, and files with their sha256.

    Raises:
        ValueError: If the catalogue has no such name; lists those that it has.
    """
    if name not in catalogue():
        raise ValueError(f"unknown recording {name!r}; available: {', '.join(catalogue())}, or the path of one")
    return catalogue()[name]


def data_directories(data_dir: str | Path | None = None) -> tuple[Path, ...]:
    """Where downloaded recordings are looked for, in this order.

    Args:
        data_dir: Comes before all others; None if none is given.

    Returns:
        `data_dir`, the directory named by SOCIALNAV_MJ_DATA, and the user's cache, as far as they are set.
    """
    given = [data_dir, os.environ.get(DATA_VARIABLE) or None, pooch.os_cache("socialnav-mj")]
    return tuple(Path(folder).expanduser() for folder in given if folder is not None)


def load_recording(
    name_or_path: str | Path,
    *,
    variant: str | None = None,
    data_dir: str | Path | None = None,
    reading: Reading = DEFAULT_READING,
    warn: bool = True,
) -> Recording:
    """Load a recording by its name in the catalogue or by the path of a file or folder.

    A catalogue name wins over a path of the same spelling (write `./name` for the path). Files found by name are
    checked against their sha256. Files given by path whose sha256 the catalogue knows take its frame rate and axis
    order; of others the frame rate is what the file states or 25 Hz, and the axis order is "xy". The recording says
    which of these it was (`frame_rate_origin`), and what looks wrong with its scale is logged as a warning.

    Args:
        name_or_path: For example `plaza`, `students003` or `recordings/mine.txt`.
        variant: Which of several annotations; None takes the catalogue's first, or what the file at a path looks like.
        data_dir: Where files of the catalogue are looked for first; None means SOCIALNAV_MJ_DATA, then the user cache.
        reading: What the file does not say, or says wrongly, and bounds on what it may hold.
        warn: Whether to log what looks wrong with its scale in space or time.

    Returns:
        Its people as tracks in metres and seconds.

    Raises:
        ValueError: If the name, the variant or the format is unknown, or a file is not what it should be.
        FileNotFoundError: If the files are nowhere; says where they were looked for and what helps.
    """
    row: CatalogueRow | None
    if str(name_or_path) in catalogue():
        row = catalogue_row(str(name_or_path))
        name, kind = row.name, _variant(row, variant)
        files = _find(row, kind, data_dir)
        _verify(row, kind, files)
        if reading.columns:
            raise ValueError(f"columns = {' '.join(reading.columns)} is not allowed for a recording of the catalogue")
    else:
        path = Path(name_or_path).expanduser()
        if not path.exists():
            raise FileNotFoundError(
                f"no recording {str(name_or_path)!r}: it is neither in the catalogue ({', '.join(catalogue())}) "
                f"nor a file or folder"
            )
        kind, files = source_files(path, _stated(variant), columns=reading.columns)
        name = path.resolve().stem
        row = _known_by_checksum(kind, files)
    recording = read_recording(
        files,
        name=name,
        variant=kind,
        reading=reading,
        known_rate=None if row is None else row.frame_rate,
        known_axis_order=None if row is None else row.axis_order,
    )
    if warn:
        unknown = (
            [] if row is None else [file for file, digest in row.variants.get(kind, {}).items() if digest == UNKNOWN]
        )
        for doubt in (*not_verified(unknown, recording.checksum), *doubts(recording)):
            logger.warning("%s: %s", name_or_path, doubt)
    return recording


def not_verified(unknown: Sequence[str], checksum: str) -> tuple[str, ...]:
    """What is said of files whose sha256 the catalogue does not know.

    Args:
        unknown: Names of the files.
        checksum: Of all files of the recording.

    Returns:
        A sentence for a warning; none if there are none.
    """
    if not unknown:
        return ()
    return (
        f"not verified: the catalogue knows no sha256 of {' and '.join(unknown)}; theirs here is "
        f"{checksum}, which every episode keeps",
    )


def _variant(row: CatalogueRow, variant: str | None) -> Variant:
    for known in row.variants:
        if variant in (None, known):
            return known
    raise ValueError(f"recording {row.name!r} has no variant {variant!r}; available: {', '.join(row.variants)}")


def _stated(variant: str | None) -> Variant | None:
    if variant is None:
        return None
    known: Variant
    for known in get_args(Variant):
        if known == variant:
            return known
    raise ValueError(f"unknown variant {variant!r}; available: {', '.join(get_args(Variant))}")


def _find(row: CatalogueRow, variant: Variant, data_dir: str | Path | None) -> tuple[Path, ...]:
    roots = data_directories(data_dir) if row.url else (data_folder(),)
    for root in roots:
        files = tuple(root / row.folder / name for name in row.variants[variant])
        if all(file.is_file() for file in files):
            return files
    wanted = " and ".join(f"{row.folder}/{name}" for name in row.variants[variant])
    looked = ", ".join(map(str, roots))
    raise FileNotFoundError(
        f"recording {row.name!r} is not on this machine: no {wanted} in {looked}. "
        f"Download it with `socialnav-mj data fetch {row.name}`, or say where it is with "
        f"`export {DATA_VARIABLE}=DIRECTORY` or --data-dir DIRECTORY"
    )


def _verify(row: CatalogueRow, variant: Variant, files: tuple[Path, ...]) -> None:
    for file, expected in zip(files, row.variants[variant].values(), strict=True):
        if expected == UNKNOWN:
            continue
        given = sha256([file])
        if given != expected:
            raise ValueError(
                f"{file}: sha256 {given}; the catalogue expects {expected}. Remove the file and run "
                f"`socialnav-mj data fetch {row.name}`, or load it by its path to use it as it is"
            )


def _known_by_checksum(variant: Variant, files: tuple[Path, ...]) -> CatalogueRow | None:
    sums = [sha256([file]) for file in files]
    rows = (row for row in catalogue().values() if list(row.variants.get(variant, {}).values()) == sums)
    return next(rows, None)
