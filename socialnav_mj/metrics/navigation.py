"""Did it arrive, when, how directly and how fast: the paper's metrics 1-3 and its average speed."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Outcome
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import collisions

BoolArray = NDArray[np.bool_]


def arrived(episode: Episode) -> BoolArray:
    """Whether each agent came within the goal radius before its deadline, collisions or not.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); False for agents that never spawned.
    """
    return episode.agent_outcome == Outcome.ARRIVED


def success(episode: Episode) -> BoolArray:
    """Successful completion (paper metric 1): arrived, and touched nobody on the way.

    One touch of a pedestrian or of another agent voids it, whoever was at fault, whatever `on_collision` says. The
    mean over all agents, those that never spawned included, is the paper's "fraction of runs".

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,).
    """
    return arrived(episode) & (collisions(episode) == 0)


def timed_out(episode: Episode) -> BoolArray:
    """Whether each agent's deadline passed before it arrived.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,).
    """
    return episode.agent_outcome == Outcome.TIMED_OUT


def never_spawned(episode: Episode) -> BoolArray:
    """Whether each agent's place was never free.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,).
    """
    return episode.agent_outcome == Outcome.NEVER_SPAWNED


def overturned(episode: Episode) -> BoolArray:
    """Whether each agent ended on its side or back.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,).
    """
    return episode.agent_outcome == Outcome.OVERTURNED


def spawn_delay(episode: Episode) -> Array:
    """Time between the person's appearance and the agent's real spawn.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,), >= 0, whole control steps; NaN for agents that never spawned [s].
    """
    step = episode.control_timestep
    return np.round((episode.agent_spawn_time - episode.agent_appear_time) / step) * step


def active_steps(episode: Episode) -> Array:
    """Control steps each agent was under way: samples from its spawn up to, not including, its end.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return episode.agent_active.sum(axis=0).astype(float)


def completion_steps(episode: Episode) -> Array:
    """Completion time in control steps, from the real spawn to the arrival (paper metric 2).

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents that did not arrive. Those that arrived after a collision have a value.
    """
    return np.where(arrived(episode), active_steps(episode), np.nan)


def completion_time(episode: Episode) -> Array:
    """Completion time in seconds, from the real spawn to the arrival (paper metric 2).

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents that did not arrive. Those that arrived after a collision have a value [s].
    """
    return completion_steps(episode) * episode.control_timestep


def time_under_way(episode: Episode) -> Array:
    """Censored completion time: up to the arrival, or as long as the agent was watched without arriving.

    Where `completion_censored` is True the real completion time is longer than this value; a mean over all agents is
    therefore a lower bound, and unlike a mean over arrivals it does not get better when slow agents time out.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents that never spawned [s].
    """
    return np.where(never_spawned(episode), np.nan, active_steps(episode) * episode.control_timestep)


def completion_censored(episode: Episode) -> BoolArray:
    """Whether an agent spawned and its run ended otherwise than by arrival.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,).
    """
    return ~arrived(episode) & ~never_spawned(episode)


def path_length(episode: Episode) -> Array:
    """Length of the path traced from spawn to end: the sum of the chords between samples.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); 0 for a single sample, NaN for agents that never spawned [m].
    """
    chords = np.linalg.norm(np.diff(episode.agent_position, axis=0), axis=-1)
    return np.where(never_spawned(episode), np.nan, np.nansum(chords, axis=0))


def displacement(episode: Episode) -> Array:
    """Straight distance from the start to the goal.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,) [m].
    """
    return np.linalg.norm(episode.agent_goal - episode.agent_start, axis=-1)


def distance_to_displacement(episode: Episode) -> Array:
    """Path length over the distance from start to goal (paper metric 3).

    The path ends where the agent arrives, up to `goal_radius` r short of the goal, while the denominator d reaches the
    goal itself, so that a straight run scores 1 - r / d and not 1. The paper's definition leaves this open; we keep
    its two quantities as they are.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents that did not arrive or whose start is their goal.
    """
    distance = displacement(episode)
    defined = arrived(episode) & (distance > 0.0)
    return np.divide(path_length(episode), distance, out=np.full_like(distance, np.nan), where=defined)


def average_speed(episode: Episode) -> Array:
    """Path length over the time under way (paper figure 2), whether the agent arrived or not.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents without an active step [m/s].
    """
    duration = active_steps(episode) * episode.control_timestep
    return np.divide(path_length(episode), duration, out=np.full_like(duration, np.nan), where=duration > 0.0)
