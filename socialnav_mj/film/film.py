"""Frames of an episode, and the files that hold them."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode
from socialnav_mj.files import written_whole
from socialnav_mj.film.marks import draw_marks
from socialnav_mj.film.stage import Poses, Stage, poses_at
from socialnav_mj.resources import install_hint

Camera = Literal["follow", "oblique", "top"]
Frame = NDArray[np.uint8]
ENDINGS = (".mp4", ".gif", ".png")
NO_LIBRARY = "drawing needs a display, or the library EGL (Debian: libegl1 and libgl1-mesa-dri) or OSMesa (libosmesa6)"
_OFF = {"disable", "disabled", "off", "false", "0"}
_MARGIN = 1.0
"""Before an agent comes and after it has gone [s]."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """What is filmed."""

    camera: Camera = "follow"
    agent: int | None = None
    """Person that the followed agent replaced; the agent that is longest on its way if None."""
    begin: float | None = None
    """[s] since the recording's first frame; when the followed agent comes, or the episode begins, if None."""
    seconds: float | None = None
    """Of simulated time; as long as the followed agent is there, or 20 s, if None."""
    rate: float = 25.0
    """Frames in a second."""
    width: int = 1280
    """[pixel]."""
    height: int = 720

    def __post_init__(self) -> None:
        if self.camera not in get_args(Camera):
            raise ValueError(f"camera = {self.camera!r} is not allowed; allowed: {', '.join(get_args(Camera))}")
        if not (0.0 < self.rate <= 100.0 and (self.seconds is None or self.seconds > 0.0)):
            raise ValueError(f"rate = {self.rate}, seconds = {self.seconds}; allowed: in (0, 100], and > 0")
        for name, value, most in (("width", self.width, 1920), ("height", self.height, 1080)):
            if not 16 <= value <= most or value % 2:
                raise ValueError(f"{name} = {value} is not allowed; allowed: even numbers from 16 to {most}")


def times_of(shot: Shot, episode: Episode) -> NDArray[np.float64]:
    """Times of all frames.

    Args:
        shot: What is filmed.
        episode: Of which.

    Returns:
        Shape (frames,) [s].

    Raises:
        ValueError: If there is no such agent, or nothing to be seen at that time.
    """
    first, last = float(episode.time[0]), float(episode.time[-1])
    begin, end = first, min(last, first + 20.0)
    if (agent := followed_agent(shot, episode)) is not None:
        window = episode.window(agent)
        begin = max(first, float(episode.time[window.start]) - _MARGIN)
        end = min(last, float(episode.time[window.stop - 1]) + _MARGIN)
    if shot.begin is not None:
        begin, end = shot.begin, max(end, min(last, shot.begin + 20.0)) if agent is None else end
    if shot.seconds is not None:
        end = min(last, begin + shot.seconds)
    if not first <= begin <= end:
        raise ValueError(f"begin = {begin:g} s is not allowed; allowed: {first:g} to {end:g} s in this shot")
    return np.arange(begin, end + 1e-9, 1.0 / shot.rate)


def followed_agent(shot: Shot, episode: Episode) -> int | None:
    """Index of the agent that the camera follows.

    Args:
        shot: What is filmed.
        episode: Of which.

    Returns:
        None if the camera stands and no agent is named.

    Raises:
        ValueError: If there is no such agent, or it was never in the scene.
    """
    there = np.flatnonzero(np.isfinite(episode.agent_heading).any(axis=0))
    persons = episode.agent_person[there].tolist()
    if shot.agent is not None:
        if shot.agent not in persons:
            raise ValueError(f"agent = {shot.agent} is not there; there are {', '.join(map(str, persons)) or 'none'}")
        return int(there[persons.index(shot.agent)])
    if shot.camera != "follow":
        return None
    if not len(there):
        raise ValueError("no agent was ever in the scene; take the camera oblique or top")
    return int(there[np.argmax(np.isfinite(episode.agent_heading[:, there]).sum(axis=0))])


