"""Whether the episodes of a folder fit what is asked for, and what becomes of those whose controller was edited."""

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import BUILT_IN, controller_config, make_controller
from socialnav_mj.controllers.check import try_controller
from socialnav_mj.episode import EpisodeError, check_name, read_header
from socialnav_mj.files import finished_files
from socialnav_mj.human import HUMAN
from socialnav_mj.parts import PART
from socialnav_mj.provenance import differences

OnChange = Literal["refuse", "again", "keep"]
"""What becomes of episodes whose controller has changed: an error, a new run, or a name of its own for the new one."""
SUPERSEDED = "superseded"
"""Folder of a run that holds the episodes that were run anew."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What the episodes of a folder have to say of themselves."""

    recording: Mapping[str, Any]
    """Metadata of the recording."""
    scenario: Callable[[str, int], Mapping[str, Any]]
    """Configuration of a task and draw."""
    controllers: Mapping[str, Mapping[str, Any]]
    """Name in tables: configuration."""
    jobs: Mapping[str, tuple[str, int, str]]
    """File: task, draw and controller's name."""
    part: float | None = None
    """Length of the parts that episodes are written in; None for whole ones [s]."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """A controller whose episodes were run with another one of its name."""

    controller: str
    """Its name in tables."""
    differences: tuple[str, ...]
    """What it was and is, as `provenance.differences` tells it."""
    episodes: tuple[Path, ...]
    """Files that were run with the other one."""


class ChangedError(EpisodeError):
    """Controllers have changed since the episodes of a folder were run."""

    def __init__(self, changes: Iterable[Change]) -> None:
        """Tell the changes.

        Args:
            changes: One for each controller.
        """
        self.told = "; ".join(
            f"{change.controller} has changed since these episodes were run ({', '.join(change.differences)}; "
            f"{len(change.episodes)} episodes, the first is {change.episodes[0]})"
            for change in changes
        )
        super().__init__(f"{self.told}; choose another output folder, or delete these files to have them run again")


def changes(folder: Path, wanted: Wanted) -> tuple[Change, ...]:
    """Compare the episodes of a folder with what is asked for: it holds one recording and one setting.

    Args:
        folder: Of the episodes; it need not be there.
        wanted: What they have to say of themselves.

    Returns:
        Controllers whose episodes were run with another source or configuration, in the order of the files.

    Raises:
        EpisodeError: If an episode is damaged, was not run by an evaluation, or is of another recording or setting; the
            file is named.
    """
    found: dict[str, list[Path]] = {}
    told: dict[str, tuple[str, ...]] = {}
    for path in finished_files(folder, ".npz"):
        metadata = read_header(path)["metadata"]
        try:
            task, draw, controller = wanted.jobs.get(
                path.name, (metadata["scenario_name"], metadata["draw"], metadata["controller"])
            )
            pairs = {
                "recording": (metadata["recording"], wanted.recording),
                "scenario": (metadata["scenario"], wanted.scenario(task, draw)),
                PART: (metadata[PART]["seconds"] if PART in metadata else None, wanted.part),
            }
            then = {"name": metadata["controller"], **metadata["controller_config"]}
        except (KeyError, TypeError) as error:
            raise EpisodeError(f"{path} was not run by an evaluation: its metadata lack {error}") from error
        for key, (given, expected) in pairs.items():
            if other := differences(given, expected, key):
                raise EpisodeError(
                    f"{path} was run with {other[0]} is asked for; "
                    "choose another output folder, or delete the file to have it run again"
                )
        if controller in wanted.controllers:
            now = {"name": controller, **wanted.controllers[controller]}
            if other := differences(then, now):
                found.setdefault(controller, []).append(path)
                told.setdefault(controller, other)
    return tuple(
        Change(controller=name, differences=told[name], episodes=tuple(paths)) for name, paths in found.items()
    )


def set_aside(change: Change, folder: Path) -> None:
    """Move episodes out of a run, so that they are run anew.

    Args:
        change: Whose episodes.
        folder: The run; they go into `superseded/`, apart by what they were run with.
    """
    for path in change.episodes:
        target = folder / SUPERSEDED / _short(read_header(path)["metadata"]["controller_config"]) / path.name
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, target)


def name_of_version(name: str, configuration: Mapping[str, Any]) -> str:
    """A name for an edited controller beside what it was.

    Args:
        name: That both have.
        configuration: Of the edited one.

    Returns:
        Such as "spin@1a2b3c", as a spec can have it.
    """
    return f"{re.sub('[=(:)]', '-', name)}@{_short(configuration)}"


def _short(configuration: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(configuration, sort_keys=True).encode()).hexdigest()[:6]


@dataclass(frozen=True, kw_only=True)
class Named:
    """A controller as the folder of a run knows it."""

    name: str
    """In tables."""
    configuration: dict[str, Any]
    """As `controller_config` gives it; empty for the human row."""


def named_controllers(specs: Iterable[str], scenario: Scenario) -> dict[str, Named]:
    """Make the controllers of a run once, and try those that are not built in on made-up observations.

    Args:
        specs: As `make_controller` takes them.
        scenario: Whose limits they are tried with.

    Returns:
        Spec: name and configuration; the human row at the end.

    Raises:
        EpisodeError: If a name cannot stand in a table.
        ValueError: If there is no such controller, it fails, or two have one name.
    """
    named: dict[str, Named] = {}
    for spec in specs:
        controller = make_controller(spec)
        check_name(f"the name of controller {spec!r}", controller.name)
        if any(controller.name == other.name for other in named.values()) or controller.name == HUMAN:
            raise ValueError(
                f"controller {spec!r} is named {controller.name!r} like another row of the tables; give it another "
                f"name, as in 'other={spec}'"
            )
        named[spec] = Named(name=controller.name, configuration=controller_config(controller))
        if type(controller) not in BUILT_IN.values():
            try_controller(controller, scenario)
    return {**named, HUMAN: Named(name=HUMAN, configuration={})}
