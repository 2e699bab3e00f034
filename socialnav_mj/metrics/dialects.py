"""The same names as other benchmarks define them, so that their numbers and ours can be laid side by side.

Each dialect is what its source's code or table says, on our Episode, one value per agent; docs/metrics.md tells the
differences. `socialnav-mj report FOLDER --dialect NAME` makes a table of them.
"""

from collections.abc import Callable

import numpy as np

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import collisions
from socialnav_mj.metrics.kinematics import (
    acceleration,
    jerk,
    maximum_acceleration,
    maximum_jerk,
    maximum_speed,
    mean_acceleration,
    mean_jerk,
    speed,
    time_not_moving,
)
from socialnav_mj.metrics.navigation import (
    active_steps,
    average_speed,
    completion_steps,
    completion_time,
    displacement,
    distance_to_displacement,
    path_length,
    time_under_way,
)
from socialnav_mj.metrics.outcomes import arrived, never_spawned, success, timed_out
from socialnav_mj.metrics.pairs import Pairs, largest_over, mean_over, pairs, radii
from socialnav_mj.metrics.path import failures_to_progress
from socialnav_mj.metrics.proxemics import COMPLIANT_DISTANCE, ZONES, space_compliance
from socialnav_mj.metrics.proximity import intimate_intrusions, minimum_distance, nearest_pedestrian_distance
from socialnav_mj.metrics.social_force import summed_social_work
from socialnav_mj.metrics.time_to_collision import disc_contact_time

TOUCHING_GAP = 0.02
"""HuNavSim counts a collision on every step with a smaller gap between the bodies [m]."""
STOPPED_SPEED, STOPPED_YAW_RATE = 0.001, 0.01
"""Below both HuNavSim takes the robot to stand [m/s], [rad/s]; the yaw rate with its sign, see `hunavsim`."""
DISCOMFORT_GAP = 0.2
"""CrowdNav's discomfort_dist: a smaller gap between the bodies is danger [m]."""


def paper(episode: Episode) -> dict[str, Array]:
    """The paper reproduced here, section IV, metrics 1-4 and figure 2; all in time steps, centres, 1.2 m.

    Args:
        episode: Record of n agents; scored by our metrics of the same quantities, in steps.

    Returns:
        Values by the paper's names, shape (n_agents,).
    """
    return {
        "success": success(episode).astype(float),
        "completion_time": completion_steps(episode),
        "distance_to_displacement": distance_to_displacement(episode),
        "intimate_intrusions": intimate_intrusions(episode),
        "average_speed": average_speed(episode),
    }


def socnavbench(episode: Episode) -> dict[str, Array]:
    """SocNavBench (Biswas et al. 2022): metrics/cost_functions.py and metrics_sim_utils.py, reduced per agent.

    time_to_collision is (centre distance - robot radius) over the closing speed along the line of centres: bodies that
    pass each other have one, and the pedestrian has no radius. path_irregularity is the mean angle between the vector
    to the goal and the *position vector*, so it depends on the map's origin. Ratio and irregularity do not ask for
    arrival; after one the goal of the irregularity is the last position.

    Args:
        episode: Record of n agents; outcomes, contacts, starts, goals, radii and all tracks are used.

    Returns:
        Values by the source's names, shape (n_agents,); time_to_collision is the smallest of the steps', inf if there
        is none (the source logs -1).
    """
    near = pairs(episode)
    robot, _ = radii(episode)
    closing = -np.einsum("kd,kd->k", near.offset, near.velocity) / np.where(near.distance > 0.0, near.distance, np.inf)
    ahead = (closing > 0.0) & (near.distance > robot)
    time = np.divide(near.distance - robot, closing, out=np.full(closing.shape, np.inf), where=ahead)
    position = episode.agent_position
    goal = np.where(success(episode)[:, None], _last(episode), episode.agent_goal)
    length = np.linalg.norm(goal - position, axis=-1) * np.linalg.norm(position, axis=-1) + 1e-10
    cosine = np.einsum("tnd,tnd->tn", goal - position, position) / length
    distance = displacement(episode)
    return {
        "success": success(episode).astype(float),
        "path_length": path_length(episode),
        "path_length_ratio": np.divide(
            path_length(episode), distance, out=np.full_like(distance, np.nan), where=distance > 0.0
        ),
        "path_irregularity": mean_over(np.arccos(np.clip(cosine, -1.0, 1.0)), np.isfinite(cosine)),
        "time_to_collision": _smallest(episode, near, time),
        "closest_pedestrian_distance": minimum_distance(episode),
    }


