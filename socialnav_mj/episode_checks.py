"""What must hold in a record of an episode, whoever made it."""

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.contact import INTEGER_COLUMNS, PLANAR_COLUMNS, Partner
from socialnav_mj.outcome import OVERTURNED_TILT, Outcome

if TYPE_CHECKING:
    from socialnav_mj.episode import Episode

_SAME_TIME = 1e-6
"""Times this near are the same; rounding of sums of time steps [s]."""

_INTEGER_FIELDS = {
    "agent_person",
    "agent_outcome",
    "agent_ghost_overlaps",
    "agent_policy",
    "pedestrian_person",
    *(f"contact_{name}" for name in INTEGER_COLUMNS),
}
_OTHER_TYPES = {"agent_scores": "float32"}
_PER_STEP = {
    "agent_position",
    "agent_heading",
    "agent_velocity",
    "agent_yaw_rate",
    "agent_tilt",
    "agent_wheel_speed",
    "agent_policy",
    "agent_scores",
    "pedestrian_position",
    "pedestrian_deviation",
    "pedestrian_heading",
    "pedestrian_velocity",
}
_PLANAR = {
    "agent_start",
    "agent_goal",
    "agent_position",
    "agent_velocity",
    "agent_wheel_speed",
    "pedestrian_deviation",
    "pedestrian_position",
    "pedestrian_velocity",
    *(f"contact_{name}" for name in PLANAR_COLUMNS),
}


class EpisodeError(ValueError):
    """A file is not an episode of ours, or is damaged."""


def check_arrays(episode: "Episode") -> None:
    """Hold every array to its shape and type, and make it read-only.

    Args:
        episode: Record as it was made or read.

    Raises:
        EpisodeError: If an array has another shape or type; names it.
    """
    sizes = {
        "agent": len(episode.agent_person),
        "pedestrian": len(episode.pedestrian_person),
        "contact": len(episode.contact_time),
    }
    for field in fields(episode):
        value = getattr(episode, field.name)
        if not isinstance(value, np.ndarray):
            continue
        shape = _expected_shape(field.name, samples=len(episode.time), sizes=sizes)
        if field.name == "agent_scores":
            shape = (*shape, len(episode.policies))
        if value.shape != shape:
            raise EpisodeError(f"{field.name} has shape {value.shape}; expected {shape}")
        expected = "int64" if field.name in _INTEGER_FIELDS else _OTHER_TYPES.get(field.name, "float64")
        if value.dtype != np.dtype(expected):
            raise EpisodeError(f"{field.name} has type {value.dtype}; expected {expected}")
        value.flags.writeable = False


def check_values(episode: "Episode") -> None:
    """Hold times, people, contacts and presence to what `Episode` says of them.

    Args:
        episode: The record, its arrays of the right shape.

    Raises:
        EpisodeError: If something contradicts; names it.
    """
    _check_time(episode)
    _check_people(episode)
    _check_contacts(episode)
    _check_presence(episode)


def _check_time(episode: "Episode") -> None:
    if not len(episode.time) or not np.all(np.isfinite(episode.time)):
        raise EpisodeError("time must be finite and hold a sample at least")
    if not np.allclose(np.diff(episode.time), _stated_timestep(episode), rtol=0.0, atol=_SAME_TIME):
        raise EpisodeError(f"time must be spaced by the control time step of {episode.control_timestep} s")


def _check_people(episode: "Episode") -> None:
    for name in ("agent_person", "pedestrian_person"):
        if np.any(np.diff(getattr(episode, name)) <= 0):
            raise EpisodeError(f"{name} must be ascending and unique")
    if np.intersect1d(episode.agent_person, episode.pedestrian_person).size:
        raise EpisodeError("a person cannot be replaced and replayed at once")
    if not np.isin(episode.agent_outcome, list(Outcome)).all():
        raise EpisodeError(f"agent_outcome holds values outside {[int(o) for o in Outcome]}")
    ghosts, spawned = episode.agent_ghost_overlaps, episode.agent_outcome != Outcome.NEVER_SPAWNED
    if np.any((ghosts < 0) | (ghosts > len(episode.pedestrian_person) * spawned)):
        raise EpisodeError("agent_ghost_overlaps must be 0 to the number of pedestrians, and 0 if never spawned")
    if np.any(episode.agent_policy >= len(episode.policies)) or np.any(episode.agent_policy < -1):
        raise EpisodeError(f"agent_policy holds values outside -1..{len(episode.policies) - 1}")


