"""Names of the columns of agents.parquet and of the measures of summary.csv, as constants, and their order.

Units, ranges and missing values of metrics are their declarations' (`socialnav_mj.metrics`, docs/metrics.md). A metric
that no code reads by its name needs no constant, and one without a place in the order stands behind the others.
"""

DATASET = "dataset"
"""Recording."""
VARIANT = "variant"
"""Of the recording: how its files are read."""
SCENARIO = "scenario"
SHARE = "share"
"""Of the people who are replaced, in [0, 1]."""
CONTROLLER = "controller"
DRAW = "draw"
"""Seed of the permutation of people."""
AGENT = "agent"
"""Index in its episode."""
PERSON = "person"
"""Id in the recording of who was replaced."""
EPISODE = "episode"
"""File that the row comes from."""
STATE_HASH = "state_hash"
"""Of the episode."""

SUCCESS = "success"
SUCCESS_IF_GHOSTS_COUNT = "success_if_ghosts_count"
ARRIVED = "arrived"
TIMED_OUT = "timed_out"
OVERTURNED = "overturned"
NEVER_SPAWNED = "never_spawned"
FIRST_PARTNER = "first_partner"
COMPLETION_TIME = "completion_time"
COMPLETION_STEPS = "completion_steps"
TIME_UNDER_WAY = "time_under_way"
ACTIVE_STEPS = "active_steps"
PATH_LENGTH = "path_length"
DISTANCE_TO_DISPLACEMENT = "distance_to_displacement"
AVERAGE_SPEED = "average_speed"
INTIMATE_INTRUSIONS = "intimate_intrusions"
INTRUSION_SHARE = "intrusion_share"
MINIMUM_DISTANCE = "minimum_distance"
STRUCK_STANDING = "struck_standing"

# Measures that are not a metric's plain mean.
FIRST_HIT_PEDESTRIAN = "first_hit_pedestrian"
"""Share of agents whose first partner was a pedestrian."""
FIRST_HIT_AGENT = "first_hit_agent"
COMPLETION_TIME_SUCCESS = "completion_time_success"
"""Over successes alone, as the other two."""
COMPLETION_STEPS_SUCCESS = "completion_steps_success"
DISTANCE_TO_DISPLACEMENT_SUCCESS = "distance_to_displacement_success"
INTRUSION_SHARE_OF_STEPS = "intrusion_share_of_steps"
"""Weighs active steps equally, where `INTRUSION_SHARE` weighs agents equally."""

ORDER = (
    SUCCESS,
    SUCCESS_IF_GHOSTS_COUNT,
    "ghost_overlaps",
    ARRIVED,
    TIMED_OUT,
    OVERTURNED,
    NEVER_SPAWNED,
    FIRST_HIT_PEDESTRIAN,
    FIRST_HIT_AGENT,
    COMPLETION_TIME,
    COMPLETION_STEPS,
    TIME_UNDER_WAY,
    "completion_censored",
    ACTIVE_STEPS,
    "displacement",
    PATH_LENGTH,
    DISTANCE_TO_DISPLACEMENT,
    AVERAGE_SPEED,
    INTIMATE_INTRUSIONS,
    INTRUSION_SHARE,
    MINIMUM_DISTANCE,
    "collisions_pedestrian",
    "collisions_agent",
    FIRST_PARTNER,
    "spawn_delay",
    "spl",
    "path_irregularity",
    "failures_to_progress",
    "maximum_speed",
    "maximum_tilt",
    "mean_acceleration",
    "maximum_acceleration",
    "mean_jerk",
    "maximum_jerk",
    "time_not_moving",
    "mean_distance",
    "intimate_zone_share",
    "personal_zone_share",
    "social_zone_share",
    "public_zone_share",
    "space_compliance",
    "minimum_time_to_collision",
    "social_work",
    "collisions_pedestrian_by_agent",
    "collisions_pedestrian_by_partner",
    "collisions_pedestrian_by_both",
    "collisions_pedestrian_by_neither",
    "collisions_agent_by_agent",
    "collisions_agent_by_partner",
    "collisions_agent_by_both",
    "collisions_agent_by_neither",
    "collisions_under_quasi_static",
    "collisions_under_transient",
    "collisions_over",
    "collisions_clamped",
    "wedged_collisions",
    "repeated_collisions",
    STRUCK_STANDING,
    "largest_closing_speed",
    "largest_impact_force",
    "largest_impact_impulse",
    "push_duration",
    "push_impulse",
    "shoved_standing",
    "time_shoved_standing",
    "largest_held_back",
)
"""Places that metrics and measures keep, so that tables of before and after can be laid side by side."""


def human(metric: str) -> str:
    """Column with the value of the person that an agent replaced; null until paired, or without a human row.

    Args:
        metric: Name of a metric that is declared as `paired`.

    Returns:
        The column's name.
    """
    return f"human_{metric}"


def place(*names: str) -> int:
    """Where a column or measure stands among the others.

    Args:
        names: Its own, and that of what it is made of: the first one that has a place counts.

    Returns:
        Index in `ORDER`, or one behind it.
    """
    return next((ORDER.index(name) for name in names if name in ORDER), len(ORDER))
