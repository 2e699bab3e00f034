"""Re-simulation of stored episodes: does everything that a file says come out again?"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet

import tasks
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import controller_of
from socialnav_mj.environment import build_environment
from socialnav_mj.episode import Episode
from socialnav_mj.human import HUMAN, human_episode
from socialnav_mj.processes import in_processes
from socialnav_mj.provenance import package_versions
from socialnav_mj.recordings import DEFAULT_READING, Reading, Recording, load_recording
from socialnav_mj.recordings.catalogue import catalogue
from socialnav_mj.report.agents import check_names
from socialnav_mj.report.run_file import RUN_FILE, read_run_file
from socialnav_mj.report.writer import report_tables
from socialnav_mj.resources import assets_folder
from socialnav_mj.rollout import rollout

MAX_PHYSICS_STEPS = 10_000_000
"""More are not simulated for one file, whatever it says: 28 hours at the default step."""


@dataclass(frozen=True, kw_only=True)
class Trust:
    """What a file may name beyond built-in and installed things."""

    controllers: tuple[str, ...] = ()
    """Classes that may be imported and run, as "package.module:Class"."""
    robots: tuple[Path, ...] = ()
    """MJCF files outside of the assets."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What became of one file."""

    path: Path
    """Episode, trace, table or run.json."""
    state_hash: str = ""
    """Of the re-simulation; empty if there was none."""
    differences: tuple[str, ...] = ()
    """What the file says otherwise than the re-simulation, each with its name."""
    error: str | None = None
    """Why the file could not be checked."""
    other_versions: tuple[str, ...] = ()
    """Packages whose version is not the one the file was made with, as "name: then, now"."""

    @property
    def same(self) -> bool:
        """Whether everything that the file says came out again."""
        return self.error is None and not self.differences


