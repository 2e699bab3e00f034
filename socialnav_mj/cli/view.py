"""The sub-commands that show episodes: `view` and `render`."""

import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Annotated, Literal

import tyro

from socialnav_mj.cli.arguments import Name
from socialnav_mj.cli.console import counted_progress, errors, say


@dataclass(frozen=True, kw_only=True)
class View:
    """Open the traces of a run, with a table of them to start from; nothing leaves this machine."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """Folder that `evaluate` wrote, a trace (.rrd), or an episode (.npz)."""
    web: bool = False
    """In a browser, at an address of this machine alone; by default in a window."""
    port: int = 9090
    """Of that address; without --web, where the viewer listens for data from this machine."""

    def run(self) -> None:
        """Write the table of traces to a folder of its own, and run the viewer until it is closed."""
        with tempfile.TemporaryDirectory(prefix="socialnav_mj_view_") as folder:
            with errors.status("traces"):
                paths = traces_of(self.path, Path(folder))
            if self.web:
                self._in_browser(paths)
            else:
                self._in_window(paths)

    def _in_browser(self, paths: list[Path]) -> None:
        from socialnav_mj.trace.web import web_viewer

        with suppress(KeyboardInterrupt), web_viewer(paths, self.port) as address:  # how it is closed
            say(f"traces: {len(paths) - 1}, shown at {address} until Ctrl-C")
            Event().wait()

    def _in_window(self, paths: list[Path]) -> None:
        from socialnav_mj.trace.start import viewer_command, viewer_environment

        if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise RuntimeError("there is no display for a window; --web shows the traces in a browser")
        command = viewer_command(paths, web_port=None, port=self.port)
        code = subprocess.run(command, env=viewer_environment(), check=False).returncode
        if code:
            raise RuntimeError(f"the viewer ended with exit code {code}; --web shows the traces in a browser")


def traces_of(path: Path, folder: Path) -> list[Path]:
    """Traces to be opened, the start page first.

    Args:
        path: Folder of a run, trace or episode.
        folder: Gets the start page, and the trace of an episode.

    Returns:
        Paths of recordings.

    Raises:
        FileNotFoundError: If there is no trace.
        EpisodeError: If a file is damaged or no trace of ours.
    """
    from socialnav_mj.episode import Episode
    from socialnav_mj.files import finished_files
    from socialnav_mj.report.start import start_page
    from socialnav_mj.trace.start import read_facts, write_start
    from socialnav_mj.trace.writer import write_trace

    if path.suffix == ".npz":
        traces = [write_trace(Episode.load(path), folder / f"{path.stem}.rrd")]
    elif path.suffix == ".rrd":
        traces = [path]
    else:
        traces = finished_files(path / "traces", ".rrd")
    if not traces:
        raise FileNotFoundError(f"no traces in {path / 'traces'}; `socialnav-mj report {path}` writes them")
    facts = [read_facts(trace) for trace in traces]
    return [write_start(start_page(str(path), facts), folder / "start.rrd"), *traces]


@dataclass(frozen=True, kw_only=True)
class Render:
    """Draw an episode with MuJoCo as a film (.mp4, .gif) or a picture (.png), from its record alone."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """Folder that `evaluate` wrote, or an episode (.npz)."""
    episode: Name = None
    """Which one of the folder, by its name without .npz; the first one of a controller by default."""
    camera: Literal["follow", "oblique", "top"] = "follow"
    """Behind an agent, or a view of all the floor."""
    agent: int | None = None
    """Number in the recording of the person whom the followed agent replaced; by default the agent that is longest on
    its way."""
    begin: float | None = None
    """[s] since the recording's first frame; by default when the followed agent comes."""
    seconds: float | None = None
    """Simulated time that is drawn; by default as long as the followed agent is there, else 20 s."""
    rate: float | None = None
    """Frames in a second; 25 by default, 10 in a GIF."""
    size: tuple[int, int] | None = None
    """Width and height [pixel]; 1280 720 by default, 640 360 in a GIF."""
    gif: bool = False
    """Write a GIF beside the film, too."""
    out: Path = Path("film.mp4")
    """File to be written."""

    def run(self) -> None:
        """Draw frame by frame behind a bar."""
        from socialnav_mj.episode import Episode
        from socialnav_mj.film.film import Shot, film_library, times_of, write_film

        film_library()  # what is missing is told before anything is read
        path = episode_of(self.path, self.episode)
        episode = Episode.load(path)
        targets = [self.out, *([self.out.with_suffix(".gif")] if self.gif and self.out.suffix != ".gif" else [])]
        for target in targets:
            small = target.suffix == ".gif"
            width, height = self.size or ((640, 360) if small else (1280, 720))
            shot = Shot(
                camera=self.camera,
                agent=self.agent,
                begin=self.begin,
                seconds=self.seconds,
                rate=self.rate or (10.0 if small else 25.0),
                width=width,
                height=height,
            )
            with counted_progress() as progress:
                total = 1 if target.suffix == ".png" else len(times_of(shot, episode))
                bar = progress.add_task("frames", total=total)
                for count in write_film(episode, shot, target):
                    progress.update(bar, completed=count)
            say(f"{path.name}: {target}")


def episode_of(path: Path, name: str | None) -> Path:
    """The episode that is meant.

    Args:
        path: Folder of a run, or an episode.
        name: Of an episode in the folder, without its ending; None for the first one that no people drove.

    Returns:
        Path of the episode.

    Raises:
        FileNotFoundError: If there is none; names those that are there.
    """
    from socialnav_mj.files import finished_files

    if path.suffix == ".npz":
        return path
    there = finished_files(path / "episodes", ".npz")
    chosen = [p for p in there if p.stem == name or (name is None and ".human." not in p.name)]
    if not chosen:
        names = ", ".join(p.stem for p in there[:12]) or "none"
        raise FileNotFoundError(f"no episode {name or ''} in {path / 'episodes'}; there are {names}")
    return chosen[0]
