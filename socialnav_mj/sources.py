"""Source files that something is made of: what a file imports, and what that imports, by their names alone."""

import ast
import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path


def made_of(files: Iterable[Path], root: Path, belongs: Callable[[Path], bool]) -> dict[str, str]:
    """Digests of source files and of all that they import, directly or not; nothing is imported for that.

    Args:
        files: To begin with.
        root: Folder from which absolute imports are looked up.
        belongs: Whether an imported file, and what it imports, counts.

    Returns:
        Path below `root`: sha256, in the order of the paths.

    Raises:
        OSError: If a file cannot be read.
    """
    found: dict[Path, str] = {}
    waiting = [*files]
    while waiting:
        own = waiting.pop()
        if own in found:
            continue
        content = own.read_bytes()
        found[own] = hashlib.sha256(content).hexdigest()
        waiting += [other for other in _imports(content, own, root) if belongs(other)]
    return {own.relative_to(root).as_posix(): found[own] for own in sorted(found)}


def _imports(content: bytes, file: Path, root: Path) -> Iterator[Path]:
    """Files below a folder that a source file imports, by their names alone: nothing is imported."""
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError):  # no Python source, such as an extension
        return
    for node in ast.walk(tree):
        names: list[str] = []
        base = root
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                base = file.parents[node.level - 1]
            source = node.module or ""
            names = [source, *(f"{source}.{alias.name}".lstrip(".") for alias in node.names)]
        for name in names:
            parts = [part for part in name.split(".") if part]
            for depth in range(1, len(parts) + 1):
                place = base.joinpath(*parts[:depth])
                yield from (own for own in (place.with_suffix(".py"), place / "__init__.py") if own.is_file())
