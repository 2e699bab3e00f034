"""How purposefully agents go: success weighted by path length, irregularity of heading, failures to progress."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array, wrap_angle
from socialnav_mj.metrics.metric import Better, Kind, Metric, Need
from socialnav_mj.metrics.missing import NEVER, NO_STEP, Missing
from socialnav_mj.metrics.navigation import active_steps, displacement, path_length
from socialnav_mj.metrics.outcomes import success
from socialnav_mj.metrics.pairs import mean_over

PROGRESS_DISTANCE = 0.5
"""Progress that is asked for [m]: default of the navigation stack Nav2 (SimpleProgressChecker);
Francis et al. (2023) leave it open."""
PROGRESS_TIME = 10.0
"""Time given for it [s]: same source."""


def spl(episode: Episode) -> Array:
    """Success weighted by path length (Anderson et al. 2018, eq 1): S l / max(p, l).

    S is `success`, so a collision gives 0; l is the straight distance from start to goal, the shortest path in an open
    place; p is the path length. The path ends within the goal radius, so a straight trip has p < l and scores 1.

    Args:
        episode: Record with outcomes, contacts, starts, goals and the agents' positions.

    Returns:
        Shape (n_agents,), in [0, 1]; 0 for agents that never spawned.
    """
    shortest = displacement(episode)
    longer = np.fmax(path_length(episode), shortest)
    return success(episode).astype(float) * np.divide(shortest, longer, out=np.ones_like(shortest), where=longer > 0.0)


def path_irregularity(episode: Episode) -> Array:
    """Mean angle between the body's heading and the direction to the goal, over active steps.

    SocNavBench measures the goal's direction against the vector from the map's origin to the robot, which changes when
    the map is moved (dialect `socnavbench`); this is against the heading.

    Args:
        episode: Record with goals and the agents' positions and headings.

    Returns:
        Shape (n_agents,), in [0, pi]; NaN for agents without an active step off their goal [rad].
    """
    to_goal = episode.agent_goal - episode.agent_position
    turn = np.abs(wrap_angle(np.arctan2(to_goal[..., 1], to_goal[..., 0]) - episode.agent_heading))
    return mean_over(turn, episode.agent_active & (np.abs(to_goal).max(axis=-1, initial=0.0) > 0.0))


def failures_to_progress(episode: Episode) -> Array:
    """How often an agent failed to come `PROGRESS_DISTANCE` nearer to its goal within `PROGRESS_TIME`.

    A clock starts at the spawn; it starts anew when the distance to the goal has become that much smaller than at its
    start, and, counting one failure, when the time is over.

    Args:
        episode: Record with goals, the agents' positions and the control step.

    Returns:
        Shape (n_agents,), whole numbers; NaN for agents without an active step.
    """
    distance = np.linalg.norm(episode.agent_goal - episode.agent_position, axis=-1)
    patience = round(PROGRESS_TIME / episode.control_timestep)
    reference = np.full(episode.n_agents, np.inf)
    since = np.zeros(episode.n_agents, dtype=np.int64)
    failures = np.zeros(episode.n_agents)
    for step, now in enumerate(distance):
        nearer = now <= reference - PROGRESS_DISTANCE
        failed = ~nearer & (step - since >= patience) & np.isfinite(reference) & np.isfinite(now)
        failures += failed
        reference = np.where(nearer | failed, now, reference)
        since = np.where(nearer | failed, step, since)
    return np.where(active_steps(episode) > 0.0, failures, np.nan)


def _no_step_off_the_goal(episode: Episode) -> NDArray[np.bool_]:
    off = np.any(episode.agent_position != episode.agent_goal, axis=-1)
    return ~(episode.agent_active & off).any(axis=0)


METRICS = (
    Metric(
        name="spl",
        function=spl,
        low=0.0,
        high=1.0,
        better=Better.MORE,
        missing=NEVER,
        needs=(Need.GOAL, Need.POSITION, Need.CONTACTS),
        formula="success l / max(path_length, l), l = |g - s|",
        source="Anderson et al. 2018; Francis 2023 weighs arrival",
    ),
    Metric(
        name="path_irregularity",
        function=path_irregularity,
        unit="rad",
        low=0.0,
        high=np.pi,
        better=Better.LESS,
        missing=Missing(rule="no step off the goal", where=_no_step_off_the_goal),
        needs=(Need.GOAL, Need.POSITION, Need.HEADING),
        formula="mean angle between h and g - x",
        source="SocNavBench takes the *position vector* for h (depends on the map's origin); SEAN sums turns over a "
        "planned path's",
    ),
    Metric(
        name="failures_to_progress",
        function=failures_to_progress,
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=NO_STEP,
        needs=(Need.GOAL, Need.POSITION),
        formula="how often |x - g| did not fall by 0.5 m within 10 s",
        source="Francis 2023, FP, thresholds left open; ours are Nav2's",
    ),
)
