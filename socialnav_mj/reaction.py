"""How people give way to robots: a push by the time to a collision, and the way back to the recorded track.

The push is that of Karamouzas, Skinner and Guy 2014 (doi 10.1103/PhysRevLett.113.238701), who measured the energy of
two walkers on zara01, zara02 and students003 among others: it depends on the time tau to their collision, as
k exp(-tau / tau_0) / tau^2, and not on their distance. So whom nobody is going to meet is not pushed at all.
"""

from dataclasses import dataclass

import numpy as np

from socialnav_mj.elementary import exp
from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array

STRENGTH = {"weak": 0.05, "yielding": 1.5}
"""k of each level. 1.5 is what the authors simulate walkers with; with 0.05 people of zara01 are spared half of their
collisions with a stranger, see docs/simulation.md [m^2]."""
SCREENING_TIME = 3.0
"""tau_0, beyond which nobody reacts to a collision yet: the authors' [s]."""
HORIZON = 4.0
"""Later collisions do not count: their push is below k / 70 [s]."""
LEAST_TIME = 0.1
"""Sooner collisions push no harder [s]."""
CLEARANCE = 0.1
"""Kept between the bodies of a person and a robot [m]."""
SIGHT_COSINE = -0.17364817766693033
"""Cosine of 100 degrees: who is farther aside or behind is out of sight (Helbing and Molnar 1995), and ..."""
UNSEEN = 0.5
"""... counts by this factor, as there."""
MAX_ACCELERATION = 1.6
"""Of a person besides the recorded one: 99.5 % of those of zara01 and zara02 are lower [m/s^2]."""
MAX_SPEED = 1.9
"""Who deviates walks no faster, unless the recording does: 99 % of zara01 and zara02 are slower [m/s]."""
RELAXATION_TIME = 0.5
"""In which a person takes on the velocity that it wants: tau of the social force model [s]."""
RETURN_TIME = 1.0
"""In which a person wants to be back on its track: twice that, so that it hardly swings over [s]."""
RETURN_SPEED = 0.5
"""But no faster than that besides the recorded velocity [m/s]."""
_NEARER = 0.98
"""Who is nearer than the distance that is kept does not want to come nearer: the distance becomes that share."""
_SHARPEST = 0.5
"""A grazing collision pushes at most 1 / this harder than one in the middle."""
_BACK = (1e-3, 1e-2)
"""Who is this near to its track, and this slow besides it, is on it again [m], [m/s]."""
_ROUNDS = 4
"""Of moving apart people who would meet."""


