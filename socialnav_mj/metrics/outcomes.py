"""How did it end: arrival, success, time-out; the paper's metric 1."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Outcome
from socialnav_mj.metrics.collisions import collisions
from socialnav_mj.metrics.metric import Better, Kind, Mean, Metric, Need
from socialnav_mj.metrics.missing import NEVER

BoolArray = NDArray[np.bool_]


def arrived(episode: Episode) -> BoolArray:
    """Whether each agent came within the goal radius before its deadline, collisions or not.

    Args:
        episode: Record of n agents; their outcomes are used.

    Returns:
        Shape (n_agents,); False for agents that never spawned.
    """
    return episode.agent_outcome == Outcome.ARRIVED


def success(episode: Episode) -> BoolArray:
    """Successful completion (paper metric 1): arrived, and had no collision on the way.

    One collision with a pedestrian or another agent voids it, whoever was at fault, whatever `on_collision` says. The
    mean over all agents, those that never spawned included, is the paper's "fraction of runs".

    Args:
        episode: Record of n agents; their outcomes and the contact log are used.

    Returns:
        Shape (n_agents,).
    """
    return arrived(episode) & (collisions(episode) == 0)


def ghost_overlaps(episode: Episode) -> NDArray[np.int64]:
    """Number of people who appeared on a robot and overlapped this agent before they were clear: no collisions.

    Args:
        episode: Record of n agents.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return episode.agent_ghost_overlaps.copy()


def success_if_ghosts_count(episode: Episode) -> BoolArray:
    """Success of a rule that takes it from whoever overlaps a ghost, too: the least that `success` could be.

    Args:
        episode: Record of n agents; outcomes, the contact log and overlaps of ghosts are used.

    Returns:
        Shape (n_agents,).
    """
    return success(episode) & (ghost_overlaps(episode) == 0)


def timed_out(episode: Episode) -> BoolArray:
    """Whether each agent's deadline passed before it arrived.

    Args:
        episode: Record of n agents; their outcomes are used.

    Returns:
        Shape (n_agents,).
    """
    return episode.agent_outcome == Outcome.TIMED_OUT


def never_spawned(episode: Episode) -> BoolArray:
    """Whether each agent's place was never free.

    Args:
        episode: Record of n agents; their outcomes are used.

    Returns:
        Shape (n_agents,).
    """
    return episode.agent_outcome == Outcome.NEVER_SPAWNED


def overturned(episode: Episode) -> BoolArray:
    """Whether each agent ended on its side or back.

    Args:
        episode: Record of n agents; their outcomes are used.

    Returns:
        Shape (n_agents,).
    """
    return episode.agent_outcome == Outcome.OVERTURNED


def completion_censored(episode: Episode) -> BoolArray:
    """Whether an agent spawned and its trip ended otherwise than by arrival.

    Args:
        episode: Record of n agents; their outcomes are used.

    Returns:
        Shape (n_agents,).
    """
    return ~arrived(episode) & ~never_spawned(episode)


METRICS = (
    Metric(
        name="success",
        function=success,
        kind=Kind.FLAG,
        better=Better.MORE,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        formula="arrived, and no collision with anybody",
        source="paper 1; CrowdNav and SocNavBench alike; Francis 2023 and HuNavSim count arrival alone",
    ),
    Metric(
        name="success_if_ghosts_count",
        function=success_if_ghosts_count,
        kind=Kind.FLAG,
        better=Better.MORE,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        formula="the same, and overlapped no ghost",
        source="ours; below",
    ),
    Metric(
        name="ghost_overlaps",
        function=ghost_overlaps,
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=NEVER,
        formula="people who appeared on a robot and overlapped the agent until they were clear; no collisions",
        source="ours; below",
    ),
    Metric(
        name="arrived",
        function=arrived,
        kind=Kind.FLAG,
        better=Better.MORE,
        missing=NEVER,
        means=(),
        formula="|x - g| <= 0.5 m before the deadline",
        source="SEAN asks 1.2 m by default, CrowdNav the robot's radius",
    ),
    Metric(
        name="timed_out",
        function=timed_out,
        kind=Kind.FLAG,
        better=Better.LESS,
        missing=NEVER,
        means=(Mean(narrow="timed\nout"),),
        formula="deadline (15 s + 2 s/m |g - s| after the spawn) passed",
        source="Francis 2023, TO",
    ),
    Metric(
        name="overturned",
        function=overturned,
        kind=Kind.FLAG,
        better=Better.LESS,
        missing=NEVER,
        formula="ended on its side or back: tilted by more than 90 degrees",
        source="ours; it fails, and its body is taken out",
    ),
    Metric(
        name="never_spawned",
        function=never_spawned,
        kind=Kind.FLAG,
        better=Better.NEITHER,
        missing=NEVER,
        formula="its place was never free",
        source="ours",
    ),
    Metric(
        name="completion_censored",
        function=completion_censored,
        kind=Kind.FLAG,
        better=Better.LESS,
        missing=NEVER,
        means=(),
        formula="spawned, and ended otherwise than by arrival",
        source="ours",
    ),
)
