"""Metrics: pure functions of one recorded `Episode`, each with one value per agent.

The human row is scored by the same functions, on an Episode made of the recorded tracks. Formulas, units, ranges and
worked examples: docs/metrics.md; the same names as others define them: `socialnav_mj.metrics.dialects`. A metric is
declared where it is defined, in its module's `METRICS`; `registry` finds it there, and tables and pages follow.
"""

from socialnav_mj.metrics.collisions import NOBODY, collisions, first_partner
from socialnav_mj.metrics.contacts import Fault
from socialnav_mj.metrics.faults import collisions_by_fault, largest_closing_speed, repeated_collisions, struck_standing
from socialnav_mj.metrics.forces import (
    collisions_by_severity,
    largest_held_back,
    largest_impact_force,
    largest_impact_impulse,
    push_duration,
    push_impulse,
    shoved_standing,
    time_shoved_standing,
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
from socialnav_mj.metrics.metric import Better, Kind, Mean, Metric, Need
from socialnav_mj.metrics.missing import Missing
from socialnav_mj.metrics.navigation import (
    active_steps,
    average_speed,
    completion_steps,
    completion_time,
    displacement,
    distance_to_displacement,
    path_length,
    spawn_delay,
    time_under_way,
)
from socialnav_mj.metrics.outcomes import (
    arrived,
    completion_censored,
    ghost_overlaps,
    never_spawned,
    overturned,
    success,
    success_if_ghosts_count,
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
from socialnav_mj.metrics.registry import METRICS, per_agent
from socialnav_mj.metrics.severity import Severity
from socialnav_mj.metrics.social_force import social_work
from socialnav_mj.metrics.time_to_collision import minimum_time_to_collision

__all__ = [
    "INTIMATE_DISTANCE",
    "METRICS",
    "NOBODY",
    "ZONES",
    "Better",
    "Fault",
    "Kind",
    "Mean",
    "Metric",
    "Missing",
    "Need",
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
    "ghost_overlaps",
    "intimate_intrusions",
    "intrusion_share",
    "largest_closing_speed",
    "largest_held_back",
    "largest_impact_force",
    "largest_impact_impulse",
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
    "push_duration",
    "push_impulse",
    "repeated_collisions",
    "shoved_standing",
    "social_work",
    "space_compliance",
    "spawn_delay",
    "spl",
    "struck_standing",
    "success",
    "success_if_ghosts_count",
    "time_not_moving",
    "time_shoved_standing",
    "time_under_way",
    "timed_out",
    "wedged_collisions",
    "zone_share",
]
