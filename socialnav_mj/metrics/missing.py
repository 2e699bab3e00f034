"""When a metric has no value: rules with the words that docs/metrics.md prints and the agents that they mean."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Outcome

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Missing:
    """For which agents a metric is NaN, and for no others."""

    rule: str
    """In words; "-" if never."""
    where: Callable[[Episode], BoolArray]
    """Which agents have no value, shape (n_agents,); told from the record, not from the metric."""


def _nowhere(episode: Episode) -> BoolArray:
    return np.zeros(episode.n_agents, dtype=bool)


def _not_arrived(episode: Episode) -> BoolArray:
    return episode.agent_outcome != Outcome.ARRIVED


def _never_spawned(episode: Episode) -> BoolArray:
    return episode.agent_outcome == Outcome.NEVER_SPAWNED


def _no_step(episode: Episode) -> BoolArray:
    return ~np.any(episode.agent_active, axis=0)


def _no_step_with_people(episode: Episode) -> BoolArray:
    somebody = np.any(np.isfinite(episode.pedestrian_heading), axis=1, keepdims=True)
    return ~np.any(episode.agent_active & somebody, axis=0)


def _fewer_than_2_samples(episode: Episode) -> BoolArray:
    return np.isfinite(episode.agent_heading).sum(axis=0) < 2


def _fewer_than_3_samples(episode: Episode) -> BoolArray:
    return np.isfinite(episode.agent_heading).sum(axis=0) < 3


def _no_command(episode: Episode) -> BoolArray:
    return ~np.any(np.isfinite(episode.agent_wheel_speed[..., 0]), axis=0)


NEVER = Missing(rule="-", where=_nowhere)
NOT_ARRIVED = Missing(rule="not arrived", where=_not_arrived)
NEVER_SPAWNED = Missing(rule="never spawned", where=_never_spawned)
NO_STEP = Missing(rule="no step", where=_no_step)
NO_STEP_WITH_PEOPLE = Missing(rule="no step with people in the scene", where=_no_step_with_people)
NO_COMMAND = Missing(rule="no command (no step, human row)", where=_no_command)
FEWER_THAN_2_SAMPLES = Missing(rule="< 2 samples", where=_fewer_than_2_samples)
FEWER_THAN_3_SAMPLES = Missing(rule="< 3 samples", where=_fewer_than_3_samples)
