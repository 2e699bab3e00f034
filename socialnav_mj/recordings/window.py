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
    ids, times, positions = [], [], []
    for index in range(recording.n_people):
        own = recording.times[index]
        inside = own[(own > first) & (own < last)]
        edges = np.array([first, last])
        cut = np.union1d(inside, edges[(edges >= own[0]) & (edges <= own[-1])])
        if len(cut) < 2:
            continue
        ids.append(int(recording.ids[index]))
        times.append(cut - first)
        positions.append(recording.person(index).at(cut)[0])
    return Recording(
        name=recording.name,
        variant=f"{recording.variant}[{begin:g}-{end:g}]",
        frame_rate=recording.frame_rate,
        ids=np.array(ids, dtype=np.int64),
        times=tuple(times),
        positions=tuple(positions),
        checksum=recording.checksum,
        frame_rate_origin=recording.frame_rate_origin,
        reading=recording.reading,
    )
