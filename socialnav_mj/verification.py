"""Re-simulation of stored episodes: does the same configuration still give the same states?"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import controller_of
from socialnav_mj.environment import build_environment
from socialnav_mj.episode import Episode, read_header
from socialnav_mj.human import HUMAN, human_episode
from socialnav_mj.processes import in_processes
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.rollout import package_versions, rollout


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What became of one file."""

    path: Path
    """Episode or trace."""
    stored_hash: str
    """Of the file; empty if it could not be read."""
    hash: str
    """Of the re-simulation; empty if there was none."""
    error: str | None = None
    """Why the file could not be re-simulated."""
    other_versions: tuple[str, ...] = ()
    """Packages whose version is not the one the file was made with, as "name: then, now"."""

    @property
    def same(self) -> bool:
        """Whether the re-simulation gave the same states."""
        return self.error is None and self.stored_hash == self.hash


def files_of(path: str | Path) -> list[Path]:
    """What there is to verify.

    Args:
        path: An episode (.npz), a trace (.rrd), or a folder of `evaluate`, whose episodes and traces count.

    Returns:
        Files in alphabetical order.

    Raises:
        FileNotFoundError: If there is nothing.
    """
    path = Path(path)
    if path.is_file():
        return [path]
    files = sorted([*path.glob("episodes/*.npz"), *path.glob("traces/*.rrd")])
    files = [file for file in files if not file.name.startswith(".")]
    if not files:
        raise FileNotFoundError(f"{path}: there is no episodes/*.npz and no traces/*.rrd to verify")
    return files


def verify(
    path: str | Path, *, dataset: str | None = None, data_dir: str | None = None, n_jobs: int = -1
) -> Iterator[Verdict]:
    """Re-simulate stored episodes and compare the hashes of their states.

    Args:
        path: See `files_of`.
        dataset: Name or path of the recording; by default the name that the file gives.
        data_dir: Where recordings are looked for first.
        n_jobs: Processes; -1 for one a core.

    Yields:
        A verdict for each file, as they are done.

    Raises:
        FileNotFoundError: If there is nothing to verify.
    """
    yield from in_processes(_verify, [(file, dataset, data_dir) for file in files_of(path)], n_jobs=n_jobs)


def _verify(path: Path, dataset: str | None, data_dir: str | None) -> Verdict:
    stored = ""
    try:
        metadata = _metadata(path)
        stored = str(metadata["state_hash"])
        then = metadata["versions"]
        now = package_versions(tuple(then))
        changed = tuple(f"{name}: {then[name]}, {now[name]}" for name in then if then[name] != now[name])
        episode = resimulate(metadata, dataset=dataset, data_dir=data_dir)
    except (ValueError, OSError, RuntimeError, KeyError, TypeError) as error:
        return Verdict(path=path, stored_hash=stored, hash="", error=f"{type(error).__name__}: {error}")
    return Verdict(path=path, stored_hash=stored, hash=str(episode.metadata["state_hash"]), other_versions=changed)


def _metadata(path: Path) -> dict[str, Any]:
    if path.suffix != ".rrd":
        metadata: dict[str, Any] = read_header(path)["metadata"]
        return metadata
    from socialnav_mj.analysis.trace import read_metadata  # rerun is slow to import

    return read_metadata(path)


def resimulate(metadata: dict[str, Any], *, dataset: str | None = None, data_dir: str | None = None) -> Episode:
    """Run an episode again from what it says of itself.

    Args:
        metadata: Of the stored episode.
        dataset: Name or path of the recording; by default the name that the metadata gives.
        data_dir: Where recordings are looked for first.

    Returns:
        The new episode, as long as the stored one.

    Raises:
        ValueError: If the recording or the controller is not the stored one.
        FileNotFoundError: If the recording is not there.
    """
    source = metadata["recording"]
    try:
        recording = _recording(dataset or source["name"], source["variant"], data_dir)
    except (FileNotFoundError, ValueError) as error:
        hint = "" if dataset else "; name the recording's path with --dataset"
        raise type(error)(f"{error}{hint}") from error
    if recording.checksum != source["checksum"]:
        raise ValueError(
            f"recording {recording.name!r} has checksum {recording.checksum}, but the episode was run on "
            f"{source['checksum']}"
        )
    scenario = Scenario.from_dict(metadata["scenario"])
    name = metadata["scenario_name"]
    if metadata["controller"] == HUMAN:
        return human_episode(recording, scenario, scenario_name=name)
    # Half a step before the end, so that rounding cannot add a step.
    limit = (metadata["steps"] - 0.5) * scenario.control_timestep
    environment = build_environment(recording, scenario, time_limit=limit)
    return rollout(environment, controller_of(metadata["controller_config"]), scenario_name=name)


@lru_cache(maxsize=2)
def _recording(dataset: str, variant: str, data_dir: str | None) -> Recording:
    return load_recording(dataset, variant=variant, data_dir=data_dir)
