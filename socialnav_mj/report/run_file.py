"""run.json: what whoever made a run's episodes says of them."""

import json
from dataclasses import dataclass
from pathlib import Path

RUN_FILE = "run.json"
"""Stands beside the folder of the episodes."""


@dataclass(frozen=True, kw_only=True)
class RunFile:
    """What run.json says of the episodes beside it."""

    command: str
    """That made them."""
    controllers: tuple[str, ...]
    """Their order in tables."""
    episodes: tuple[str, ...]
    """Names of all files that belong to the run."""


def read_run_file(path: Path) -> RunFile | None:
    """Read run.json.

    Args:
        path: The file.

    Returns:
        What it says; None if there is no such file.

    Raises:
        ValueError: If it is not what is expected; says what is.
    """
    if not path.exists():
        return None
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {error}") from error
    lists = ("controllers", "episodes")
    if (
        not isinstance(run, dict)
        or not isinstance(run.get("command"), str)
        or not all(isinstance(run.get(key), list) and all(isinstance(v, str) for v in run[key]) for key in lists)
    ):
        expected = '{"command": a string, "controllers": [names in their order], "episodes": [names of files]}'
        raise ValueError(f"{path}: expected {expected}; given {str(run)[:200]}")
    return RunFile(command=run["command"], controllers=tuple(run["controllers"]), episodes=tuple(run["episodes"]))
