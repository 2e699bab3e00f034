"""How agents share space with people: mean distance, Hall's zones and space compliance; distances between centres."""

from functools import partial

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Metric, Need
from socialnav_mj.metrics.missing import NO_STEP, NO_STEP_WITH_PEOPLE
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
        episode: Record with the tracks of agents and pedestrians.

    Returns:
        Shape (n_agents,), >= `minimum_distance`; NaN for agents without such a step [m].
    """
    nearest = nearest_pedestrian_distance(episode)
    return mean_over(nearest, episode.agent_active & np.isfinite(nearest))


def zone_share(episode: Episode, zone: str) -> Array:
    """Share of active steps with the nearest replayed pedestrian in a zone.

    The four zones' shares add up to 1; a step without any pedestrian in the scene is public.

    Args:
        episode: Record with the tracks of agents and pedestrians.
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
        episode: Record with the tracks of agents and pedestrians.

    Returns:
        Shape (n_agents,), in [0, 1]; NaN for agents without an active step.
    """
    complying = nearest_pedestrian_distance(episode) >= COMPLIANT_DISTANCE
    return mean_over(complying.astype(float), episode.agent_active)


def _zone_metric(zone: str, *, formula: str, better: Better, source: str = "the same") -> Metric:
    return Metric(
        name=f"{zone}_zone_share",
        function=partial(zone_share, zone=zone),
        low=0.0,
        high=1.0,
        better=better,
        missing=NO_STEP,
        needs=(Need.POSITION, Need.PEDESTRIANS),
        formula=formula,
        source=source,
    )


METRICS = (
    Metric(
        name="mean_distance",
        function=mean_distance,
        unit="m",
        low=0.0,
        better=Better.MORE,
        missing=NO_STEP_WITH_PEOPLE,
        needs=(Need.POSITION, Need.PEDESTRIANS),
        formula="mean d over steps with somebody in the scene",
        source="HuNavSim: between surfaces",
    ),
    _zone_metric(
        "intimate",
        formula="share with d < 0.45 m",
        better=Better.LESS,
        source="Hall 1966; HuNavSim measures from the robot's surface",
    ),
    _zone_metric("personal", formula="share with 0.45 <= d < 1.2 m", better=Better.LESS),
    _zone_metric("social", formula="share with 1.2 <= d < 3.6 m", better=Better.NEITHER),
    _zone_metric(
        "public",
        formula="share with d >= 3.6 m or nobody in the scene; the four add up to 1",
        better=Better.NEITHER,
    ),
    Metric(
        name="space_compliance",
        function=space_compliance,
        low=0.0,
        high=1.0,
        better=Better.MORE,
        missing=NO_STEP,
        needs=(Need.POSITION, Need.PEDESTRIANS),
        formula="share with d >= 0.5 m: **complying**",
        source="Francis 2023 prints the share **under** the threshold; our dialect `francis2023` has that",
    ),
)