def files_of(path: str | Path) -> list[Path]:
    """What there is to re-simulate.

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
    path: str | Path,
    *,
    dataset: str | None = None,
    data_dir: str | None = None,
    trust: Trust | None = None,
    bounds: Reading = DEFAULT_READING,
    n_jobs: int = -1,
) -> Iterator[Verdict]:
    """Re-simulate stored episodes and compare all that they say; of a folder, its tables and its count as well.

    Args:
        path: See `files_of`.
        dataset: Name or path of the recording; by default the catalogue's of the name that the file gives.
        data_dir: Where recordings are looked for first.
        trust: What the files may name beyond built-in and installed things; nothing by default.
        bounds: What a recording may hold; the rest of how it is read is each file's.
        n_jobs: Processes; -1 for one a core.

    Yields:
        A verdict for each file, as they are done; then, of a folder, one for run.json and for each table.

    Raises:
        FileNotFoundError: If there is nothing to verify.
    """
    path, trust = Path(path), trust or Trust()
    arguments = [(file, dataset, data_dir, trust, bounds) for file in files_of(path)]
    yield from in_processes(_verify, arguments, n_jobs=n_jobs)
    if path.is_dir():
        yield _count(path)
        yield from _tables(path, n_jobs)


def _verify(path: Path, dataset: str | None, data_dir: str | None, trust: Trust, bounds: Reading) -> Verdict:
    try:
        if path.suffix == ".rrd":
            return _verify_trace(path, dataset, data_dir, trust, bounds)
        return _verify_episode(path, dataset, data_dir, trust, bounds)
    except Exception as error:  # noqa: BLE001  whatever a file makes happen, it is told and the others are verified
        return Verdict(path=path, error=f"{type(error).__name__}: {error}")


def _verify_episode(path: Path, dataset: str | None, data_dir: str | None, trust: Trust, bounds: Reading) -> Verdict:
    stored = Episode.load(path)
    again = resimulate(stored.metadata, dataset=dataset, data_dir=data_dir, trust=trust, bounds=bounds)
    return Verdict(
        path=path,
        state_hash=again.metadata["state_hash"],
        differences=(*_differing_metadata(stored.metadata, again.metadata), *_differing_values(stored, again)),
        other_versions=_other_versions(stored.metadata),
    )


def _verify_trace(path: Path, dataset: str | None, data_dir: str | None, trust: Trust, bounds: Reading) -> Verdict:
    from socialnav_mj.trace.columns import differing_columns
    from socialnav_mj.trace.writer import read_metadata, write_trace  # rerun is slow to import

    metadata = read_metadata(path)
    again = resimulate(metadata, dataset=dataset, data_dir=data_dir, trust=trust, bounds=bounds)
    differences = _differing_metadata(metadata, again.metadata)
    if not differences:
        # Versions may differ, and are told; the trace shows them.
        again = replace(again, metadata={**again.metadata, "versions": metadata["versions"]})
        with TemporaryDirectory() as folder:
            differences = differing_columns(path, write_trace(again, Path(folder) / path.name))
    return Verdict(
        path=path,
        state_hash=again.metadata["state_hash"],
        differences=differences,
        other_versions=_other_versions(metadata),
    )


def _other_versions(metadata: dict[str, Any]) -> tuple[str, ...]:
    then = metadata["versions"]
    now = package_versions(tuple(then))
    return tuple(f"{name}: {then[name]}, {now[name]}" for name in then if then[name] != now[name])


def _differing_metadata(stored: dict[str, Any], again: dict[str, Any]) -> tuple[str, ...]:
    names = [name for name in {**stored, **again} if name != "versions" and stored.get(name) != again.get(name)]
    return tuple(f"{name} is {_short(stored.get(name))}, now {_short(again.get(name))}" for name in names)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _differing_values(stored: Episode, again: Episode) -> tuple[str, ...]:
    found = []
    for name in (field.name for field in fields(Episode) if field.name != "metadata"):
        one, two = getattr(stored, name), getattr(again, name)
        if not isinstance(one, np.ndarray):
            found += [] if one == two else [f"{name} is {_short(one)}, now {_short(two)}"]
        elif one.shape != two.shape:
            found.append(f"{name} has shape {one.shape}, now {two.shape}")
        elif different := int(np.sum(~((one == two) | (np.isnan(one) & np.isnan(two))))):
            found.append(f"{name} differs in {different} of {one.size} values")
    return tuple(found)


def _count(folder: Path) -> Verdict:
    """Whether the episodes of a folder are those that its evaluation has made."""
    path = folder / RUN_FILE
    there = {file.name for file in files_of(folder) if file.suffix == ".npz"}
    try:
        run = read_run_file(path)
    except ValueError as error:
        return Verdict(path=path, error=str(error))
    if run is None:
        return Verdict(path=path, error="is not there, so nothing says which episodes belong to this folder")
    differences = [f"{name} is missing" for name in sorted({*run.episodes} - there)]
    differences += [f"{name} is not listed" for name in sorted(there - {*run.episodes})]
    return Verdict(path=path, differences=tuple(differences))


def _tables(folder: Path, n_jobs: int) -> Iterator[Verdict]:
    """Whether the tables of a folder, if it has any, are those that its episodes give."""
    try:
        expected = report_tables(folder, n_jobs=n_jobs)
    except (ValueError, OSError) as error:
        yield Verdict(path=folder / "report.md", error=f"{type(error).__name__}: {error}")
        return
    if not any((folder / name).exists() for name in expected):
        return
    for name, content in expected.items():
        path = folder / name
        if not path.exists():
            yield Verdict(path=path, error="is not there, though other tables are")
        elif path.suffix == ".parquet":
            yield Verdict(path=path, differences=_differing_table(path.read_bytes(), content))
        else:
            same = path.read_bytes() == content
            yield Verdict(path=path, differences=() if same else ("it is not what the episodes give",))


def _differing_table(stored: bytes, again: bytes) -> tuple[str, ...]:
    """Columns that differ; the bytes of a parquet file are not compared, since they hold its writer's version."""
    try:
        one, two = (pa.parquet.read_table(pa.BufferReader(content)).to_pydict() for content in (stored, again))
    except (pa.ArrowException, OSError, ValueError) as error:
        return (f"it cannot be read: {error}",)
    names = [name for name in {**one, **two} if repr(one.get(name)) != repr(two.get(name))]
    return tuple(f"column {name} is not what the episodes give" for name in names)


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
    if metadata["controller"] == HUMAN:
        return human_episode(recording, scenario, scenario_name=name)
    controller = controller_of(metadata["controller_config"], trusted=trust.controllers)
    # Half a step before the end, so that rounding cannot add a step.
    limit = (metadata["steps"] - 0.5) * scenario.control_timestep
    environment = build_environment(recording, scenario, time_limit=limit)
    return rollout(environment, controller, scenario_name=name)


def _scenario_name(stated: str, scenario: Scenario) -> str:
    """Name of the task with this share of agents; the stated one if there is none, or none is stated."""
    names = (name for name, share in tasks.SHARES.items() if share == scenario.share)
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
