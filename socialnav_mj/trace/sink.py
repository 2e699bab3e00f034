"""The open rerun file of one trace: values that never change, and columns over simulated time."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

TIMELINE = "sim_time"
"""Name of the only time line: simulated time as a duration."""


class Sink:
    """Writes into one .rrd file; wrong values raise instead of being skipped with a warning."""

    def __init__(self, path: Path, *, name: str, recording_id: str, blueprint: rrb.Blueprint) -> None:
        """Open the file.

        Args:
            path: The .rrd file to be written.
            name: Shown by the viewer.
            recording_id: Files with the same id are taken for the same recording.
            blueprint: How the file looks when it is opened.
        """
        self.recording = rr.RecordingStream("socialnav_mj", recording_id=recording_id, send_properties=False)
        self.recording.save(path, default_blueprint=blueprint)
        self.recording.send_recording_name(name)

    def static(self, entity: str, *values: rr.AsComponents) -> None:
        """Write values that hold at all times.

        Args:
            entity: Path.
            values: Archetypes.
        """
        for value in values:
            self.recording.log(entity, value, static=True, strict=True)

    def columns(self, entity: str, time: ArrayLike, *columns: Iterable[rr.ComponentColumn]) -> None:
        """Write one row for each time; without times nothing is written.

        Args:
            entity: Path.
            time: (rows,) [s], kept to the nanosecond.
            columns: As the `columns` functions of rerun's archetypes return them, each with as many rows.
        """
        nanoseconds = np.rint(np.asarray(time, dtype=float) * 1e9).astype("timedelta64[ns]")
        if nanoseconds.size:
            index = [rr.TimeColumn(TIMELINE, duration=nanoseconds)]
            self.recording.send_columns(entity, index, [c for group in columns for c in group], strict=True)

    def close(self) -> None:
        """Write what is pending and the file's end."""
        self.recording.flush()
        self.recording.disconnect()
