"""When, how directly and how fast: the paper's metrics 2 and 3 and its average speed."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Kind, Mean, Metric, Need
from socialnav_mj.metrics.missing import NEVER, NEVER_SPAWNED, NO_STEP, NOT_ARRIVED, Missing
from socialnav_mj.metrics.outcomes import BoolArray, arrived, never_spawned


def spawn_delay(episode: Episode) -> Array:
    """Time between the person's appearance and the agent's real spawn.

    Args:
        episode: Record with the times of appearance and spawn.

    Returns:
        Shape (n_agents,), >= 0, whole control steps; NaN for agents that never spawned [s].
    """
    step = episode.control_timestep
    return np.round((episode.agent_spawn_time - episode.agent_appear_time) / step) * step


def active_steps(episode: Episode) -> Array:
    """Control steps each agent was under way: samples from its spawn up to, not including, its end.

    Args:
        episode: Record that says at which samples agents are under way.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return episode.agent_active.sum(axis=0).astype(float)


def completion_steps(episode: Episode) -> Array:
    """Completion time in control steps, from the real spawn to the arrival (paper metric 2).

    Args:
        episode: Record with outcomes, and the samples at which agents are under way.

    Returns:
        Shape (n_agents,); NaN for agents that did not arrive. Those that arrived after a collision have a value.
    """
    return np.where(arrived(episode), active_steps(episode), np.nan)


def completion_time(episode: Episode) -> Array:
    """Completion time in seconds, from the real spawn to the arrival (paper metric 2).

    Args:
        episode: Record with outcomes, the samples at which agents are under way, and the control step.

    Returns:
        Shape (n_agents,); NaN for agents that did not arrive. Those that arrived after a collision have a value [s].
    """
    return completion_steps(episode) * episode.control_timestep


def time_under_way(episode: Episode) -> Array:
    """Censored completion time: up to the arrival, or as long as the agent was watched without arriving.

    Where `completion_censored` is True the real completion time is longer than this value; a mean over all agents is
    therefore a lower bound, and unlike a mean over arrivals it does not get better when slow agents time out.

    Args:
        episode: Record with the samples at which agents are under way, and the control step.

    Returns:
        Shape (n_agents,); NaN for agents that never spawned [s].
    """
    return np.where(never_spawned(episode), np.nan, active_steps(episode) * episode.control_timestep)


def path_length(episode: Episode) -> Array:
    """Length of the path traced from spawn to end: the sum of the chords between samples.

    Args:
        episode: Record with the agents' positions, from the spawn's sample to the end's.

    Returns:
        Shape (n_agents,); 0 for a single sample, NaN for agents that never spawned [m].
    """
    chords = np.linalg.norm(np.diff(episode.agent_position, axis=0), axis=-1)
    return np.where(never_spawned(episode), np.nan, np.nansum(chords, axis=0))


def displacement(episode: Episode) -> Array:
    """Straight distance from the start to the goal.

    Args:
        episode: Record with starts and goals; what happened in between is not used.

    Returns:
        Shape (n_agents,) [m].
    """
    return np.linalg.norm(episode.agent_goal - episode.agent_start, axis=-1)


def distance_to_displacement(episode: Episode) -> Array:
    """Path length over the distance from start to goal (paper metric 3).

    The path ends where the agent arrives, up to `goal_radius` r short of the goal, while the denominator d reaches the
    goal itself, so that a straight trip scores 1 - r / d and not 1. The paper's definition leaves this open; we keep
    its two quantities as they are.

    Args:
        episode: Record with outcomes, starts, goals and the agents' positions.

    Returns:
        Shape (n_agents,); NaN for agents that did not arrive or whose start is their goal.
    """
    distance = displacement(episode)
    defined = arrived(episode) & (distance > 0.0)
    return np.divide(path_length(episode), distance, out=np.full_like(distance, np.nan), where=defined)


