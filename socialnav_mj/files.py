"""Files that appear whole or not at all, with equal bytes for equal content."""

import csv
import fcntl
import io
import json
import math
import os
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

_PART = re.compile(r"\..+\.(\d+)\.part(\.[^.]*)?")


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary path beside the target that replaces it when the block ends, and vanishes if the block fails.

    The first file that a process writes into a folder clears it of what dead writers left.

    Args:
        path: File to be written; its folders are made.

    Yields:
        Path to write to, with the target's suffix; there is an empty file.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _clear_once(path.parent.resolve(), os.getpid())
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        with part.open("wb") as file:
            # Others see by the lock that this file is being written, also those on another machine or in a container.
            with suppress(OSError):  # a file system without locks: the process's number has to do
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def check_output(folder: str | Path) -> None:
    """Refuse a folder that cannot be written to, before the work that is to end there.

    Args:
        folder: It need not be there.

    Raises:
        ValueError: If it, or what it would be in, is a file.
        PermissionError: If nothing can be written there.
    """
    folder = Path(folder)
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise ValueError(
            f"output folder {str(folder)!r} is not allowed: {there} is a file; allowed: a folder, or a new name"
        )
    if not os.access(there, os.W_OK | os.X_OK):
        raise PermissionError(f"output folder {str(folder)!r} is not allowed: nothing can be written to {there}")


def finished_files(folder: str | Path, suffix: str) -> list[Path]:
    """Files of a folder that are whole: not those that `written_whole` is writing, or that an interruption left.

    Args:
        folder: Its own files alone are looked at; it need not be there.
        suffix: Of their names, such as ".npz".

    Returns:
        Paths in alphabetical order.
    """
    return sorted(Path(folder).glob(f"[!.]*{suffix}"))


def clear_leftovers(folder: str | Path) -> None:
    """Remove the temporary files of `written_whole` that dead processes left in a folder.

    A file stays whose process lives, unless that began after the file was last written: its number was given anew. A
    file stays that somebody holds the lock of: its writer is on another machine, or in another container.

    Args:
        folder: Its own files alone are looked at; it need not be there.
    """
    for part in Path(folder).glob(".*.part*"):
        name = _PART.fullmatch(part.name)
        try:
            if name and not _is_written(part, int(name[1])):
                part.unlink()
        except FileNotFoundError:
            continue  # its writer was quicker, or another one who clears up


@lru_cache(maxsize=1024)
def _clear_once(folder: Path, _process: int) -> None:
    clear_leftovers(folder)


def _is_written(part: Path, process: int) -> bool:
    """Whether somebody may still be writing a temporary file."""
    if part.stat().st_mtime > _began(process):
        return True
    with part.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
    return False


def _began(process: int) -> float:
    """When a process began [s since the epoch]; infinity if none of this number lives."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return float("inf")
    if fields[0] in "ZX":
        return float("inf")
    # proc(5): field 22, where these begin with field 3, in clock ticks since the machine started.
    since_start = int(fields[19]) / os.sysconf("SC_CLK_TCK")
    return time.time() - time.clock_gettime(time.CLOCK_BOOTTIME) + since_start


def write_whole(path: str | Path, content: bytes) -> Path:
    """Write bytes to a file, whole or not at all.

    Args:
        path: File to be written; its folders are made.
        content: All of it.

    Returns:
        The path written.
    """
    with written_whole(path) as part:
        part.write_bytes(content)
    return Path(path)


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write JSON, equal bytes for equal content.

    Args:
        path: JSON file to be written.
        content: JSON values.
    """
    write_whole(path, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode())


def csv_bytes(columns: Sequence[str], rows: Iterable[Mapping[str, Any]], *, number: str = "") -> bytes:
    """A table as CSV, equal bytes for equal content.

    Args:
        columns: In their order.
        rows: Value of every column; NaN is written as nothing.
        number: How numbers with a point are written, as in `format`; by default with all digits that tell them apart.

    Returns:
        UTF-8 text, a line for the columns and one for each row.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {key: _number(value, number) if isinstance(value, float) else value for key, value in row.items()}
        )
    return text.getvalue().encode()


def _number(value: float, number: str) -> str:
    return "" if math.isnan(value) else format(value, number)
