"""How people give way to robots: a push by the time to a collision, and the way back to the recorded track.

The push is that of Karamouzas, Skinner and Guy 2014 (doi 10.1103/PhysRevLett.113.238701), who measured the energy of
two walkers on zara01, zara02 and students003 among others: it depends on the time tau to their collision, as
k exp(-tau / tau_0) / tau^2, and not on their distance. So whom nobody is going to meet is not pushed at all.
"""

from dataclasses import dataclass
from math import exp, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array

STRENGTH = {"weak": 0.05, "yielding": 1.5}
"""k of each level. 1.5 is what the authors simulate walkers with. With 0.05 people of zara01 are spared 54 of 89
collisions with strangers, with 1.5 81 of them, see docs/simulation.md [m^2]."""
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
NOTICE = 0.15
"""Who is off its track by less, along each axis, is to the others what it is in the recording: half a body [m]."""
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
        return np.flatnonzero(_is_moved(self.offset) | _is_moved(self.drift))


def push(people: Movers, others: Movers, *, distance: float, facing: Array | None = None) -> Array:
    """Acceleration away from predicted collisions, for k = 1: minus the gradient of exp(-tau / tau_0) / tau^2.

    With x and v from the other to the person, n = x + v tau and s = sqrt((x v)^2 - v^2 (x^2 - R^2)) it is
    exp(-tau / tau_0) / tau^2 (2 / tau + 1 / tau_0) n / s.

    Args:
        people: Who is pushed, m; arrays may have more axes in front, for several crowds at once.
        others: Who is avoided, k, with the same axes in front. The same body at the same place does not count.
        distance: R between centres that counts as a collision [m].
        facing: Quaternions of the headings, shape (m, 4): others out of sight count less; None if all count alike.

    Returns:
        The shape of people's positions; exactly 0 for who meets nobody within `HORIZON` [m/s^2 per m^2].
    """
    x_0, x_1, v_0, v_1 = (
        own[..., :, None, axis] - other[..., None, :, axis]
        for own, other in ((people.position, others.position), (people.velocity, others.velocity))
        for axis in (0, 1)
    )
    across = x_0 * v_1 - x_1 * v_0
    meets = x_0 * v_0 + x_1 * v_1 < 0.0
    limit = distance * distance
    meets &= across * across < limit * (v_0 * v_0 + v_1 * v_1)
    result = np.zeros_like(people.position)
    pairs = np.nonzero(meets)
    if not pairs[0].size:
        return result
    # There are few, and for few the C library's numbers, one after the other, are faster than arrays.
    rows = zip(*(index.tolist() for index in pairs[:-1]), strict=True)
    for row, a, b, c, d in zip(rows, *(values[pairs].tolist() for values in (x_0, x_1, v_0, v_1)), strict=True):
        square, speed, approach = a * a + b * b, c * c + d * d, a * c + b * d
        kept = min(limit, _NEARER * _NEARER * square)
        discriminant = approach * approach - speed * (square - kept)
        if discriminant <= 0.0:
            continue
        root = sqrt(discriminant)
        time = (square - kept) / (root - approach)
        if time >= HORIZON:
            continue
        late = max(time, LEAST_TIME)
        size = exp(-late / SCREENING_TIME) / (late * late) * (2.0 / late + 1.0 / SCREENING_TIME)
        size /= max(root, _SHARPEST * sqrt(speed * kept))
        if facing is not None:
            w, _, _, z = facing[row].tolist()
            seen = -(a * (w * w - z * z) + b * (2.0 * w * z)) >= SIGHT_COSINE * sqrt(square)
            size *= 1.0 if seen else UNSEEN
        result[row] += (size * (a + c * time), size * (b + d * time))
    return result


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
        people: Where they are; NaN for who is not there.
        recorded: Where the recording has them.
        following: Where it has them one step later, shape (m, 2); NaN for who will have left [m].
        facing: Quaternions of their headings, shape (m, 4).
        robots: To which they react.
        strength: k [m^2].
        timestep: Of the control step [s].
        distance: Between the centres of a robot and a person who touch [m].
        body: Distance between the centres of two people who touch [m].

    Returns:
        The deviation then; exactly 0 for whom no robot has pushed off its track, or who is back on it.
    """
    force = strength * push(people, robots, distance=distance + CLEARANCE, facing=facing)
    by_robots = _is_moved(force)
    rows = np.flatnonzero(by_robots | _is_moved(deviation.offset) | _is_moved(deviation.drift))
    if not rows.size:
        return deviation
    offsets = deviation.offset[rows].tolist()
    noticing = [row for row, (x, y) in zip(rows.tolist(), offsets, strict=True) if max(abs(x), abs(y)) > NOTICE]
    if noticing:
        # Of the others it takes notice as far as the deviation changes what they are to it: they are in the recording.
        place, pace = np.array((people.position, recorded.position)), np.array((people.velocity, recorded.velocity))
        own = Movers(position=place[:, noticing], velocity=pace[:, noticing])
        by_people = push(own, Movers(position=place, velocity=pace), distance=body)
        force[noticing] += strength * (by_people[0] - by_people[1])
    values = (deviation.drift[rows], force[rows], recorded.velocity[rows], by_robots[rows])
    listed = (value.tolist() for value in values)
    after = [_stepped(o, d, f, w, p, timestep) for o, d, f, w, p in zip(offsets, *listed, strict=True)]
    result = Deviation(offset=deviation.offset.copy(), drift=deviation.drift.copy())
    both = np.array(after)
    result.offset[rows], result.drift[rows] = both[:, :2], both[:, 2:]
    _part(result, rows, following, body=body, timestep=timestep)
    return result


def _is_moved(values: Array) -> NDArray[np.bool_]:
    """Which rows of (m, 2) are not exactly 0, NaN among them; faster than `any` on so few."""
    moved: NDArray[np.bool_] = (values[:, 0] != 0.0) | (values[:, 1] != 0.0)
    return moved


Pair = tuple[float, float]


def _stepped(
    offset: Pair, drift: Pair, force: Pair, walk: Pair, pushed: bool, timestep: float
) -> tuple[float, float, float, float]:
    """Offset and drift of one person after a step, of what it wants and what pushes it, within its limits."""
    x, y = _limited(-offset[0] / RETURN_TIME, -offset[1] / RETURN_TIME, RETURN_SPEED)
    x, y = force[0] + (x - drift[0]) / RELAXATION_TIME, force[1] + (y - drift[1]) / RELAXATION_TIME
    x, y = _limited(x, y, MAX_ACCELERATION)
    u, v = walk
    x, y = _limited(u + drift[0] + timestep * x, v + drift[1] + timestep * y, max(hypot(u, v), MAX_SPEED))
    x, y = x - u, y - v
    there = offset[0] + 0.5 * timestep * (drift[0] + x), offset[1] + 0.5 * timestep * (drift[1] + y)
    if not pushed and hypot(*there) < _BACK[0] and hypot(x, y) < _BACK[1]:
        return 0.0, 0.0, 0.0, 0.0
    return *there, x, y


def _limited(x: float, y: float, limit: float) -> Pair:
    """A vector, shortened if it is longer than a limit."""
    length = hypot(x, y)
    return (x * limit / length, y * limit / length) if length > limit else (x, y)


def _part(deviation: Deviation, rows: IntArray, following: Array, *, body: float, timestep: float) -> None:
    """Move apart, in place, who would be nearer than a body is wide, and nearer than the recording has them."""
    offset = deviation.offset
    there = following + offset
    own = there[rows]
    x, y = own[:, :1] - there[:, 0], own[:, 1:] - there[:, 1]
    # Everybody is near itself, unless it will have left, and then is NaN.
    if np.count_nonzero(x * x + y * y < body * body) <= np.count_nonzero(own[:, 0] == own[:, 0]):
        return
    before = offset[rows]
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
