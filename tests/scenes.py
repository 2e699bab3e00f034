"""Small crowds made by hand, and environments in which chosen people are the agents."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from dm_control.rl import control
from numpy.typing import ArrayLike, NDArray

from socialnav_mj.environment import make_environment
from socialnav_mj.geometry import Array
from socialnav_mj.recordings import Recording
from socialnav_mj.recordings.draw import replaced_people

TINY = Path(__file__).parent / "data" / "tiny"
SAMPLE_TIME = 0.2
"""Between two samples of a track [s]."""


@dataclass(frozen=True)
class Walk:
    """A person's track."""

    times: Array
    positions: Array


def walk(corners: ArrayLike, speed: float, begin: float = 0.0) -> Walk:
    """Walk along corners at constant speed, sampled often enough that a leg is straight between its ends.

    Args:
        corners: (k, 2), k >= 2 [m].
        speed: > 0 [m/s].
        begin: Time at the first corner [s].

    Returns:
        The track; it ends exactly at the last corner.
    """
    corners = np.asarray(corners, dtype=float)
    passed = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))]) / speed
    times = np.unique(np.concatenate([np.arange(0.0, passed[-1], SAMPLE_TIME), passed]).round(9))
    positions = np.stack([np.interp(times, passed, column) for column in corners.T], axis=-1)
    return Walk(begin + times, positions)


def stand(place: ArrayLike, begin: float, end: float) -> Walk:
    """Stand at a place (2,) [m] from begin to end [s]."""
    return Walk(np.array([begin, end]), np.tile(np.asarray(place, dtype=float), (2, 1)))


def unit_vector(heading: ArrayLike) -> Array:
    """Unit vectors that point along headings.

    Args:
        heading: Angles from the x axis, shape (...) [rad].

    Returns:
        Shape (..., 2).
    """
    heading = np.asarray(heading, dtype=float)
    return np.stack([np.cos(heading), np.sin(heading)], axis=-1)


def recording_of(*walks: Walk) -> Recording:
    """A recording of people 1, 2, ..."""
    return Recording(
        name="made",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(1, len(walks) + 1),
        times=tuple(w.times for w in walks),
        positions=tuple(w.positions for w in walks),
        checksum="0" * 64,
    )


def environment_of(*walks: Walk, agents: Sequence[int] = (1,), **kwargs: Any) -> control.Environment:
    """Environment in which exactly the people with these ids are agents, all others pedestrians.

    The draw is by seed; the first seed that draws these people is taken.
    """
    recording, share = recording_of(*walks), len(agents) / len(walks)
    for seed in range(10_000):
        drawn = replaced_people(recording, share=share, seed=seed, minimum_displacement=1.0)
        if recording.ids[drawn].tolist() == sorted(agents):
            return make_environment(share=share, dataset=recording, seed=seed, **kwargs)
    raise ValueError(f"no seed draws the people {agents}")


def busy_crowd(n_people: int = 10, seed: int = 0, side: float = 4.0) -> tuple[Walk, ...]:
    """People who cross a small place at random, early and late."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0.0, 2.0 * np.pi, n_people)
    turn = random.uniform(2.0, 4.0, n_people)
    ends = [0.5 * side * np.stack([np.cos(a), np.sin(a)], axis=-1) for a in (angle, angle + turn)]
    speed, begin = random.uniform(0.5, 1.4, n_people), random.uniform(0.0, 6.0, n_people)
    return tuple(walk(c, s, b) for c, s, b in zip(np.stack(ends, axis=1), speed, begin, strict=True))


def still(environment: control.Environment) -> Array:
    """An action that stops all wheels."""
    return np.zeros(environment.action_spec().shape)


def state_of(environment: control.Environment) -> NDArray[np.uint8]:
    """Bytes of all that the physics carries from step to step, and of the model fields that slots change."""
    model, data = environment.physics.model, environment.physics.data
    arrays = (data.qpos, data.qvel, data.ctrl, data.qacc_warmstart, data.mocap_pos, data.mocap_quat, data.time)
    arrays += (model.geom_contype, model.geom_conaffinity, model.body_gravcomp)
    return np.frombuffer(b"".join(np.asarray(a).tobytes() for a in arrays), dtype=np.uint8)
