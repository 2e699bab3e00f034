"""Shape-preserving cubic curves of many people, evaluated all at once (Fritsch and Carlson 1980, as in SciPy)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from socialnav_mj.elementary import arctan2
from socialnav_mj.geometry import Array

MOVING_SPEED = 0.1
"""A person slower than this stands, and keeps the heading of the last motion [m/s]."""
HEADING_TIMESTEP = 0.04
"""Spacing of the times, on each person's own track, at which motion is looked for; one UCY video frame [s]."""

TIME_TOLERANCE = 1e-6
"""A time this near a track's end is on it, so that rounding does not decide who is there [s]."""
_TABULATED_AT_ONCE = 500_000
"""Rows of the table of headings that are made together; 200 bytes each while they are."""


class Curves:
    """Positions, velocities and headings of n people at any time."""

    def __init__(self, times: Sequence[Array], positions: Sequence[Array]) -> None:
        """Fit one PCHIP per person and coordinate.

        Args:
            times: Per person (k_i,), k_i >= 2, strictly increasing [s].
            positions: Per person (k_i, 2) [m].
        """
        self.start = np.array([t[0] for t in times])
        self.end = np.array([t[-1] for t in times])
        counts = np.array([len(t) - 1 for t in times])
        self._last_segment = np.cumsum(counts) - 1
        self._first_segment = self._last_segment - counts + 1
        self._segment_start = np.concatenate([t[:-1] for t in times])
        # (n_segments, 4, 2): powers 3, 2, 1, 0 of the time since the segment's start.
        fits = [PchipInterpolator(t, x).c for t, x in zip(times, positions, strict=True)]
        self._coefficients = np.concatenate([np.moveaxis(c, 1, 0) for c in fits])
        # One sorted key for everybody: people laid end to end in time, so that one search serves all.
        self._span = float(self.end.max() - self.start.min()) + 1.0
        self._origin = float(self.start.min())
        people = np.repeat(np.arange(len(counts)), counts)
        self._key = self._segment_start - self._origin + people * self._span
        self._tabulate_headings()

    def present(self, people: NDArray[np.int64], times: ArrayLike) -> NDArray[np.bool_]:
        """Whether times are on the tracks, ends included.

        Args:
            people: Indices of people, any shape that broadcasts with `times`.
            times: Any shape that broadcasts with `people` [s].

        Returns:
            True where the person is there, of the broadcast shape.
        """
        times = np.asarray(times, dtype=float)
        late, early = times >= self.start[people] - TIME_TOLERANCE, times <= self.end[people] + TIME_TOLERANCE
        return np.asarray(late & early)

    def position_and_velocity(self, people: NDArray[np.int64], times: ArrayLike) -> tuple[Array, Array]:
        """Where people are and how they move; outside a track the nearest end's position and velocity 0.

        Args:
            people: Indices of people, any shape that broadcasts with `times`.
            times: Any shape that broadcasts with `people` [s].

        Returns:
            Positions [m] and velocities [m/s], both of the broadcast shape with a last axis of 2.
        """
        people, times = np.broadcast_arrays(people, np.asarray(times, dtype=float))
        inside = self.present(people, times)
        clamped = np.clip(times, self.start[people], self.end[people])
        key = clamped - self._origin + people * self._span
        segment = np.searchsorted(self._key, key, side="right") - 1
        segment = np.clip(segment, self._first_segment[people], self._last_segment[people])
        s = (clamped - self._segment_start[segment])[..., None]
        a, b, c, d = np.moveaxis(self._coefficients[segment], -2, 0)
        position = ((a * s + b) * s + c) * s + d
        velocity = ((3.0 * a * s + 2.0 * b) * s + c) * inside[..., None]
        return position, velocity

    def heading(self, people: NDArray[np.int64], times: ArrayLike, velocity: Array) -> Array:
        """Direction of motion; of a standing person the last one on its track, else the next, else 0.

        A moving person faces along its velocity. For a standing one, motion is looked for at fixed times of the
        track (every `HEADING_TIMESTEP`), so that the answer does not depend on which times are asked for.

        Args:
            people: Indices of people, any shape that broadcasts with `times`.
            times: Any shape that broadcasts with `people` [s].
            velocity: What `position_and_velocity` returned for them, with a last axis of 2 [m/s].

        Returns:
            Angle from the x axis in [-pi, pi], of the broadcast shape [rad].
        """
        people, times = np.broadcast_arrays(people, np.asarray(times, dtype=float))
        key = np.clip(times, self.start[people], self.end[people]) - self._origin + people * self._span
        row = np.searchsorted(self._heading_key, key, side="right") - 1
        row = np.clip(row, self._first_heading[people], self._last_heading[people])
        moving = np.hypot(velocity[..., 0], velocity[..., 1]) >= MOVING_SPEED
        return np.where(moving, arctan2(velocity[..., 1], velocity[..., 0]), self._heading[row])

    def _tabulate_headings(self) -> None:
        """Table of (time of motion, direction) of every person; people who never move get one row of 0."""
        counts = np.ceil((self.end - self.start) / HEADING_TIMESTEP - 1e-9).astype(int) + 1
        # Some people at a time: the curves of all of a long recording at once would take gigabytes.
        ends = np.flatnonzero(np.diff(np.cumsum(counts) // _TABULATED_AT_ONCE)) + 1
        blocks = np.split(np.arange(len(counts)), ends)
        keys, headings, owners = zip(*(self._headings_of(block, counts[block]) for block in blocks), strict=True)
        self._heading_key, self._heading, owner = np.concatenate(keys), np.concatenate(headings), np.concatenate(owners)
        people = np.arange(len(counts))
        self._first_heading = np.searchsorted(owner, people, side="left")
        self._last_heading = np.searchsorted(owner, people, side="right") - 1

    def _headings_of(
        self, block: NDArray[np.int64], counts: NDArray[np.int64]
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Rows of some successive people, in the order of the key: key, direction, person."""
        people = np.repeat(block, counts)
        step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        times = np.minimum(self.start[people] + step * HEADING_TIMESTEP, self.end[people])
        _, velocity = self.position_and_velocity(people, times)
        moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= MOVING_SPEED
        still = np.setdiff1d(block, people[moving])
        owner = np.concatenate([people[moving], still])
        direction = np.concatenate([arctan2(velocity[moving, 1], velocity[moving, 0]), np.zeros(len(still))])
        key = np.concatenate([times[moving], self.start[still]]) - self._origin + owner * self._span
        order = np.argsort(key, kind="stable")
        return key[order], direction[order], owner[order]
