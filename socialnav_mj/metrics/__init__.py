"""Metrics: pure functions of one recorded `Episode`, each with one value per agent.

The human row is scored by the same functions, on an Episode made of the recorded tracks. Formulas, units, ranges and
worked examples: docs/metrics.md; the same names as others define them: `socialnav_mj.metrics.dialects`.
"""

from typing import Any

from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.metrics.collisions import NOBODY, collisions, first_partner
from socialnav_mj.metrics.contacts import Fault
from socialnav_mj.metrics.faults import (
    collisions_by_fault,
    collisions_by_severity,
    largest_closing_speed,
    largest_peak_force,
    repeated_collisions,
    struck_standing,
    wedged_collisions,
)
from socialnav_mj.metrics.kinematics import (
    maximum_acceleration,
    maximum_jerk,
    maximum_speed,
    maximum_tilt,
    mean_acceleration,
    mean_jerk,
    time_not_moving,
)
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
    overturned,
    path_length,
    spawn_delay,
    success,
    time_under_way,
    timed_out,
)
from socialnav_mj.metrics.path import failures_to_progress, path_irregularity, spl
from socialnav_mj.metrics.proxemics import ZONES, mean_distance, space_compliance, zone_share
from socialnav_mj.metrics.proximity import (
    INTIMATE_DISTANCE,
    intimate_intrusions,
    intrusion_share,
    minimum_distance,
    nearest_pedestrian_distance,
)
from socialnav_mj.metrics.severity import Severity
from socialnav_mj.metrics.social_force import social_work
from socialnav_mj.metrics.time_to_collision import minimum_time_to_collision

__all__ = [
    "INTIMATE_DISTANCE",
    "NOBODY",
    "ZONES",
    "Fault",
    "Severity",
    "active_steps",
    "arrived",
    "average_speed",
    "collisions",
    "collisions_by_fault",
    "collisions_by_severity",
    "completion_censored",
    "completion_steps",
    "completion_time",
    "displacement",
    "distance_to_displacement",
    "failures_to_progress",
    "first_partner",
    "intimate_intrusions",
    "intrusion_share",
    "largest_closing_speed",
    "largest_peak_force",
    "maximum_acceleration",
    "maximum_jerk",
    "maximum_speed",
    "maximum_tilt",
    "mean_acceleration",
    "mean_distance",
    "mean_jerk",
    "minimum_distance",
    "minimum_time_to_collision",
    "nearest_pedestrian_distance",
    "never_spawned",
    "overturned",
    "path_irregularity",
    "path_length",
    "per_agent",
    "repeated_collisions",
    "social_work",
    "space_compliance",
    "spawn_delay",
    "spl",
    "struck_standing",
    "success",
    "time_not_moving",
    "time_under_way",
    "timed_out",
    "wedged_collisions",
    "zone_share",
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
        "overturned": overturned(episode),
        "never_spawned": never_spawned(episode),
        "completion_time": completion_time(episode),
        "completion_steps": completion_steps(episode),
        "time_under_way": time_under_way(episode),
        "completion_censored": completion_censored(episode),
        "active_steps": active_steps(episode),
        "displacement": displacement(episode),
        "path_length": path_length(episode),
        "distance_to_displacement": distance_to_displacement(episode),
        "spl": spl(episode),
        "path_irregularity": path_irregularity(episode),
        "failures_to_progress": failures_to_progress(episode),
        "average_speed": average_speed(episode),
        "maximum_speed": maximum_speed(episode),
        "maximum_tilt": maximum_tilt(episode),
        "mean_acceleration": mean_acceleration(episode),
        "maximum_acceleration": maximum_acceleration(episode),
        "mean_jerk": mean_jerk(episode),
        "maximum_jerk": maximum_jerk(episode),
        "time_not_moving": time_not_moving(episode),
        "intimate_intrusions": intimate_intrusions(episode),
        "intrusion_share": intrusion_share(episode),
        "minimum_distance": minimum_distance(episode),
        "mean_distance": mean_distance(episode),
        **{f"{zone}_zone_share": zone_share(episode, zone) for zone in ZONES},
        "space_compliance": space_compliance(episode),
        "minimum_time_to_collision": minimum_time_to_collision(episode),
        "social_work": social_work(episode),
        "collisions_pedestrian": collisions(episode, Partner.PEDESTRIAN),
        "collisions_agent": collisions(episode, Partner.AGENT),
        **{
            f"collisions_{kind.name.lower()}_by_{who.name.lower()}": collisions_by_fault(episode, kind, who)
            for kind in Partner
            for who in Fault
        },
        "first_partner": first_partner(episode),
        "repeated_collisions": repeated_collisions(episode),
        "struck_standing": struck_standing(episode),
        "largest_closing_speed": largest_closing_speed(episode),
        "largest_peak_force": largest_peak_force(episode),
        **{f"collisions_{what.name.lower()}": collisions_by_severity(episode, what) for what in Severity},
        "wedged_collisions": wedged_collisions(episode),
        "spawn_delay": spawn_delay(episode),
    }
