"""An episode run again from what its file says of itself, as far as the file may say it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any

from socialnav_mj.config import SHARES, Scenario
from socialnav_mj.controllers import controller_of
from socialnav_mj.environment import build_environment
from socialnav_mj.episode import Episode
from socialnav_mj.human import HUMAN, human_episode_in_parts
from socialnav_mj.parts import PART, number_of_part
from socialnav_mj.recordings import DEFAULT_READING, Reading, Recording, load_recording
from socialnav_mj.recordings.catalogue import catalogue
from socialnav_mj.report.agents import check_names
from socialnav_mj.resources import assets_folder
from socialnav_mj.rollout import rollout_in_parts

MAX_PHYSICS_STEPS = 10_000_000
"""More are not simulated for one file, whatever it says: 28 hours at the default step."""


@dataclass(frozen=True, kw_only=True)
class Trust:
    """What a file may name beyond built-in and installed things."""

    controllers: tuple[str, ...] = ()
    """Classes that may be imported and run, as "package.module:Class"."""
    metrics: tuple[str, ...] = ()
    """Own metrics that may be imported and run, as "package.module:function"."""
    robots: tuple[Path, ...] = ()
    """MJCF files outside of the assets."""


def resimulate(
    metadata: dict[str, Any],
    *,
    dataset: str | None = None,
    data_dir: str | None = None,
    trust: Trust | None = None,
    bounds: Reading = DEFAULT_READING,
) -> Episode:
    """Run an episode again from what it says of itself.

    Args:
        metadata: Of the stored episode.
        dataset: Name or path of the recording; by default the catalogue's of the name that the metadata give.
        data_dir: Where recordings are looked for first.
        trust: What the metadata may name beyond built-in and installed things; nothing by default.
        bounds: What a recording may hold; the rest of how it is read is the metadata's.

    Returns:
        The new episode, as long as the stored one.

    Raises:
        ValueError: If the recording or the controller is not the stored one, or something is named that is not trusted.
        FileNotFoundError: If the recording is not there.
    """
    trust = trust or Trust()
    check_names(metadata)
    scenario = Scenario.from_dict(metadata["scenario"])
    _check_robot(scenario, trust)
    _check_length(metadata["steps"], scenario)
    source = metadata["recording"]
    if dataset is None and source["name"] not in catalogue():
        raise ValueError(
            f"recording {source['name']!r} is not in the catalogue; name the recording's path with --dataset"
        )
    # Frame rate and settings are the episode's: a recording given by path does not know them.
    reading = bounds.again(source["frame_rate"], source["reading"])
    recording = _recording(dataset or source["name"], source["variant"], data_dir, reading)
    if recording.checksum != source["checksum"]:
        raise ValueError(
            f"recording {recording.name!r} has checksum {recording.checksum}, but the episode was run on "
            f"{source['checksum']}"
        )
    name = _scenario_name(metadata["scenario_name"], scenario)
    part = metadata.get(PART)
    told: dict[str, Any] = {"scenario_name": name, "seconds": inf if part is None else part["seconds"]}
    if metadata["controller"] == HUMAN:
        return _part(human_episode_in_parts(recording, scenario, **told), metadata)
    controller = controller_of(metadata["controller_config"], trusted=trust.controllers)
    # Half a step before the end, so that rounding cannot add a step; what comes after a part decides nothing in it.
    limit = (metadata["steps"] - 0.5) * scenario.control_timestep if part is None or part["is_last"] else inf
    environment = build_environment(recording, scenario, time_limit=limit, robots="likely")
    return _part(rollout_in_parts(environment, controller, **told), metadata)


def _part(episodes: Iterator[Episode], metadata: dict[str, Any]) -> Episode:
    """The part that the metadata name, or the whole."""
    number = number_of_part(metadata)
    for episode in episodes:
        if number_of_part(episode.metadata) == number:
            return episode
    raise ValueError(f"part.number = {number}, but the episode has fewer parts of {metadata[PART]['seconds']} s")


def _scenario_name(stated: str, scenario: Scenario) -> str:
    """Name of the task with this share of agents; the stated one if there is none, or none is stated."""
    names = (name for name, share in SHARES.items() if share == scenario.share)
    return next(names, stated) if stated else stated


def _check_robot(scenario: Scenario, trust: Trust) -> None:
    assets = assets_folder().resolve()
    model = (assets / scenario.robot.model).resolve()
    if not model.is_relative_to(assets) and model not in (path.resolve() for path in trust.robots):
        raise ValueError(
            f"the file names the robot model {scenario.robot.model!r}, which is not among the package's assets; "
            f"if you trust it, add --trust-robot {model}"
        )


def _check_length(steps: Any, scenario: Scenario) -> None:
    if not isinstance(steps, int) or not 1 <= steps * scenario.n_sub_steps <= MAX_PHYSICS_STEPS:
        raise ValueError(
            f"steps = {steps!r} of {scenario.n_sub_steps} physics steps each are not allowed; allowed: integers, "
            f"and up to {MAX_PHYSICS_STEPS} physics steps in all"
        )


@lru_cache(maxsize=2)
def _recording(dataset: str, variant: str, data_dir: str | None, reading: Reading) -> Recording:
    return load_recording(dataset, variant=variant, data_dir=data_dir, reading=reading, warn=False)
