"""Stored files against their re-simulation: does everything that a file says come out again?"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from socialnav_mj.episode import Episode
from socialnav_mj.files import finished_files
from socialnav_mj.parts import is_before_last
from socialnav_mj.processes import in_processes
from socialnav_mj.provenance import differences, package_versions, platform_facts
from socialnav_mj.recordings import DEFAULT_READING, Reading
from socialnav_mj.report.own_metrics import is_offered
from socialnav_mj.report.run_file import RUN_FILE, read_run_file
from socialnav_mj.report.writer import report_tables
from socialnav_mj.resimulation import Trust, resimulate

_TOLD = ("versions", "platform")
"""Metadata that may differ, and are told beside what differs."""


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
    """Packages, machine and C library that are not those the file was made with, as "name: then, now"."""

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
    files = [*finished_files(path / "episodes", ".npz"), *finished_files(path / "traces", ".rrd")]
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
        yield from _tables(path, trust, n_jobs)


def _verify(path: Path, dataset: str | None, data_dir: str | None, trust: Trust, bounds: Reading) -> Verdict:
    try:
        if path.suffix == ".rrd":
            return _verify_trace(path, dataset, data_dir, trust, bounds)
        return _verify_episode(path, dataset, data_dir, trust, bounds)
    except (ValueError, OSError) as error:
        return Verdict(path=path, error=f"not checked: {error}")
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
        # The trace shows them.
        then = {name: metadata[name] for name in _TOLD if name in metadata}
        again = replace(again, metadata={k: v for k, v in again.metadata.items() if k not in _TOLD} | then)
        with TemporaryDirectory() as folder:
            differences = differing_columns(path, write_trace(again, Path(folder) / path.name))
    return Verdict(
        path=path,
        state_hash=again.metadata["state_hash"],
        differences=differences,
        other_versions=_other_versions(metadata),
    )


def _other_versions(metadata: dict[str, Any]) -> tuple[str, ...]:
    then = {**metadata["versions"], **metadata.get("platform", {})}
    now = {**package_versions(tuple(metadata["versions"])), **platform_facts()}
    return tuple(f"{name}: {then[name]}, {now[name]}" for name in then if then[name] != now.get(name))


def _differing_metadata(stored: dict[str, Any], again: dict[str, Any]) -> tuple[str, ...]:
    names = [name for name in {**stored, **again} if name not in _TOLD]
    return tuple(text for name in names for text in differences(stored.get(name), again.get(name), name))


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _differing_values(stored: Episode, again: Episode) -> tuple[str, ...]:
    found = []
    for name in (field.name for field in fields(Episode) if field.name != "metadata"):
        one, two = getattr(stored, name), getattr(again, name)
        if not (isinstance(one, np.ndarray) and isinstance(two, np.ndarray)):
            one, two = (f"shape {v.shape}" if isinstance(v, np.ndarray) else v for v in (one, two))
            found += [] if one == two else [f"{name} is {_short(one)}, now {_short(two)}"]
        elif one.shape != two.shape:
            found.append(f"{name} has shape {one.shape}, now {two.shape}")
        elif different := int(np.sum(~((one == two) | (np.isnan(one) & np.isnan(two))))):
            found.append(f"{name} differs in {different} of {one.size} values")
    return tuple(found)


def _count(folder: Path) -> Verdict:
    """Whether the episodes of a folder are those that its evaluation has made."""
    path = folder / RUN_FILE
    # What is listed is whole, or the last part; which of the others are there, the tables tell.
    there = {file.name for file in finished_files(folder / "episodes", ".npz") if not is_before_last(file.name)}
    try:
        run = read_run_file(path)
    except ValueError as error:
        return Verdict(path=path, error=str(error))
    if run is None:
        return Verdict(path=path, error="is not there, so nothing says which episodes belong to this folder")
    differences = [f"{name} is missing" for name in sorted({*run.episodes} - there)]
    differences += [f"{name} is not listed" for name in sorted(there - {*run.episodes})]
    return Verdict(path=path, differences=tuple(differences))


def _tables(folder: Path, trust: Trust, n_jobs: int) -> Iterator[Verdict]:
    """Whether the tables of a folder, if it has any, are those that its episodes give."""
    try:
        run = read_run_file(folder / RUN_FILE)
        metrics = () if run is None else run.metrics
        if untrusted := [name for name in metrics if name not in trust.metrics and not is_offered(name)]:
            error = f"its tables hold the metric {untrusted[0]!r}, whose code would run; if you trust it, add "
            yield Verdict(path=folder / "report.md", error=f"{error}--trust {untrusted[0]}")
            return
        expected = report_tables(folder, metrics=metrics, n_jobs=n_jobs)
    except (ValueError, OSError) as error:
        yield Verdict(path=folder / "report.md", error=f"not checked: {error}")
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
