"""A part of a recording in time, as a recording of its own."""

import numpy as np

from socialnav_mj.recordings.recording import Recording


def window(recording: Recording, begin: float, end: float) -> Recording:
    """What happens between two moments; whoever is there at one of them enters or leaves there.

    Args:
        recording: Whose tracks are cut at the two moments.
        begin: As a share of its duration, in [0, 1).
        end: As a share of its duration, in (begin, 1].

    Returns:
        A recording whose time 0 is the beginning. People keep their ids; those of whom nothing is left are gone. The
        checksum stays that of the source, and the variant names the window.

    Raises:
        ValueError: If the shares are not in order.
    """
    if not 0.0 <= begin < end <= 1.0:
        raise ValueError(f"window [{begin}, {end}] is not allowed; allowed: 0 <= begin < end <= 1")
    first, last = begin * recording.duration, end * recording.duration
    return _cut(recording, first, last, last, f"[{begin:g}-{end:g}]")


def excerpt(recording: Recording, begin: float, end: float) -> Recording:
    """Whoever is there between two moments, from the first of them to where they really went.

    Args:
        recording: Whose tracks are cut at the first moment alone.
        begin: At least 0, before the end of the recording [s].
        end: Whoever appears later is left out, > begin [s].

    Returns:
        As `window` does.

    Raises:
        ValueError: If the moments are not in order.
    """
    if not 0.0 <= begin < end:
        raise ValueError(f"excerpt from {begin} to {end} s is not allowed; allowed: 0 <= begin < end")
    return _cut(recording, begin, end, recording.duration, f"[{begin:g} s-{end:g} s]")


def _cut(recording: Recording, first: float, latest: float, last: float, name: str) -> Recording:
    """People who are there between `first` and `latest`, between `first` and `last`."""
    ids, times, positions = [], [], []
    for index in np.flatnonzero((recording.start_time <= latest) & (recording.end_time >= first)):
        own = recording.times[index]
        inside = own[(own > first) & (own < last)]
        edges = np.array([first, last])
        cut = np.union1d(inside, edges[(edges >= own[0]) & (edges <= own[-1])])
        if len(cut) < 2:
            continue
        ids.append(int(recording.ids[index]))
        times.append(cut - first)
        positions.append(recording.person(int(index)).at(cut)[0])
    return Recording(
        name=recording.name,
        variant=f"{recording.variant}{name}",
        frame_rate=recording.frame_rate,
        ids=np.array(ids, dtype=np.int64),
        times=tuple(times),
        positions=tuple(positions),
        checksum=recording.checksum,
        frame_rate_origin=recording.frame_rate_origin,
        reading=recording.reading,
    )
