"""A recorded crowd: people as tracks, in metres and seconds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.curves import Curves

LONGEST_NAME = 100
"""Characters of a recording's name: it goes into tables, files and file names."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Crowd:
    """Everybody at t times; entries of people who are absent are NaN."""

    position: Array
    """(t, n, 2) [m]."""
    velocity: Array
    """(t, n, 2) [m/s]."""
    heading: Array
    """(t, n) direction of motion; of a standing person its last motion, else its next, else 0 [rad]."""
    present: NDArray[np.bool_]
    """(t, n)."""


@dataclass(frozen=True, eq=False)
class Track:
    """One person of a recording, who can be asked for at any time; made by `Recording.person`."""

    recording: "Recording"
    index: int

    def at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Where the person is; before and after the track: its nearest end, at rest.

        Args:
            times: (t,) [s].

        Returns:
            Position (t, 2) [m], velocity (t, 2) [m/s], heading (t,) [rad]; see `Crowd` for the heading.
        """
        position, velocity = self.motion(times)
        return position, velocity, self.heading(times, velocity)

    def motion(self, times: ArrayLike) -> tuple[Array, Array]:
        """Where the person is, without the heading.

        Args:
            times: (t,) [s].

        Returns:
            Position (t, 2) [m] and velocity (t, 2) [m/s], as of `at`.
        """
        times = np.asarray(times, dtype=float)
        return self.recording.curves.position_and_velocity(np.full(times.shape, self.index), times)

    def heading(self, times: ArrayLike, velocity: Array) -> Array:
        """Where the person faces.

        Args:
            times: (t,) [s].
            velocity: What `motion` returned for them, (t, 2) [m/s].

        Returns:
            Heading (t,), as of `at` [rad].
        """
        times = np.asarray(times, dtype=float)
        return self.recording.curves.heading(np.full(times.shape, self.index), times, velocity)


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """People as sampled tracks; between samples a shape-preserving cubic (PCHIP) in time, which never overshoots.

    Raises:
        ValueError: If the fields' shapes or values are not as stated below.
    """

    name: str
    """Catalogue name, or the stem of the file or folder; 1 to `LONGEST_NAME` printable characters."""
    variant: str
    """Which annotation it is: the format it was read from (`vsp`, `obsmat`, `text`, `ndjson`)."""
    frame_rate: float
    """Frames of the source per second [Hz]."""
    ids: NDArray[np.int64]
    """(n_people,) ids in the source, ascending."""
    times: tuple[Array, ...]
    """Per person (k_i,), k_i >= 2, strictly increasing; the recording's first frame is 0 [s]."""
    positions: tuple[Array, ...]
    """Per person (k_i, 2) [m]."""
    checksum: str
    """sha256 of the source file; of several files, of their contents one after the other."""
    frame_rate_origin: str = "given"
    """Who says the frame rate: it is given, of the catalogue, stated in the file, or assumed."""
    reading: Mapping[str, Any] = field(default_factory=dict)
    """Settings that change what is read from the file: see `Reading.settings`."""

    def __post_init__(self) -> None:
        """Copy, check and freeze the fields."""
        ids = np.array(self.ids, dtype=np.int64)
        times = tuple(np.array(t, dtype=float) for t in self.times)
        positions = tuple(np.array(x, dtype=float) for x in self.positions)
        if not (0 < len(self.name) <= LONGEST_NAME and self.name.isprintable()):
            raise ValueError(
                f"a recording's name {self.name[: LONGEST_NAME + 1]!a} is not allowed; allowed: "
                f"1 to {LONGEST_NAME} printable characters"
            )
        if not self.frame_rate > 0.0:
            raise ValueError(f"recording {self.name!r}: frame_rate = {self.frame_rate!r}; allowed: numbers > 0")
        if ids.ndim != 1 or not len(ids) or (np.diff(ids) <= 0).any():
            raise ValueError(f"recording {self.name!r}: ids must be a non-empty, strictly ascending list")
        if not len(ids) == len(times) == len(positions):
            given = f"{len(ids)} ids, {len(times)} times, {len(positions)} positions"
            raise ValueError(f"recording {self.name!r}: {given}; expected one of each per person")
        for person, t, x in zip(ids, times, positions, strict=True):
            if t.ndim != 1 or len(t) < 2 or x.shape != (len(t), 2):
                shapes = f"times {t.shape}, positions {x.shape}"
                raise ValueError(
                    f"recording {self.name!r}: person {person} has {shapes}; expected (k,), (k, 2), k >= 2"
                )
            if not (np.isfinite(t).all() and np.isfinite(x).all() and (np.diff(t) > 0.0).all()):
                raise ValueError(
                    f"recording {self.name!r}: person {person} needs finite positions and strictly increasing times"
                )
        for array in (ids, *times, *positions):
            array.setflags(write=False)
        object.__setattr__(self, "ids", ids)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)

    @property
    def n_people(self) -> int:
        """Number of tracks, which is that of `ids`."""
        return len(self.ids)

    @property
    def duration(self) -> float:
        """Time of the last sample of all [s]."""
        return float(self.end_time.max())

    @cached_property
    def start_time(self) -> Array:
        """When each person appears, (n,) [s]."""
        return _frozen([t[0] for t in self.times])

    @cached_property
    def end_time(self) -> Array:
        """When each person leaves, (n,) [s]."""
        return _frozen([t[-1] for t in self.times])

    @cached_property
    def start(self) -> Array:
        """Where each person appears, (n, 2) [m]."""
        return _frozen([x[0] for x in self.positions])

    @cached_property
    def end(self) -> Array:
        """Where each person leaves, (n, 2) [m]."""
        return _frozen([x[-1] for x in self.positions])

    @cached_property
    def curves(self) -> Curves:
        """The interpolation, fitted at first use."""
        return Curves(self.times, self.positions)

    def person(self, index: int) -> Track:
        """The curve of one person.

        Args:
            index: Into `ids`, 0 <= index < n_people.

        Returns:
            A view of `curves`; nothing is copied.

        Raises:
            IndexError: If there is no such person.
        """
        if not 0 <= index < self.n_people:
            raise IndexError(f"person index {index} of recording {self.name!r}; allowed: 0 to {self.n_people - 1}")
        return Track(self, int(index))

    def at(self, times: ArrayLike) -> Crowd:
        """Everybody at the given times, PCHIP in time.

        Args:
            times: (t,) [s].

        Returns:
            The crowd; NaN where a person is absent. A person is present from its first to its last sample, both
            included.
        """
        times = np.atleast_1d(np.asarray(times, dtype=float))
        present = self.curves.present(np.arange(self.n_people), times[:, None])
        rows, people = np.nonzero(present)
        position = np.full((*present.shape, 2), np.nan)
        velocity = np.full((*present.shape, 2), np.nan)
        heading = np.full(present.shape, np.nan)
        here, moving = self.curves.position_and_velocity(people, times[rows])
        position[present], velocity[present] = here, moving
        heading[present] = self.curves.heading(people, times[rows], moving)
        return Crowd(position=position, velocity=velocity, heading=heading, present=present)


def _frozen(values: list[Array]) -> Array:
    array = np.array(values)
    array.setflags(write=False)
    return array
