"""Files that appear whole or not at all."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary path beside the target that replaces it when the block ends, and vanishes if the block fails.

    Args:
        path: Target; its folders are made.

    Yields:
        Path to write to, with the target's suffix.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: str | Path, content: bytes) -> Path:
    """Write bytes to a file, whole or not at all.

    Args:
        path: Target; its folders are made.
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
        path: Target.
        content: JSON values.
    """
    write_whole(path, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode())