def hunavsim(episode: Episode) -> dict[str, Array]:
    """HuNavSim's evaluator (Perez-Higueras et al. 2023): hunav_evaluator/hunav_metrics.py.

    The average distance is between surfaces, the minimum and the zones are from the robot's *surface* to the person's
    *centre*; zones are exclusive bands in percent of steps; collisions are counted once a step and person, within 2 cm.
    Which of the two collided is decided there with swapped arguments of atan2, so the sum alone is given. time_not_
    moving also asks for a yaw rate under 0.01 rad/s, but `abs(r.angular_vel < 0.01)` takes the absolute value of the
    comparison and not of the rate, so a robot that turns on the spot stands if it turns to the right. social_work is a
    sum over steps.

    Args:
        episode: Record of n agents; outcomes, radii, yaw rates, and the tracks of agents and pedestrians are used.

    Returns:
        Values by the source's names, shape (n_agents,).
    """
    near = pairs(episode)
    robot, person = radii(episode)
    gap = nearest_pedestrian_distance(episode) - robot
    active, seen = episode.agent_active, episode.agent_active & np.isfinite(gap)
    zones = {name: (gap >= begin) & (gap < end) for name, (begin, end) in ZONES.items()}
    zones["intimate"] = gap < ZONES["intimate"][1]
    touching = near.active & (near.distance - robot - person < TOUCHING_GAP)
    still = (speed(episode) < STOPPED_SPEED) & (episode.agent_yaw_rate < STOPPED_YAW_RATE) & active
    steps = active_steps(episode)
    return {
        "completed": arrived(episode).astype(float),
        "time_to_reach_goal": time_under_way(episode),
        "path_length": path_length(episode),
        "avg_distance_to_closest_person": mean_over(gap - person, seen),
        "minimum_distance_to_people": minimum_distance(episode) - robot,
        **{
            f"{name}_space_intrusions": 100.0 * mean_over(zones[name].astype(float), active)
            for name in ("intimate", "personal", "social")
        },
        "collisions": np.bincount(near.agent[touching], minlength=episode.n_agents).astype(float),
        "time_not_moving": np.where(never_spawned(episode), np.nan, still.sum(axis=0) * episode.control_timestep),
        "avg_robot_linear_speed": mean_over(speed(episode), active),
        "social_work": np.where(steps > 0.0, summed_social_work(episode, turn=-1.0), np.nan),
    }


def francis2023(episode: Episode) -> dict[str, Array]:
    """Francis et al. (2023), Principles and guidelines, table 1.

    Success is arrival, with collisions counted apart. Space compliance is printed as the ratio of the trajectory
    *under* 0.5 m, so that more is worse. Time to collision assumes linear motion and names the personal space, so it
    ends where the centres are 0.5 m apart, the same distance. Thresholds that the table leaves open are ours.

    Args:
        episode: Record of n agents; outcomes, contacts, starts, goals, radii and all tracks are used.

    Returns:
        Values by the table's names, shape (n_agents,).
    """
    near = pairs(episode)
    shortest, walked = displacement(episode), np.fmax(path_length(episode), displacement(episode))
    efficiency = np.divide(shortest, walked, out=np.ones_like(shortest), where=walked > 0.0)
    return {
        "success": arrived(episode).astype(float),
        "human_collisions": collisions(episode, Partner.PEDESTRIAN).astype(float),
        "agent_collisions": collisions(episode, Partner.AGENT).astype(float),
        "timeout": timed_out(episode).astype(float),
        "failure_to_progress": failures_to_progress(episode),
        "stalled_time": time_not_moving(episode),
        "time_to_reach_goal": completion_time(episode),
        "path_length": path_length(episode),
        "success_weighted_by_path_length": arrived(episode) * efficiency,
        "velocity_avg": mean_over(speed(episode), np.isfinite(speed(episode))),
        "velocity_max": maximum_speed(episode),
        "acceleration_min": _least(acceleration(episode)),
        "acceleration_avg": mean_acceleration(episode),
        "acceleration_max": maximum_acceleration(episode),
        "jerk_min": _least(jerk(episode)),
        "jerk_avg": mean_jerk(episode),
        "jerk_max": maximum_jerk(episode),
        "space_compliance": 1.0 - space_compliance(episode),
        "minimum_distance_to_human": minimum_distance(episode),
        "minimum_time_to_collision": _smallest(
            episode, near, disc_contact_time(near.offset, near.velocity, COMPLIANT_DISTANCE)
        ),
    }


