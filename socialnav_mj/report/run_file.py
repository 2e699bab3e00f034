"""run.json: what whoever made a run's episodes says of them."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from socialnav_mj.files import write_whole

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
    metrics: tuple[str, ...] = ()
    """Own metrics in its tables, as `own_metrics.own_metrics` takes them."""


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
    lists = ("controllers", "episodes", "metrics")
    run = {"metrics": [], **run} if isinstance(run, dict) else {}
    if not isinstance(run.get("command"), str) or not all(
        isinstance(run.get(key), list) and all(isinstance(v, str) for v in run[key]) for key in lists
    ):
        expected = (
            '{"command": a string, "controllers": [names in their order], "episodes": [names of files], "metrics": '
            "[own ones, or none]}"
        )
        raise ValueError(f"{path}: expected {expected}; given {str(run)[:200]}")
    return RunFile(command=run["command"], **{key: tuple(run[key]) for key in lists})


def write_run_file(path: Path, run: RunFile) -> None:
    """Write run.json.

    Args:
        path: The file.
        run: What it says; own metrics only if there are some.
    """
    content = {key: value for key, value in asdict(run).items() if value or key != "metrics"}
    write_whole(path, (json.dumps(content, indent=1) + "\n").encode())