@dataclass(frozen=True, kw_only=True)
class Movers:
    """Bodies on the floor."""

    position: Array
    """(m, 2) [m]."""
    velocity: Array
    """(m, 2) [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """How people are off their recorded tracks."""

    offset: Array
    """(m, 2) from the recorded place [m]."""
    drift: Array
    """(m, 2) velocity besides the recorded one [m/s]."""

    @classmethod
    def none(cls, n_people: int) -> "Deviation":
        """Everybody is on the track.

        Args:
            n_people: m.

        Returns:
            Zeros.
        """
        return cls(offset=np.zeros((n_people, 2)), drift=np.zeros((n_people, 2)))

    @property
    def rows(self) -> IntArray:
        """Who deviates, ascending."""
        return np.flatnonzero(self.offset.any(axis=1) | self.drift.any(axis=1))


def push(people: Movers, others: Movers, *, distance: float, facing: Array | None = None) -> Array:
    """Acceleration away from predicted collisions, for k = 1: minus the gradient of exp(-tau / tau_0) / tau^2.

    With x and v from the other to the person, n = x + v tau and s = sqrt((x v)^2 - v^2 (x^2 - R^2)) it is
    exp(-tau / tau_0) / tau^2 (2 / tau + 1 / tau_0) n / s.

    Args:
        people: Who is pushed, m.
        others: Who is avoided, k. The same body at the same place does not count.
        distance: R between centres that counts as a collision [m].
        facing: Unit vectors, shape (m, 2): others out of sight count less; None if all count alike.

    Returns:
        Shape (m, 2); exactly 0 for who meets nobody within `HORIZON` [m/s^2 per m^2].
    """
    x = people.position[:, None] - others.position
    v = people.velocity[:, None] - others.velocity
    square, speed_square = _dot(x, x), _dot(v, v)
    approach = _dot(x, v)
    kept = np.minimum(distance * distance, _NEARER * _NEARER * square)
    discriminant = approach * approach - speed_square * (square - kept)
    i, j = np.nonzero((approach < 0.0) & (discriminant > 0.0))
    root = np.sqrt(discriminant[i, j])
    time = (square[i, j] - kept[i, j]) / (root - approach[i, j])
    soon = time < HORIZON
    i, j, root, time = i[soon], j[soon], root[soon], time[soon]
    there = x[i, j] + v[i, j] * time[:, None]
    steep = np.maximum(root, _SHARPEST * np.sqrt(speed_square[i, j] * kept[i, j]))
    late = np.maximum(time, LEAST_TIME)
    size = exp(-late / SCREENING_TIME) / (late * late) * (2.0 / late + 1.0 / SCREENING_TIME) / steep
    if facing is not None:
        seen = -_dot(x[i, j], facing[i]) >= SIGHT_COSINE * np.sqrt(square[i, j])
        size = np.where(seen, size, UNSEEN * size)
    return np.stack([np.bincount(i, size * there[:, axis], len(people.position)) for axis in (0, 1)], axis=1)


def deviate(
    deviation: Deviation,
    *,
    people: Movers,
    recorded: Movers,
    following: Array,
    facing: Array,
    robots: Movers,
    strength: float,
    timestep: float,
    distance: float,
    body: float,
) -> Deviation:
    """Where people are off their tracks one control step later.

    Args:
        deviation: Of m people now.
        people: Where they are.
        recorded: Where the recording has them.
        following: Where it has them one step later, shape (m, 2); NaN for who will have left [m].
        facing: Unit vectors of their headings, shape (m, 2).
        robots: To which they react.
        strength: k [m^2].
        timestep: Of the control step [s].
        distance: Between the centres of a robot and a person who touch [m].
        body: Distance between the centres of two people who touch [m].

    Returns:
        The deviation then; exactly 0 for whom no robot has pushed off its track, or who is back on it.
    """
    pushed = strength * push(people, robots, distance=distance + CLEARANCE, facing=facing)
    by_robots = np.any(pushed, axis=1)
    rows = np.flatnonzero(by_robots | deviation.offset.any(axis=1) | deviation.drift.any(axis=1))
    if not rows.size:
        return deviation
    offset, drift, force = deviation.offset[rows], deviation.drift[rows], pushed[rows]
    # Of the others it takes notice as far as the deviation changes what they are to it: they are in the recording.
    here, there = (Movers(position=m.position[rows], velocity=m.velocity[rows]) for m in (people, recorded))
    force = force + strength * (push(here, people, distance=body) - push(there, recorded, distance=body))
    wanted = -limited(offset / RETURN_TIME, RETURN_SPEED)
    force = limited(force + (wanted - drift) / RELAXATION_TIME, MAX_ACCELERATION)
    walk = recorded.velocity[rows]
    fastest = np.maximum(np.hypot(walk[:, 0], walk[:, 1]), MAX_SPEED)
    after = limited(walk + drift + timestep * force, fastest) - walk
    moved = offset + 0.5 * timestep * (drift + after)
    near = np.asarray(np.hypot(*moved.T) < _BACK[0]) & np.asarray(np.hypot(*after.T) < _BACK[1])
    back = np.flatnonzero(~by_robots[rows] & near)
    moved[back] = after[back] = 0.0
    result = Deviation(offset=deviation.offset.copy(), drift=deviation.drift.copy())
    result.offset[rows], result.drift[rows] = moved, after
    _part(result, rows, following, body=body, timestep=timestep)
    return result


def _part(deviation: Deviation, rows: IntArray, following: Array, *, body: float, timestep: float) -> None:
    """Move apart, in place, who would be nearer than a body is wide, and nearer than the recording has them."""
    offset, before = deviation.offset, deviation.offset[rows].copy()
    gap = following[rows][:, None] - following
    least = np.minimum(np.hypot(gap[..., 0], gap[..., 1]), body)
    least[np.arange(len(rows)), rows] = np.nan
    deviates = np.zeros(len(offset), dtype=bool)
    deviates[rows] = True
    for _ in range(_ROUNDS):
        now = gap + offset[rows][:, None] - offset
        apart = np.hypot(now[..., 0], now[..., 1])
        i, j = np.nonzero(apart < least - 1e-9)
        if not i.size:
            break
        # Who stands on the very spot of another is moved along x.
        way = np.where(apart[i, j, None] > 1e-9, now[i, j] / np.maximum(apart[i, j], 1e-9)[:, None], (1.0, 0.0))
        lack = (least - apart)[i, j, None] * np.where(deviates[j], 0.5, 1.0)[:, None]
        np.add.at(offset, rows[i], lack * way)
    deviation.drift[rows] += (offset[rows] - before) / timestep


def limited(vectors: Array, limit: Array | float) -> Array:
    """Vectors, shortened where they are longer than a limit.

    Args:
        vectors: Shape (m, 2).
        limit: > 0, for all or for each, shape (m,).

    Returns:
        Shape (m, 2).
    """
    length = np.hypot(vectors[:, 0], vectors[:, 1])
    return vectors * np.minimum(1.0, limit / np.maximum(length, limit))[:, None]


def _dot(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]