def _check_contacts(episode: "Episode") -> None:
    n, m = len(episode.agent_person), len(episode.pedestrian_person)
    agent, kind, partner = episode.contact_agent, episode.contact_partner_kind, episode.contact_partner
    if not np.isin(kind, list(Partner)).all():
        raise EpisodeError(f"contact_partner_kind holds values outside {[int(p) for p in Partner]}")
    if np.any((agent < 0) | (agent >= n)):
        raise EpisodeError("contact_agent is out of range")
    if np.any((partner < 0) | (partner >= np.where(kind == Partner.AGENT, n, m))):
        raise EpisodeError("contact_partner is out of range")
    if np.any((kind == Partner.AGENT) & (partner == agent)):
        raise EpisodeError("contact_partner of an agent is the agent itself")
    order = np.lexsort((partner, kind, agent, episode.contact_time))
    if not np.isfinite(episode.contact_time).all() or np.any(np.diff(order) < 0):
        raise EpisodeError("contacts must have a finite time and be ordered by time, agent, partner kind, partner")


def _check_presence(episode: "Episode") -> None:
    spawned = episode.agent_outcome != Outcome.NEVER_SPAWNED
    for name in ("agent_spawn_time", "agent_end_time"):
        if not np.array_equal(spawned, np.isfinite(getattr(episode, name))):
            raise EpisodeError(f"{name} must be NaN for exactly the agents that never spawned")
    if np.any(episode.agent_end_time < episode.agent_spawn_time):
        raise EpisodeError("agent_end_time must not be before agent_spawn_time")
    time = episode.time[:, None]
    after, before = time >= episode.agent_spawn_time - _SAME_TIME, time <= episode.agent_end_time + _SAME_TIME
    for name in ("agent_position", "agent_heading", "agent_velocity", "agent_yaw_rate", "agent_tilt"):
        if not _is_finite_where(getattr(episode, name), after & before):
            raise EpisodeError(f"{name} must be finite from spawn to end, and NaN elsewhere")
    under_way = after & (time < episode.agent_end_time - _SAME_TIME)
    if not np.array_equal(episode.agent_policy >= 0, under_way):
        raise EpisodeError("agent_policy must be -1 except from the spawn up to, not including, the end")
    if episode.agent_scores is not None and not _is_finite_where(episode.agent_scores, under_way):
        raise EpisodeError(
            "agent_scores must be finite from the spawn up to, not including, the end, and NaN elsewhere"
        )
    lies = episode.agent_tilt > OVERTURNED_TILT
    at_end = after & before & ~under_way
    if not np.array_equal(lies, at_end & (episode.agent_outcome == Outcome.OVERTURNED)):
        raise EpisodeError("agent_tilt must exceed the limit at the end of overturned agents, and nowhere else")
    there = np.isfinite(episode.pedestrian_heading)
    deviation = ("pedestrian_deviation",) if episode.pedestrian_deviation is not None else ()
    for name in ("pedestrian_position", "pedestrian_velocity", *deviation):
        if not _is_finite_where(getattr(episode, name), there):
            raise EpisodeError(f"{name} must be finite where pedestrian_heading is, and NaN elsewhere")


def _stated_timestep(episode: "Episode") -> float:
    try:
        return episode.control_timestep
    except (KeyError, TypeError, ValueError) as error:
        raise EpisodeError("metadata lack scenario.control_timestep") from error


def _is_finite_where(values: NDArray[np.floating], expected: NDArray[np.bool_]) -> bool:
    """Whether values (..., or with one more axis at the end) are finite where expected and NaN elsewhere."""
    if values.ndim > expected.ndim:
        expected = np.broadcast_to(expected[..., None], values.shape)
    return np.array_equal(np.isfinite(values), expected) and np.array_equal(np.isnan(values), ~expected)


def _expected_shape(name: str, *, samples: int, sizes: dict[str, int]) -> tuple[int, ...]:
    if name == "time":
        return (samples,)
    shape: tuple[int, ...] = (sizes[name.split("_")[0]],)
    if name in _PER_STEP:
        shape = (samples, *shape)
    return (*shape, 2) if name in _PLANAR else shape
