"""Every agent beside every replayed pedestrian, at every sample: what the metrics of nearness start from."""

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode, IntArray
from socialnav_mj.geometry import Array

T = TypeVar("T")


def remember_last(function: Callable[[Episode], T]) -> Callable[[Episode], T]:
    """Keep a function's result for the episode it was last called with; an Episode never changes.

    Args:
        function: Pure; its result must not be written to.

    Returns:
        The same function, which computes nothing when it is called again with the very same object.
    """
    last: tuple[weakref.ref[Episode], T] | None = None

    @wraps(function)
    def remembered(episode: Episode) -> T:
        nonlocal last
        if last is None or last[0]() is not episode:
            last = (weakref.ref(episode), function(episode))
        return last[1]

    return remembered


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """One row for every agent and pedestrian who are in the scene at the same sample; ordered by sample, then agent."""

    step: IntArray
    """(k,) sample."""
    agent: IntArray
    """(k,) agent index."""
    pedestrian: IntArray
    """(k,) pedestrian index."""
    offset: Array
    """(k, 2) from the agent's centre to the pedestrian's [m]."""
    velocity: Array
    """(k, 2) the pedestrian's minus the agent's [m/s]."""
    distance: Array
    """(k,) between the centres [m]."""
    active: NDArray[np.bool_]
    """(k,) whether the agent is under way; it is not at the sample of its end."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            value.flags.writeable = False


@remember_last
def pairs(episode: Episode) -> Pairs:
    """Offsets and relative velocities of all agents and pedestrians who are there together.

    Args:
        episode: Record with the tracks of agents and pedestrians.

    Returns:
        All pairs, without those in which somebody is absent.
    """
    there, person = np.nonzero(np.isfinite(episode.pedestrian_heading))
    count = np.bincount(there, minlength=len(episode.time))
    first = np.cumsum(count) - count
    sample, agent = np.nonzero(np.isfinite(episode.agent_heading))
    repeat = count[sample]
    step, agents = np.repeat(sample, repeat), np.repeat(agent, repeat)
    within = np.arange(len(step)) - np.repeat(np.cumsum(repeat) - repeat, repeat)
    pedestrian = person[first[step] + within]
    offset = episode.pedestrian_position[step, pedestrian] - episode.agent_position[step, agents]
    velocity = episode.pedestrian_velocity[step, pedestrian] - episode.agent_velocity[step, agents]
    return Pairs(
        step=step,
        agent=agents,
        pedestrian=pedestrian,
        offset=offset,
        velocity=velocity,
        distance=np.sqrt(np.einsum("kd,kd->k", offset, offset)),
        active=episode.agent_active[step, agents],
    )


def radii(episode: Episode) -> tuple[float, float]:
    """Radii that an episode was simulated with.

    Args:
        episode: Record whose scenario is in its metadata.

    Returns:
        The robot's and the pedestrians' [m].
    """
    scenario = Scenario.from_dict(episode.metadata["scenario"])
    return scenario.robot.radius, scenario.pedestrian_radius


def mean_over(values: Array, mask: NDArray[np.bool_]) -> Array:
    """Mean of each agent's samples.

    Args:
        values: (t, n_agents); anything where the mask is False.
        mask: (t, n_agents) which samples count.

    Returns:
        Shape (n_agents,); NaN for agents without a sample.
    """
    count = mask.sum(axis=0)
    total = np.where(mask, values, 0.0).sum(axis=0)
    return np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)


def largest_over(values: Array, mask: NDArray[np.bool_]) -> Array:
    """Largest of each agent's samples.

    Args:
        values: (t, n_agents); anything where the mask is False.
        mask: (t, n_agents) which samples count.

    Returns:
        Shape (n_agents,); NaN for agents without a sample.
    """
    largest = np.where(mask, values, -np.inf).max(axis=0, initial=-np.inf)
    return np.where(mask.any(axis=0), largest, np.nan)