def average_speed(episode: Episode) -> Array:
    """Path length over the time under way (paper figure 2), whether the agent arrived or not.

    Args:
        episode: Record with the agents' positions and the samples at which they are under way.

    Returns:
        Shape (n_agents,); NaN for agents without an active step [m/s].
    """
    duration = active_steps(episode) * episode.control_timestep
    return np.divide(path_length(episode), duration, out=np.full_like(duration, np.nan), where=duration > 0.0)


def _not_arrived_or_at_goal(episode: Episode) -> BoolArray:
    return NOT_ARRIVED.where(episode) | np.all(episode.agent_goal == episode.agent_start, axis=-1)


METRICS = (
    Metric(
        name="completion_time",
        function=completion_time,
        unit="s",
        low=0.0,
        digits=1,
        better=Better.LESS,
        missing=NOT_ARRIVED,
        means=(Mean(), Mean(name="completion_time_success", heading="time of successes", successes=True)),
        paired=True,
        formula="T of those that arrived",
        source="paper 2; the people have no deadline",
    ),
    Metric(
        name="completion_steps",
        function=completion_steps,
        unit="steps",
        kind=Kind.COUNT,
        digits=1,
        better=Better.LESS,
        missing=NOT_ARRIVED,
        means=(Mean(), Mean(name="completion_steps_success", heading="steps of successes", successes=True)),
        formula="n of those that arrived (*rate*)",
        source="paper 2",
    ),
    Metric(
        name="time_under_way",
        function=time_under_way,
        unit="s",
        low=0.0,
        heading="time, censored",
        digits=1,
        better=Better.LESS,
        missing=NEVER_SPAWNED,
        means=(Mean(narrow="time\n[s]"),),
        formula="T of all; a lower bound where `completion_censored`",
        source="censored time",
    ),
    Metric(
        name="active_steps",
        function=active_steps,
        unit="steps",
        kind=Kind.COUNT,
        digits=1,
        better=Better.NEITHER,
        missing=NEVER,
        means=(),
        formula="n (*rate*)",
        source="ours",
    ),
    Metric(
        name="displacement",
        function=displacement,
        unit="m",
        low=0.0,
        digits=2,
        better=Better.NEITHER,
        missing=NEVER,
        needs=(Need.GOAL,),
        means=(),
        formula="|g - s|",
    ),
    Metric(
        name="path_length",
        function=path_length,
        unit="m",
        low=0.0,
        digits=2,
        better=Better.LESS,
        missing=NEVER_SPAWNED,
        needs=(Need.POSITION,),
        means=(),
        paired=True,
        formula="sum |x(k+1) - x(k)|, spawn to end",
        source="SEAN samples it at 1 Hz, which cuts corners",
    ),
    Metric(
        name="distance_to_displacement",
        function=distance_to_displacement,
        low=0.0,
        heading="path / displacement",
        better=Better.LESS,
        missing=Missing(rule="not arrived, or g = s", where=_not_arrived_or_at_goal),
        needs=(Need.GOAL, Need.POSITION),
        means=(
            Mean(narrow="path\nratio", narrow_digits=2),
            Mean(name="distance_to_displacement_success", heading="path / displacement of successes", successes=True),
        ),
        formula="path_length / |g - s|; a straight trip gives 1 - 0.5 m / |g - s|",
        source="paper 3; SocNavBench's path_length_ratio has failed trips too",
    ),
    Metric(
        name="average_speed",
        function=average_speed,
        unit="m/s",
        low=0.0,
        heading="speed",
        better=Better.MORE,
        missing=NO_STEP,
        needs=(Need.POSITION,),
        means=(Mean(narrow="speed\n[m/s]", narrow_digits=2),),
        formula="path_length / T",
        source="paper figure 2; HuNavSim averages |v|",
    ),
    Metric(
        name="spawn_delay",
        function=spawn_delay,
        unit="s",
        low=0.0,
        better=Better.NEITHER,
        missing=NEVER_SPAWNED,
        formula="real spawn minus the person's appearance",
        source="ours",
    ),
)
