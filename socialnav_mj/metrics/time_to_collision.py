"""Time to collision of an agent and the replayed pedestrians, each a disc that keeps its velocity."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Metric, Need
from socialnav_mj.metrics.missing import NO_STEP_WITH_PEOPLE
from socialnav_mj.metrics.pairs import pairs, radii

_STILL = 1e-9
"""Discs that approach more slowly never meet, before products of their velocities underflow [m/s]."""


def disc_contact_time(offset: Array, velocity: Array, distance: float) -> Array:
    """When two discs that keep their velocities first touch.

    The smallest t >= 0 with |offset + velocity t| <= distance: with a = |velocity|^2, b = offset . velocity and
    c = |offset|^2 - distance^2 it is c / (-b + sqrt(b^2 - a c)), which does not cancel for small a.

    Args:
        offset: From one centre to the other, shape (..., 2) [m].
        velocity: Of the other relative to the one, shape (..., 2) [m/s].
        distance: Sum of the radii, >= 0 [m].

    Returns:
        Shape (...): 0 for discs that touch or overlap already, inf for those that never will [s].
    """
    a = np.einsum("...d,...d->...", velocity, velocity)
    b = np.einsum("...d,...d->...", offset, velocity)
    c = np.einsum("...d,...d->...", offset, offset) - distance**2
    root = b * b - a * c
    meets = (c > 0.0) & (b < 0.0) & (root >= 0.0) & (a > _STILL**2)
    time = np.divide(c, np.sqrt(np.maximum(root, 0.0)) - b, out=np.full(c.shape, np.inf), where=meets)
    return np.where(c <= 0.0, 0.0, time)


def minimum_time_to_collision(episode: Episode) -> Array:
    """Smallest time to collision with a replayed pedestrian over the active steps.

    Exact for two discs with the scenario's radii and the logged velocities; other agents do not count. A step in
    contact gives 0.

    Args:
        episode: Record with the tracks of agents and pedestrians; its scenario gives the radii.

    Returns:
        Shape (n_agents,), >= 0; inf for agents that never were on collision course, NaN for agents without an active
        step with a pedestrian in the scene [s].
    """
    here = pairs(episode)
    time = disc_contact_time(here.offset, here.velocity, sum(radii(episode)))
    smallest = np.full(episode.n_agents, np.inf)
    np.minimum.at(smallest, here.agent[here.active], time[here.active])
    seen = np.bincount(here.agent[here.active], minlength=episode.n_agents) > 0
    return np.where(seen, smallest, np.nan)


METRICS = (
    Metric(
        name="minimum_time_to_collision",
        function=minimum_time_to_collision,
        unit="s",
        low=0.0,
        infinite=True,
        better=Better.MORE,
        missing=NO_STEP_WITH_PEOPLE,
        needs=(Need.POSITION, Need.VELOCITY, Need.PEDESTRIANS),
        formula="min over steps and people of the smallest t >= 0 with |dx + dv t| <= 0.32 m; inf: never on collision "
        "course",
        source="SocNavBench: along the line of centres, so passing is colliding; Francis 2023: until the "
        "personal space (0.5 m) is entered, see Dialects",
    ),
)
