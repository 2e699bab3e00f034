"""Files that appear whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
