"""Who is near whom, and who walks together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.curves import TIME_TOLERANCE
from socialnav_mj.recordings.recording import Recording

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
class Steps:
    """One row a person and time at which it is there (a person-step), in the order of time, then person; k rows."""

    row: NDArray[np.int64]
    """(k,) index of the time."""
    person: NDArray[np.int64]
    """(k,) index of the person."""
    position: Array
    """(k, 2) [m]."""
    velocity: Array
    """(k, 2) [m/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Every two people who are present at the same time, once per time; in the order of time."""

    first: NDArray[np.int64]
    """(n_pairs,) index of the person-step with the smaller index of person."""
    second: NDArray[np.int64]
    """(n_pairs,) index of the other."""
    distance: Array
    """(n_pairs,) between their centres [m]."""


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


def steps_of(recording: Recording, times: Array) -> Steps:
    """Everybody at the times at which they are there; as `Recording.at`, without a cell for those who are not.

    Args:
        recording: The crowd.
        times: Ascending [s].

    Returns:
        The person-steps.
    """
    first = np.searchsorted(times, recording.start_time - TIME_TOLERANCE, side="left")
    count = np.searchsorted(times, recording.end_time + TIME_TOLERANCE, side="right") - first
    person = np.repeat(np.arange(recording.n_people), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
    order = np.argsort(row, kind="stable")
    row, person = row[order], person[order]
    position, velocity = recording.curves.position_and_velocity(person, times[row])
    return Steps(row=row, person=person, position=position, velocity=velocity)


def pairs_of(steps: Steps) -> Pairs:
    """Distances between all people who are present together.

    Args:
        steps: In their order.

    Returns:
        One row for every time and every two people who are present at it.
    """
    begin = np.flatnonzero(np.diff(steps.row, prepend=-1))
    firsts, seconds = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for start, end in zip(begin, [*begin[1:], len(steps.row)], strict=True):
        i, j = np.triu_indices(end - start, 1)
        firsts.append(start + i)
        seconds.append(start + j)
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    gap = steps.position[first] - steps.position[second]
    return Pairs(first=first, second=second, distance=np.hypot(gap[:, 0], gap[:, 1]))


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
    steps = steps_of(recording, sample_times(recording))
    return companions_of(steps, pairs_of(steps))


def companions_of(steps: Steps, pairs: Pairs) -> NDArray[np.int64]:
    """Pairs who walk together, from samples that are at hand; see `companions`.

    Args:
        steps: Evenly sampled.
        pairs: `pairs_of(steps)`.

    Returns:
        (n_pairs, 2) indices of people, the smaller first, in ascending order.
    """
    presence = np.bincount(steps.person)
    n_people = len(presence)
    key, which = np.unique(steps.person[pairs.first] * n_people + steps.person[pairs.second], return_inverse=True)
    first, second = np.divmod(key, max(n_people, 1))
    one, other = steps.velocity[pairs.first], steps.velocity[pairs.second]
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
