"""Episodes as files that other tools of the field read: TrajNet++ ndjson, PedPy's text, and CSV."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from socialnav_mj.episode import Episode, IntArray
from socialnav_mj.files import csv_bytes, finished_files, write_whole
from socialnav_mj.geometry import Array

Format = Literal["trajnet", "pedpy", "csv"]
SUFFIXES: dict[Format, str] = {"trajnet": ".ndjson", "pedpy": ".txt", "csv": ".csv"}
"""Format: how its files' names end."""


def frame_rate(episode: Episode) -> float:
    """Samples a second: frames of an exported file are the numbers of its samples.

    Args:
        episode: Its times are evenly spaced.

    Returns:
        Of the control steps, 5 by default [Hz].
    """
    return 1.0 / float(episode.metadata["scenario"]["control_timestep"])


def trajnet(episode: Episode) -> bytes:
    """TrajNet++ (Kothari et al. 2021): a scene for each agent, from its spawn to its end, and everybody's positions.

    Args:
        episode: Agents and pedestrians go by the ids of the recording's people; nobody has both.

    Returns:
        Lines of JSON: {"scene": {"id", "p", "s", "e", "fps", "tag"}}, then {"track": {"f", "p", "x", "y"}} by frame.
    """
    frame, person, position, _ = _samples(episode)
    fps = frame_rate(episode)
    lines = []
    for scene, agent in enumerate(np.flatnonzero(np.isfinite(episode.agent_spawn_time))):
        own = frame[person == episode.agent_person[agent]]
        scope = {"id": scene, "p": int(episode.agent_person[agent]), "s": int(own[0]), "e": int(own[-1])}
        lines.append({"scene": {**scope, "fps": fps, "tag": 0}})
    rows = zip(frame.tolist(), person.tolist(), position.tolist(), strict=True)
    lines += [{"track": {"f": f, "p": p, "x": x, "y": y}} for f, p, (x, y) in rows]
    return "".join(f"{json.dumps(line)}\n" for line in lines).encode()


def pedpy(episode: Episode) -> bytes:
    """The text that PedPy and JuPedSim write and read.

    Args:
        episode: As in `trajnet`.

    Returns:
        Remarks with the frame rate and the columns; then id, frame, x, y in metres.
    """
    frame, person, position, _ = _samples(episode)
    text = io.StringIO()
    text.write(f"# framerate: {frame_rate(episode):.17g}\n# id frame x/m y/m\n")
    for f, p, (x, y) in zip(frame.tolist(), person.tolist(), position.tolist(), strict=True):
        text.write(f"{p} {f} {x!r} {y!r}\n")
    return text.getvalue().encode()


def table(episode: Episode) -> bytes:
    """A table of everybody at every sample.

    Args:
        episode: As in `trajnet`.

    Returns:
        CSV with the columns frame, time, id, kind (robot or person), x, y, heading, vx, vy; SI units, radians.
    """
    frame, person, position, source = _samples(episode)
    # The human row's agents are people.
    kinds = ("person" if episode.metadata["controller"] == "human" else "robot", "person")
    headings = np.concatenate([episode.agent_heading, episode.pedestrian_heading], axis=1)
    velocities = np.concatenate([episode.agent_velocity, episode.pedestrian_velocity], axis=1)
    step, column = source
    rows = (
        {
            "frame": f,
            "time": float(episode.time[k]),
            "id": p,
            "kind": kinds[int(c >= episode.n_agents)],
            "x": x,
            "y": y,
            "heading": float(headings[k, c]),
            "vx": float(velocities[k, c, 0]),
            "vy": float(velocities[k, c, 1]),
        }
        for f, p, (x, y), k, c in zip(frame.tolist(), person.tolist(), position.tolist(), step, column, strict=True)
    )
    columns = ("frame", "time", "id", "kind", "x", "y", "heading", "vx", "vy")
    return f"# framerate: {frame_rate(episode):.17g}\n".encode() + csv_bytes(columns, rows)


WRITERS: dict[Format, Callable[[Episode], bytes]] = {"trajnet": trajnet, "pedpy": pedpy, "csv": table}


def export(path: str | Path, folder: str | Path, formats: tuple[Format, ...]) -> list[Path]:
    """Write episodes in other formats.

    Args:
        path: An episode (.npz), or a folder of `evaluate`, whose episodes count.
        folder: Gets a file for each episode and format, named like the episode.
        formats: Of `WRITERS`.

    Returns:
        Paths written.

    Raises:
        FileNotFoundError: If there is no episode.
        EpisodeError: If one is damaged.
    """
    path = Path(path)
    episodes = [path] if path.is_file() else finished_files(path / "episodes", ".npz")
    if not episodes:
        raise FileNotFoundError(f"no episodes in {path / 'episodes'}; expected *.npz files")
    written = []
    for file in episodes:
        episode = Episode.load(file)
        for kind in formats:
            written.append(write_whole(Path(folder) / f"{file.stem}{SUFFIXES[kind]}", WRITERS[kind](episode)))
    return written


def _samples(episode: Episode) -> tuple[IntArray, IntArray, Array, tuple[IntArray, IntArray]]:
    """Frame, person, position, and (step, column) of whoever is there, by step: agents first, then pedestrians."""
    person = np.concatenate([episode.agent_person, episode.pedestrian_person])
    position = np.concatenate([episode.agent_position, episode.pedestrian_position], axis=1)
    step, column = np.nonzero(np.isfinite(position).all(axis=-1))
    frame = np.rint(episode.time * frame_rate(episode)).astype(np.int64)
    return frame[step], person[column], position[step, column], (step, column)
