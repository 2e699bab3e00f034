"""The page that a viewer opens on when it shows several traces, and the command that opens them."""

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from socialnav_mj.episode import EpisodeError
from socialnav_mj.files import written_whole
from socialnav_mj.trace.layout import KEY

HOST = "127.0.0.1"
"""Whoever is on this machine alone."""


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What a trace says of its episode."""

    path: Path
    scenario: str
    controller: str
    draw: int
    dataset: str
    success: float
    """Share of agents; NaN without any."""
    state_hash: str


def read_facts(path: Path) -> Facts:
    """Read what a trace says of its episode.

    Args:
        path: Of `writer.write_trace`.

    Returns:
        Its facts.

    Raises:
        EpisodeError: If the file is no trace of ours, or damaged.
    """
    try:
        for chunk in RrdReader(path).stream().to_chunks():
            batch = chunk.to_record_batch()
            if "configuration" in batch.schema.names:
                return _facts(path, {name: batch.column(name).to_pylist()[-1][0] for name in _NAMES})
    except (RuntimeError, ValueError, TypeError, KeyError, IndexError) as error:
        raise EpisodeError(f"{path} is not a readable trace: {error}") from error
    raise EpisodeError(f"{path} is no trace of ours: it carries no configuration")


_NAMES = ("scenario", "controller", "draw", "dataset", "success", "state_hash")


def _facts(path: Path, found: Mapping[str, Any]) -> Facts:
    texts = {name: str(found[name]) for name in ("scenario", "controller", "dataset", "state_hash")}
    return Facts(path=path, draw=int(found["draw"]), success=float(found["success"]), **texts)


def write_start(markdown: str, path: Path) -> Path:
    """Write the start page as a recording of its own.

    Args:
        markdown: What is on it, above the key to the colours.
        path: Target, ending in .rrd.

    Returns:
        The path written.
    """
    view = rrb.TextDocumentView(name="Traces", origin="/start")
    blueprint = rrb.Blueprint(
        view,
        rrb.BlueprintPanel(state="expanded"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="hidden"),
    )
    with written_whole(path) as part:
        # An application of its own: a blueprint is for all recordings of one application.
        recording = rr.RecordingStream("socialnav_mj_start", recording_id="start", send_properties=False)
        recording.save(part, default_blueprint=blueprint)
        recording.send_recording_name("Start: table of traces")
        text = f"{markdown}\n\n## Key to the traces\n{KEY}"
        recording.log("/start", rr.TextDocument(text, media_type="text/markdown"), static=True, strict=True)
        recording.flush()
        recording.disconnect()
    return path


def viewer_command(paths: Sequence[Path], *, web_port: int | None, port: int) -> list[str]:
    """Command that opens recordings.

    Args:
        paths: In the viewer's order.
        web_port: Where a browser finds the viewer on this machine; None for a window.
        port: Where the viewer's own server listens, on this machine alone.

    Returns:
        Words of a command line.
    """
    command = [sys.executable, "-m", "rerun", "--bind", HOST, "--port", str(port)]
    if web_port is not None:
        command += ["--serve-web", "--web-viewer-port", str(web_port)]
    return [*command, *map(str, paths)]


def viewer_environment() -> dict[str, str]:
    """Variables that the viewer runs with: ours, and one that keeps it from sending statistics of its use.

    Returns:
        Name: value.
    """
    return os.environ | {"CI": "true"}