def crowdnav(episode: Episode) -> dict[str, Array]:
    """CrowdNav (Chen et al. 2019): crowd_sim/envs/crowd_sim.py and crowd_nav/utils/explorer.py.

    A step is "danger" if the gap between the bodies' surfaces gets under 0.2 m at any time of it, both moving straight.
    The source divides the dangerous steps of all episodes by a time that was multiplied by the step twice; here they
    are a share of the agent's own steps.

    Args:
        episode: Record of n agents; outcomes, contacts, radii, and the tracks of agents and pedestrians are used.

    Returns:
        Values by the source's words, shape (n_agents,); min_distance_in_danger is NaN without danger.
    """
    near = pairs(episode)
    gap = _swept_distance(near, episode.control_timestep) - sum(radii(episode))
    closest = np.full(episode.agent_heading.shape, np.inf)
    np.minimum.at(closest, (near.step, near.agent), gap)
    danger = (closest < DISCOMFORT_GAP) & (closest >= 0.0) & episode.agent_active
    return {
        "success": success(episode).astype(float),
        "collision": (collisions(episode) > 0).astype(float),
        "timeout": timed_out(episode).astype(float),
        "nav_time": np.where(success(episode), completion_time(episode), np.nan),
        "too_close": danger.sum(axis=0).astype(float),
        "frequency_in_danger": mean_over(danger.astype(float), episode.agent_active),
        "min_distance_in_danger": mean_over(closest, danger),
    }


DIALECTS: dict[str, Callable[[Episode], dict[str, Array]]] = {
    "paper": paper,
    "socnavbench": socnavbench,
    "hunavsim": hunavsim,
    "francis2023": francis2023,
    "crowdnav": crowdnav,
}


def compute(episode: Episode, dialect: str) -> dict[str, Array]:
    """Every metric of a dialect.

    Args:
        episode: Record of n agents; a dialect may read everything in it.
        dialect: Key of `DIALECTS`.

    Returns:
        Arrays of shape (n_agents,) by the name that the dialect's source uses.

    Raises:
        ValueError: If there is no such dialect.
    """
    if dialect not in DIALECTS:
        raise ValueError(f"unknown dialect {dialect!r}; available: {', '.join(DIALECTS)}")
    return DIALECTS[dialect](episode)


def _swept_distance(near: Pairs, step: float) -> Array:
    """Smallest distance of the centres while both keep their velocity for one step, shape (k,)."""
    squared = np.einsum("kd,kd->k", near.velocity, near.velocity)
    along = -np.einsum("kd,kd->k", near.offset, near.velocity)
    time = np.clip(np.divide(along, squared, out=np.zeros_like(squared), where=squared > 0.0), 0.0, step)
    return np.linalg.norm(near.offset + time[:, None] * near.velocity, axis=-1)


def _smallest(episode: Episode, near: Pairs, values: Array) -> Array:
    smallest = np.full(episode.n_agents, np.inf)
    np.minimum.at(smallest, near.agent[near.active], values[near.active])
    return np.where(np.bincount(near.agent[near.active], minlength=episode.n_agents) > 0, smallest, np.nan)


def _least(values: Array) -> Array:
    return -largest_over(-values, np.isfinite(values))


def _last(episode: Episode) -> Array:
    """Position at each agent's last sample, shape (n_agents, 2); NaN for agents that never spawned."""
    if not len(episode.time):
        return np.full((episode.n_agents, 2), np.nan)
    present = np.isfinite(episode.agent_heading)
    row = len(episode.time) - 1 - present[::-1].argmax(axis=0)
    return episode.agent_position[row, np.arange(episode.n_agents)]