def frames(episode: Episode, shot: Shot) -> Iterator[Frame]:
    """Draw all frames.

    Args:
        episode: What is drawn.
        shot: From where, and when.

    Yields:
        Shape (height, width, 3), for each of `times_of`.

    Raises:
        RuntimeError: If nothing here can draw.
        ValueError: See `times_of`.
    """
    times, followed = times_of(shot, episode), followed_agent(shot, episode)
    stage = Stage(episode)
    renderer = _renderer(stage.model, shot)
    try:
        camera = _Follower(episode, followed) if shot.camera == "follow" and followed is not None else None
        for time in times.tolist():
            poses = poses_at(episode, time)
            stage.pose(poses)
            renderer.update_scene(stage.data, shot.camera if camera is None else camera.at(poses))
            draw_marks(renderer.scene, episode, time, poses, followed)
            yield renderer.render()
    finally:
        renderer.close()


def film_library() -> Any:
    """The library that writes films, with its ffmpeg.

    Returns:
        imageio.v2.

    Raises:
        RuntimeError: If the extra `render` is missing.
    """
    try:
        import imageio.v2 as imageio
        import imageio_ffmpeg  # noqa: F401  imageio finds it by itself, and says less well that it is missing
    except ImportError as error:
        raise RuntimeError(f"films need the extra 'render': {install_hint('render')}") from error
    return imageio


def write_film(episode: Episode, shot: Shot, path: Path) -> Iterator[int]:
    """Write a film or, to a PNG, one frame; the file appears whole or not at all.

    Args:
        episode: What is drawn.
        shot: From where, and when.
        path: Ends in one of `ENDINGS`. A PNG shows the shot's beginning or, if it names none, its middle.

    Yields:
        Number of frames so far.

    Raises:
        ValueError: If the ending is none of these; see also `times_of`.
        RuntimeError: If nothing here can draw, or the extra `render` is missing.
    """
    if path.suffix not in ENDINGS:
        raise ValueError(f"{path.name} ends in {path.suffix!r}, which is not allowed; allowed: {', '.join(ENDINGS)}")
    imageio = film_library()
    with written_whole(path) as part:
        if path.suffix == ".png":
            times = times_of(shot, episode)
            middle = float(times[len(times) // 2 if shot.begin is None else 0])
            imageio.imwrite(part, next(frames(episode, replace(shot, begin=middle))))
            yield 1
            return
        drawn = frames(episode, shot)
        settings: dict[str, Any] = (
            {"duration": 1000.0 / shot.rate, "loop": 0}
            if path.suffix == ".gif"
            else {"fps": shot.rate, "codec": "libx264", "quality": 7, "macro_block_size": 2}
        )
        writer: Any  # imageio types its plugins' writers by a base class that cannot write
        with imageio.get_writer(part, **settings) as writer:
            for count, frame in enumerate(drawn, start=1):
                writer.append_data(frame)
                yield count


class _Follower:
    """A camera behind an agent, looking along its whole trip, so that it does not swing with every turn."""

    def __init__(self, episode: Episode, agent: int) -> None:
        trip = episode.agent_goal[agent] - episode.agent_start[agent]
        self._agent = agent
        self._camera = mujoco.MjvCamera()
        self._camera.distance, self._camera.elevation = 5.5, -28.0
        self._camera.azimuth = float(np.degrees(np.arctan2(trip[1], trip[0])))
        self._camera.lookat = [*episode.agent_start[agent], 0.4]

    def at(self, poses: Poses) -> mujoco.MjvCamera:
        """Where it stands; it stays where the agent was last."""
        place = poses.agent[self._agent]
        if np.isfinite(place[0]):
            self._camera.lookat = [*place, 0.4]
        return self._camera


def _renderer(model: mujoco.MjModel, shot: Shot) -> mujoco.Renderer:
    backend = os.environ.get("MUJOCO_GL", "glfw")
    if backend in _OFF:
        raise RuntimeError(NO_LIBRARY)
    try:
        return mujoco.Renderer(model, height=shot.height, width=shot.width, max_geom=20_000)
    except (RuntimeError, AttributeError, ImportError, OSError, mujoco.FatalError) as error:
        raise RuntimeError(f"{NO_LIBRARY}; MUJOCO_GL is {backend!r}, which says: {error}") from error
