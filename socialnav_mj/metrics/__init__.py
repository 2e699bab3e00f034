"""Metrics: pure functions of one recorded `Episode`, each with one value per agent.

The human row is scored by the same functions, on an Episode made of the recorded tracks.
"""

from typing import Any

from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.metrics.collisions import NOBODY, collisions, first_partner
from socialnav_mj.metrics.navigation import (
    active_steps,
    arrived,
    average_speed,
    completion_censored,
    completion_steps,
    completion_time,
    displacement,
    distance_to_displacement,
    never_spawned,
    path_length,
    spawn_delay,
    success,
    time_under_way,
    timed_out,
)
from socialnav_mj.metrics.proximity import (
    INTIMATE_DISTANCE,
    intimate_intrusions,
    intrusion_share,
    minimum_distance,
    nearest_pedestrian_distance,
)

__all__ = [
    "INTIMATE_DISTANCE",
    "NOBODY",
    "active_steps",
    "arrived",
    "average_speed",
    "collisions",
    "completion_censored",
    "completion_steps",
    "completion_time",
    "displacement",
    "distance_to_displacement",
    "first_partner",
    "intimate_intrusions",
    "intrusion_share",
    "minimum_distance",
    "nearest_pedestrian_distance",
    "never_spawned",
    "path_length",
    "per_agent",
    "spawn_delay",
    "success",
    "time_under_way",
    "timed_out",
]


def per_agent(episode: Episode) -> dict[str, NDArray[Any]]:
    """Every metric of every agent.

    Args:
        episode: The record.

    Returns:
        Arrays of shape (n_agents,) by the metric's name; definitions, units and NaN rules are the functions'.
    """
    return {
        "success": success(episode),
        "arrived": arrived(episode),
        "timed_out": timed_out(episode),
        "never_spawned": never_spawned(episode),
        "completion_time": completion_time(episode),
        "completion_steps": completion_steps(episode),
        "time_under_way": time_under_way(episode),
        "completion_censored": completion_censored(episode),
        "active_steps": active_steps(episode),
        "displacement": displacement(episode),
        "path_length": path_length(episode),
        "distance_to_displacement": distance_to_displacement(episode),
        "average_speed": average_speed(episode),
        "intimate_intrusions": intimate_intrusions(episode),
        "intrusion_share": intrusion_share(episode),
        "minimum_distance": minimum_distance(episode),
        "collisions_pedestrian": collisions(episode, Partner.PEDESTRIAN),
        "collisions_agent": collisions(episode, Partner.AGENT),
        "first_partner": first_partner(episode),
        "spawn_delay": spawn_delay(episode),
    }
