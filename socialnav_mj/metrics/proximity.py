"""How near each agent came to replayed pedestrians; distances are between centres."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Kind, Mean, Metric, Need
from socialnav_mj.metrics.missing import NO_STEP, NO_STEP_WITH_PEOPLE
from socialnav_mj.metrics.navigation import active_steps
from socialnav_mj.metrics.pairs import pairs, remember_last

INTIMATE_DISTANCE = 1.2
"""Limit of the paper's "intimate space" [m]. In Hall's proxemics 1.2 m ends *personal* space (intimate: 0.45 m); we
keep the paper's number and its name."""


@remember_last
def nearest_pedestrian_distance(episode: Episode) -> Array:
    """Distance from each agent to the nearest replayed pedestrian at every sample; other agents do not count.

    Args:
        episode: Record with the tracks of agents and pedestrians at t samples.

    Returns:
        Shape (t, n_agents), read-only; inf where no pedestrian is in the scene, NaN where the agent is not [m].
    """
    near = pairs(episode)
    result = np.where(np.isfinite(episode.agent_heading), np.inf, np.nan)
    np.minimum.at(result, (near.step, near.agent), near.distance)
    result.flags.writeable = False
    return result


def intimate_intrusions(episode: Episode) -> Array:
    """Intimate intrusions (paper metric 4): active steps with a replayed pedestrian nearer than 1.2 m.

    Strictly nearer: at 1.2 m exactly the space is not violated. A step counts once, however many people are that
    near. The number depends on the control time step and on how long the agent was under way; `intrusion_share`
    does not.

    Args:
        episode: Record with the tracks of agents and pedestrians.

    Returns:
        Shape (n_agents,); whole numbers, NaN for agents without an active step.
    """
    near = (nearest_pedestrian_distance(episode) < INTIMATE_DISTANCE) & episode.agent_active
    return np.where(active_steps(episode) > 0.0, near.sum(axis=0), np.nan)


def intrusion_share(episode: Episode) -> Array:
    """Intimate intrusions over the active steps of the same agent.

    Args:
        episode: Record with the tracks of agents and pedestrians.

    Returns:
        Shape (n_agents,), in [0, 1]; NaN for agents without an active step.
    """
    steps = active_steps(episode)
    return np.divide(intimate_intrusions(episode), steps, out=np.full_like(steps, np.nan), where=steps > 0.0)


def minimum_distance(episode: Episode) -> Array:
    """Smallest distance to a replayed pedestrian over the active steps.

    Args:
        episode: Record with the tracks of agents and pedestrians.

    Returns:
        Shape (n_agents,); NaN for agents without an active step with a pedestrian in the scene [m].
    """
    distance = np.where(episode.agent_active, nearest_pedestrian_distance(episode), np.inf)
    smallest = distance.min(axis=0, initial=np.inf)
    return np.where(np.isfinite(smallest), smallest, np.nan)


METRICS = (
    Metric(
        name="intimate_intrusions",
        function=intimate_intrusions,
        unit="steps",
        kind=Kind.COUNT,
        digits=1,
        better=Better.LESS,
        missing=NO_STEP,
        needs=(Need.POSITION, Need.PEDESTRIANS),
        means=(Mean(narrow="steps\n<1.2 m"),),
        paired=True,
        formula="steps with d < 1.2 m (*rate*), at most n",
        source="paper 4; 1.2 m is Hall's *personal* distance",
    ),
    Metric(
        name="intrusion_share",
        function=intrusion_share,
        low=0.0,
        high=1.0,
        better=Better.LESS,
        missing=NO_STEP,
        needs=(Need.POSITION, Need.PEDESTRIANS),
        means=(
            Mean(),
            Mean(name="intrusion_share_of_steps", heading="share of steps within 1.2 m", weight="active_steps"),
        ),
        paired=True,
        formula="the same / n",
    ),
    Metric(
        name="minimum_distance",
        function=minimum_distance,
        unit="m",
        low=0.0,
        better=Better.MORE,
        missing=NO_STEP_WITH_PEOPLE,
        needs=(Need.POSITION, Need.PEDESTRIANS),
        paired=True,
        formula="min d over steps",
        source="HuNavSim: minus the robot's radius; CrowdNav: between surfaces",
    ),
)
