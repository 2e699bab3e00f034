"""What looks wrong with a recording's scale in space or time, with the probable cause."""

import numpy as np
from scipy.spatial import cKDTree

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.curves import MOVING_SPEED
from socialnav_mj.recordings.recording import Recording

WALKING_SPEEDS = (0.5, 2.0)
"""Median speeds of people who walk lie between these [m/s]; of the UCY scenes 0.72 to 1.21."""
FASTEST_RUN = 10.0
"""Nobody runs faster for long; frame rates that are taken for others make people that fast less often than pixels do
[m/s]."""
FAR_NEIGHBOUR = 20.0
"""People whose nearest neighbour is farther than this, in the median, are no crowd [m]; students003: 0.74."""
_LOOKS = 20
"""Moments at which neighbours are looked for."""


def walking_speed(recording: Recording) -> float:
    """Median speed between successive samples over the time in which people walk (0.1 m/s or faster).

    Args:
        recording: Its samples are taken as they are, without interpolation.

    Returns:
        NaN if nobody walks [m/s].
    """
    duration = np.concatenate([np.diff(t) for t in recording.times])
    step = np.concatenate([np.diff(x, axis=0) for x in recording.positions])
    speed = np.hypot(step[:, 0], step[:, 1]) / duration
    walking = speed >= MOVING_SPEED
    if not walking.any():
        return float("nan")
    order = np.argsort(speed[walking])
    passed = np.cumsum(duration[walking][order])
    return float(speed[walking][order][np.searchsorted(passed, 0.5 * passed[-1])])


def nearest_neighbour(recording: Recording) -> float:
    """Median distance to the nearest other person, at 20 moments over the recording, straight between samples.

    Args:
        recording: Looked at from its first appearance to its end.

    Returns:
        NaN if nobody is ever together with somebody [m].
    """
    # People laid end to end in time, so that one search finds everybody's samples.
    span = recording.duration + 1.0
    count = np.array([len(t) for t in recording.times])
    last = np.cumsum(count) - 1
    times, positions = np.concatenate(recording.times), np.concatenate(recording.positions)
    key = times + span * np.repeat(np.arange(recording.n_people), count)
    distances: list[Array] = []
    for time in np.linspace(recording.start_time.min(), recording.duration, _LOOKS):
        there = np.flatnonzero((recording.start_time <= time) & (recording.end_time >= time))
        if len(there) < 2:
            continue
        row = np.searchsorted(key, time + span * there, side="right") - 1
        row = np.clip(row, last[there] - count[there] + 1, last[there] - 1)
        share = (time - times[row]) / (times[row + 1] - times[row])
        position = positions[row] + share[:, None] * (positions[row + 1] - positions[row])
        distance, _ = cKDTree(position).query(position, k=[2])
        distances.append(np.asarray(distance)[:, 0])
    return float(np.median(np.concatenate(distances))) if distances else float("nan")


def doubts(recording: Recording) -> tuple[str, ...]:
    """What looks wrong with a recording's frame rate or unit, and which setting would mend it.

    Args:
        recording: Its walking speed, its nearest neighbours and the origin of its frame rate are looked at.

    Returns:
        Sentences for a warning; none for a plausible recording.
    """
    low, high = WALKING_SPEEDS
    rate = f"the frame rate of {recording.frame_rate:g} Hz ({recording.frame_rate_origin})"
    found = []
    speed = walking_speed(recording)
    if np.isnan(speed):
        found.append(f"nobody walks at {MOVING_SPEED:g} m/s or faster; probably {rate} or the unit (--units) is wrong")
    elif speed > FASTEST_RUN:
        found.append(
            f"people walk at {speed:.3g} m/s (median; usual are {low:g} to {high:g}); probably the positions are "
            f"pixels or no metres (--units), or {rate} is wrong (--frame-rate sets it)"
        )
    elif not low <= speed <= high:
        found.append(
            f"people walk at {speed:.3g} m/s (median; usual are {low:g} to {high:g}); probably {rate} is wrong "
            "(--frame-rate sets it), or the positions are pixels or no metres (--units)"
        )
    distance = nearest_neighbour(recording)
    if distance > FAR_NEIGHBOUR:
        found.append(
            f"the nearest neighbour is {distance:.3g} m away (median; in a crowd less than {FAR_NEIGHBOUR:g}); "
            "probably the positions are pixels or no metres (--units)"
        )
    return tuple(found)
