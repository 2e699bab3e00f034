"""What runs and trainings leave behind: episodes, traces, tables, run.json, policies."""

import io
import json
import zipfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from .recordings import TINY
from .target import Target


@cache
def _episode() -> bytes:
    """A short episode of recorded people, as `evaluate` writes it."""
    from socialnav_mj.config import Scenario
    from socialnav_mj.human import human_episode
    from socialnav_mj.recordings import load_recording

    episode = human_episode(load_recording(TINY), Scenario(share=0.5), scenario_name="half")
    with TemporaryDirectory() as folder:
        return episode.save(Path(folder) / "a.npz").read_bytes()


def _member(name: str) -> bytes:
    with zipfile.ZipFile(io.BytesIO(_episode())) as file:
        return file.read(name)


def _with_member(name: str, content: bytes) -> bytes:
    """The episode with another array, under a right checksum of the zip."""
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(_episode())) as source, zipfile.ZipFile(target, "w") as file:
        for member in source.namelist():
            file.writestr(member, content if member == name else source.read(member))
    return target.getvalue()


def _header() -> bytes:
    return str(np.load(io.BytesIO(_member("header.npy")))).encode()


def _read_episode(content: bytes, folder: Path) -> None:
    from socialnav_mj.episode import Episode, read_header

    path = folder / "a.npz"
    path.write_bytes(content)
    read_header(path)
    Episode.load(path)


def _read_header(content: bytes, folder: Path) -> None:
    array = io.BytesIO()
    np.save(array, np.array(content.decode("utf-8", "replace")))
    _read_episode(_with_member("header.npy", array.getvalue()), folder)


def _array(name: str) -> Target:
    def read(content: bytes, folder: Path) -> None:
        _read_episode(_with_member(f"{name}.npy", content), folder)

    return Target(name=f"episodes/{name}", seeds=lambda: [_member(f"{name}.npy")], read=read, refuses=_episode_errors)


def _episode_errors() -> tuple[type[Exception], ...]:
    from socialnav_mj.episode import EpisodeError

    return (EpisodeError,)


def _policy_file(suffix: str) -> bytes:
    from socialnav_mj.controllers.replay_irl import policies_folder

    return min(policies_folder().glob(f"*{suffix}"), key=lambda path: path.name).read_bytes()


def _read_policy(content: bytes, folder: Path, suffix: str) -> None:
    from socialnav_mj.controllers.replay_irl import load_policy

    for name in (".safetensors", ".json"):
        (folder / f"a{name}").write_bytes(content if name == suffix else _policy_file(name))
    # A new name for each input: policies are read once for each state of a file, and its clock is coarse.
    unique = folder / f"{abs(hash(content))}.safetensors"
    (folder / "a.safetensors").replace(unique)
    (folder / "a.json").replace(unique.with_suffix(".json"))
    try:
        load_policy(str(unique))
    finally:
        unique.unlink()
        unique.with_suffix(".json").unlink()


def _policy_errors() -> tuple[type[Exception], ...]:
    from socialnav_mj.controllers.replay_irl import PolicyError

    return (PolicyError,)


def _trace() -> bytes:
    from socialnav_mj.episode import Episode
    from socialnav_mj.trace.writer import write_trace

    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.npz"
        path.write_bytes(_episode())
        return write_trace(Episode.load(path), Path(folder) / "a.rrd").read_bytes()


def _read_trace(content: bytes, folder: Path) -> None:
    from socialnav_mj.trace.writer import read_metadata

    path = folder / "a.rrd"
    path.write_bytes(content)
    read_metadata(path)


def _table() -> bytes:
    """agents.parquet of two controllers and two draws."""
    import pyarrow as pa
    import pyarrow.parquet

    from socialnav_mj.episode import Episode
    from socialnav_mj.report.agents import agents_table

    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.npz"
        path.write_bytes(_episode())
        table = agents_table(Episode.load(path))
    parts = []
    for controller in ("human", "other"):
        for draw in (0, 1):
            for name, value in (("controller", controller), ("draw", draw)):
                column = pa.array([value] * len(table), table.schema.field(name).type)
                table = table.set_column(table.schema.get_field_index(name), table.schema.field(name), column)
            parts.append(table)
    sink = pa.BufferOutputStream()
    pyarrow.parquet.write_table(pa.concat_tables(parts), sink)
    return bytes(sink.getvalue().to_pybytes())


def _read_table(content: bytes, folder: Path) -> None:
    """As `socialnav-mj draws` does."""
    import pyarrow.parquet

    from socialnav_mj.report.power import resolutions

    path = folder / "agents.parquet"
    path.write_bytes(content)
    resolutions(pyarrow.parquet.read_table(path), {"success": 0.05})


def _command_errors() -> tuple[type[Exception], ...]:
    """What the command turns into a message."""
    return (ValueError, OSError, RuntimeError)


def _read_run_file(content: bytes, folder: Path) -> None:
    from socialnav_mj.report.run_file import read_run_file

    path = folder / "run.json"
    path.write_bytes(content)
    read_run_file(path)


RESULTS = (
    Target(name="episodes/npz", seeds=lambda: [_episode()], read=_read_episode, refuses=_episode_errors),
    Target(name="episodes/header", seeds=lambda: [_header()], read=_read_header, refuses=_episode_errors),
    _array("agent_position"),
    _array("agent_policy"),
    Target(name="traces/rrd", seeds=lambda: [_trace()], read=_read_trace, refuses=_episode_errors),
    Target(name="tables/parquet", seeds=lambda: [_table()], read=_read_table, refuses=_command_errors),
    Target(
        name="tables/run.json",
        seeds=lambda: [
            json.dumps({"command": "socialnav-mj evaluate", "controllers": ["a"], "episodes": ["a.npz"]}).encode()
        ],
        read=_read_run_file,
        refuses=_command_errors,
    ),
    Target(
        name="policies/weights",
        seeds=lambda: [_policy_file(".safetensors")],
        read=lambda content, folder: _read_policy(content, folder, ".safetensors"),
        refuses=_policy_errors,
    ),
    Target(
        name="policies/card",
        seeds=lambda: [_policy_file(".json")],
        read=lambda content, folder: _read_policy(content, folder, ".json"),
        refuses=_policy_errors,
    ),
)
