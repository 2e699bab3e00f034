"""Robots by name or file: an MJCF model, and a short TOML beside it with its limits and its names for our parts."""

import tomllib
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from socialnav_mj.config import Robot
from socialnav_mj.resources import assets_folder

PARTS = ("robot", "bumper", "left_wheel", "right_wheel")
"""What a scene needs to find in a robot: its body, the geom of its footprint, and the joints of the driven wheels; the
first geom of a wheel's body is the wheel's."""
DRIVE = ("forward_gain", "forward_force", "yaw_gain", "yaw_torque")
"""Velocity servos for a model that has none named forward and yaw: gains [N s/m, N m s] and limits [N, N m]."""


@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """What the TOML of a robot says."""

    robot: Robot
    """Dimensions and limits; its model is the MJCF file's path, below the assets if it is there."""
    names: dict[str, str] = field(default_factory=dict)
    """Part: what the MJCF file calls it, where that is something else."""
    drive: dict[str, float] = field(default_factory=dict)
    """Of `DRIVE`; empty if the model brings its own servos."""


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package.

    Returns:
        In alphabetical order.
    """
    return tuple(sorted(path.stem for path in (assets_folder() / "robots").glob("*.toml")))


def read_robot(name_or_path: str | Path) -> RobotFile:
    """Read a robot.

    Args:
        name_or_path: Name of a shipped robot, path of an MJCF file with a TOML of the same name beside it, or of that
            TOML.

    Returns:
        Its configuration, and how its model is to be read.

    Raises:
        FileNotFoundError: If there is no such robot, or no TOML beside the model.
        ValueError: If the TOML says something else than it may, or a value is not allowed.
    """
    path = assets_folder() / "robots" / f"{name_or_path}.toml"
    if not path.is_file():
        path = Path(name_or_path).with_suffix(".toml")
    if not path.is_file():
        raise FileNotFoundError(
            f"no robot {str(name_or_path)!r}: available are {', '.join(shipped_robots())}, or the path of an MJCF file "
            f"with its limits in a TOML file beside it, here {path}"
        )
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is no TOML: {error}") from error
    names, drive = _table(path, values, "names", PARTS, str), _table(path, values, "drive", DRIVE, (int, float))
    if drive and len(drive) < len(DRIVE):
        raise ValueError(f"{path}: [drive] lacks {', '.join(key for key in DRIVE if key not in drive)}")
    allowed = [own.name for own in fields(Robot)]
    if unknown := sorted(set(values) - set(allowed)):
        raise ValueError(f"{path}: {unknown[0]} is unknown; available: {', '.join(allowed)}, [names], [drive]")
    model = (path.parent / values.pop("model", path.with_suffix(".xml").name)).resolve()
    if model.is_relative_to(assets_folder().resolve()):
        model = model.relative_to(assets_folder().resolve())
    return RobotFile(robot=Robot(model=str(model), **values), names=names, drive=drive)


def robot_settings(name_or_path: str | Path) -> dict[str, Any]:
    """A robot as settings of a scenario.

    Args:
        name_or_path: See `read_robot`.

    Returns:
        Keyword arguments of `Scenario.changed`.

    Raises:
        FileNotFoundError: See `read_robot`.
        ValueError: See `read_robot`.
    """
    return {f"robot_{name}": value for name, value in asdict(read_robot(name_or_path).robot).items()}


def _table(path: Path, values: dict[str, Any], key: str, allowed: tuple[str, ...], kind: Any) -> dict[str, Any]:
    found = values.pop(key, {})
    if not isinstance(found, dict) or not all(k in allowed and isinstance(v, kind) for k, v in found.items()):
        raise ValueError(f"{path}: [{key}] = {found} is not allowed; allowed: {', '.join(allowed)}")
    return found
