"""How agents share space with people: mean distance, Hall's zones and space compliance; distances between centres."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.pairs import mean_over
from socialnav_mj.metrics.proximity import nearest_pedestrian_distance

ZONES = {"intimate": (0.0, 0.45), "personal": (0.45, 1.2), "social": (1.2, 3.6), "public": (3.6, np.inf)}
"""Hall (1966), The Hidden Dimension, in the metric rounding that HuNavSim and others use: from, up to, not including
[m]. The paper's "intimate" distance of 1.2 m is the end of the *personal* zone."""

COMPLIANT_DISTANCE = 0.5
"""Default personal space of Francis et al. (2023), table 1, "space compliance" [m]."""


def mean_distance(episode: Episode) -> Array:
    """Distance to the nearest replayed pedestrian, averaged over active steps on which there is one.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,), >= `minimum_distance`; NaN for agents without such a step [m].
    """
    nearest = nearest_pedestrian_distance(episode)
    return mean_over(nearest, episode.agent_active & np.isfinite(nearest))


def zone_share(episode: Episode, zone: str) -> Array:
    """Share of active steps with the nearest replayed pedestrian in a zone.

    The four zones' shares add up to 1; a step without any pedestrian in the scene is public.

    Args:
        episode: The record.
        zone: Key of `ZONES`.

    Returns:
        Shape (n_agents,), in [0, 1]; NaN for agents without an active step.

    Raises:
        ValueError: If there is no such zone.
    """
    if zone not in ZONES:
        raise ValueError(f"unknown zone {zone!r}; available: {', '.join(ZONES)}")
    begin, end = ZONES[zone]
    nearest = nearest_pedestrian_distance(episode)
    inside = (nearest >= begin) & ((nearest < end) | (end == np.inf))
    return mean_over(inside.astype(float), episode.agent_active)


def space_compliance(episode: Episode) -> Array:
    """Share of active steps on which nobody is nearer than 0.5 m: the *complying* share, more is better.

    Francis et al. (2023) print the ratio of the trajectory *under* the threshold, that is 1 minus this value (dialect
    `francis2023`). We take the sense of the name.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,), in [0, 1]; NaN for agents without an active step.
    """
    complying = nearest_pedestrian_distance(episode) >= COMPLIANT_DISTANCE
    return mean_over(complying.astype(float), episode.agent_active)
