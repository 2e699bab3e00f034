"""Who is near whom, and who walks together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.recording import Crowd, Recording

SAMPLE_TIMESTEP = 0.2
"""Time between two looks at a recording; one default control step [s]."""
COMPANION_DISTANCE = 1.5
"""Companions walk nearer than this [m]."""
COMPANION_SHARE = 0.8
"""Companions are near each other for this share of the shorter one's presence."""
COMPANION_RELATIVE_SPEED = 0.3
"""Companions' velocities differ by less than this, on average over the time both are there [m/s]."""
COMPANION_SPEED = 0.2
"""Slower pairs stand together rather than walk together; mean of both over the time both are there [m/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Every two people who are present at the same time, once per time; k rows in the order of time."""

    row: NDArray[np.int64]
    """(k,) index of the time."""
    first: NDArray[np.int64]
    """(k,) index of the person with the smaller index."""
    second: NDArray[np.int64]
    """(k,) index of the other."""
    distance: Array
    """(k,) between their centres [m]."""


def sample_times(recording: Recording, timestep: float = SAMPLE_TIMESTEP) -> Array:
    """Evenly spaced times over a recording.

    Args:
        recording: Its first appearance and its end bound the times.
        timestep: Between two times, > 0 [s].

    Returns:
        (t,) from the first appearance to the end at most [s].
    """
    first = float(recording.start_time.min())
    count = int((recording.duration - first) / timestep + 1e-6) + 1
    return np.asarray(first + timestep * np.arange(count), dtype=float)


def pairs_of(crowd: Crowd) -> Pairs:
    """Distances between all people who are present together.

    Args:
        crowd: n people at t times.

    Returns:
        One row for every time and every two people who are present at it.
    """
    rows, firsts, seconds, distances = [], [], [], []
    for row, present in enumerate(crowd.present):
        people = np.flatnonzero(present)
        i, j = np.triu_indices(len(people), 1)
        gap = crowd.position[row, people[i]] - crowd.position[row, people[j]]
        rows.append(np.full(len(i), row))
        firsts.append(people[i])
        seconds.append(people[j])
        distances.append(np.hypot(gap[:, 0], gap[:, 1]))
    row_index, first, second = (np.concatenate(column).astype(np.int64) for column in (rows, firsts, seconds))
    return Pairs(row=row_index, first=first, second=second, distance=np.concatenate(distances))


def companions(recording: Recording) -> NDArray[np.int64]:
    """Pairs who walk together.

    Two people are companions if they are within `COMPANION_DISTANCE` for `COMPANION_SHARE` of the shorter one's
    presence, their velocities differ by less than `COMPANION_RELATIVE_SPEED` on average, and they walk at
    `COMPANION_SPEED` or more on average; sampled every `SAMPLE_TIMESTEP`. Of the pairs so found, UCY's hand-made
    groups hold all 54 of zara01, 63 of 65 of zara02 and 53 of 60 of students003's (obsmat annotations); of the groups'
    pairs it finds three quarters in zara01, nine tenths in zara02, a third in students003, whose obsmat is noisy.

    Args:
        recording: Sampled from its first appearance to its end.

    Returns:
        (n_pairs, 2) indices of people, the smaller first, in ascending order.
    """
    crowd = recording.at(sample_times(recording))
    return companions_of(crowd, pairs_of(crowd))


def companions_of(crowd: Crowd, pairs: Pairs) -> NDArray[np.int64]:
    """Pairs who walk together by the rule of `companions`, from samples that are at hand.

    Args:
        crowd: At evenly spaced times; shares of presence are shares of its rows.
        pairs: `pairs_of(crowd)`.

    Returns:
        (n_pairs, 2) indices of people, the smaller first, in ascending order.
    """
    n_people = crowd.present.shape[1]
    key, which = np.unique(pairs.first * n_people + pairs.second, return_inverse=True)
    first, second = np.divmod(key, max(n_people, 1))
    presence = crowd.present.sum(axis=0)
    one, other = crowd.velocity[pairs.row, pairs.first], crowd.velocity[pairs.row, pairs.second]
    count = np.bincount(which, minlength=len(key))

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(which, values, minlength=len(key)) / count)

    near = np.bincount(which, pairs.distance < COMPANION_DISTANCE, minlength=len(key))
    speed = mean(0.5 * (np.hypot(*one.T) + np.hypot(*other.T)))
    together = (
        (near >= COMPANION_SHARE * np.minimum(presence[first], presence[second]))
        & (mean(np.hypot(*(one - other).T)) < COMPANION_RELATIVE_SPEED)
        & (speed >= COMPANION_SPEED)
    )
    return np.stack([first[together], second[together]], axis=1)
