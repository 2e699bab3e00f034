"""How well robots do as they are told: what lies between command and motion, which a kinematic simulator leaves out."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array, arc, twist_of_wheel_speed
from socialnav_mj.metrics.metric import Better, Metric, Need
from socialnav_mj.metrics.missing import NO_COMMAND, Missing
from socialnav_mj.metrics.pairs import mean_over

STOP_SPEED = 0.05
"""A command of no more forward speed is one to stop, and who drives no faster stands [m/s]."""
UNMET_SPEED, UNMET_TURN = 0.1, 0.2
"""By which a command is not met [m/s], [rad/s]."""
DRIVING_SPEED = 0.3
"""Who is told to stop and drives faster than this has a stopping distance [m/s]."""


def commanded_twist(episode: Episode) -> Array:
    """Forward speed and yaw rate that were commanded, within the limits of the scenario.

    Args:
        episode: Record with wheel speeds.

    Returns:
        Shape (t, n_agents, 2); NaN where there is no command [m/s], [rad/s].
    """
    scenario = Scenario.from_dict(episode.metadata["scenario"])
    robot, turn = scenario.robot, scenario.max_yaw_rate
    twist = twist_of_wheel_speed(episode.agent_wheel_speed, wheel_radius=robot.wheel_radius, track=robot.track)
    return np.clip(twist, (0.0, -turn), (robot.max_speed, turn))


def tracking_error(episode: Episode) -> Array:
    """Mean distance between where a command leads exactly and where the robot is a control step later.

    Args:
        episode: Record with poses and wheel speeds.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents without a command [m].
    """
    twist, after = commanded_twist(episode)[:-1], episode.agent_position[1:]
    position, heading = episode.agent_position[:-1], episode.agent_heading[:-1]
    known = (
        np.isfinite(twist[..., 0]) & np.isfinite(heading) & np.isfinite(position[..., 0]) & np.isfinite(after[..., 0])
    )
    there, _ = arc(position[known], heading[known], twist[known], np.full((1, 1), episode.control_timestep))
    error = np.full(episode.agent_heading.shape, np.nan)
    error[:-1][known] = np.linalg.norm(after[known] - there[0], axis=-1)
    return mean_over(error, np.isfinite(error))


def unmet_share(episode: Episode) -> Array:
    """Share of control steps at whose end the robot does not drive as it was commanded.

    That is, by more than `UNMET_SPEED` or `UNMET_TURN`: its motors were at their limit, it slipped, or it was held.

    Args:
        episode: Record with headings, velocities, yaw rates and wheel speeds.

    Returns:
        Shape (n_agents,), in [0, 1]; NaN for agents without a command.
    """
    twist = commanded_twist(episode)[:-1]
    ahead, _ = _own_velocity(episode)
    unmet = np.abs(ahead[1:] - twist[..., 0]) > UNMET_SPEED
    unmet |= np.abs(episode.agent_yaw_rate[1:] - twist[..., 1]) > UNMET_TURN
    return _after_commands(episode, np.concatenate([np.zeros_like(unmet[:1]), unmet]).astype(float))


def side_slip(episode: Episode) -> Array:
    """Mean speed across the wheels, which cannot roll that way.

    Args:
        episode: Record with headings and velocities.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents without a command [m/s].
    """
    _, across = _own_velocity(episode)
    return _after_commands(episode, np.abs(across))


def _own_velocity(episode: Episode) -> tuple[Array, Array]:
    """Velocity ahead and to the left of each agent, both (t, n_agents) [m/s]."""
    ahead, left = np.cos(episode.agent_heading), np.sin(episode.agent_heading)
    x, y = np.moveaxis(episode.agent_velocity, -1, 0)
    return x * ahead + y * left, y * ahead - x * left


def stopping_distance(episode: Episode) -> Array:
    """Mean way from a command to stop until the robot stands, of stops that nothing interrupts.

    A stop begins at a sample at which a robot that drives faster than `DRIVING_SPEED` is commanded at most
    `STOP_SPEED`, and ends at the first one at which it drives no faster than that.

    Args:
        episode: Record with poses, velocities and wheel speeds.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents that did not stop so [m].
    """
    told = commanded_twist(episode)[..., 0] <= STOP_SPEED
    speed = np.linalg.norm(episode.agent_velocity, axis=-1)
    steps = np.linalg.norm(np.diff(episode.agent_position, axis=0), axis=-1)
    begins = told & (speed > DRIVING_SPEED)
    begins[1:] &= ~told[:-1]
    ways: list[list[float]] = [[] for _ in range(episode.n_agents)]
    for sample, agent in np.argwhere(begins):
        end = sample
        while end + 1 < len(speed) and told[end, agent] and speed[end, agent] > STOP_SPEED:
            end += 1
        if speed[end, agent] <= STOP_SPEED:
            ways[agent].append(float(steps[sample:end, agent].sum()))
    return np.array([np.mean(own) if own else np.nan for own in ways])


def _after_commands(episode: Episode, values: Array) -> Array:
    """Mean over the samples that follow a command."""
    after = np.zeros(values.shape, dtype=bool)
    after[1:] = np.isfinite(episode.agent_wheel_speed[:-1, :, 0])
    return mean_over(values, after & np.isfinite(values))


def _no_stop(episode: Episode) -> NDArray[np.bool_]:
    return np.isnan(stopping_distance(episode))


METRICS = (
    Metric(
        name="tracking_error",
        function=tracking_error,
        formula="mean distance between where the command leads along its arc and where the robot is a step later",
        better=Better.LESS,
        missing=NO_COMMAND,
        unit="m",
        low=0.0,
        needs=(Need.POSITION, Need.HEADING, Need.DRIVE),
        source="ours; 0 for an ideal unicycle",
    ),
    Metric(
        name="unmet_share",
        function=unmet_share,
        formula="share of control steps at whose end the robot is off the commanded twist by more than 0.1 m/s or "
        "0.2 rad/s: motors at their limit, slip, or held",
        better=Better.LESS,
        missing=NO_COMMAND,
        low=0.0,
        high=1.0,
        needs=(Need.HEADING, Need.VELOCITY, Need.DRIVE),
        heading="commands not met",
        source="ours; 0 for an ideal unicycle",
    ),
    Metric(
        name="side_slip",
        function=side_slip,
        formula="mean speed across the wheels",
        better=Better.LESS,
        missing=NO_COMMAND,
        unit="m/s",
        low=0.0,
        needs=(Need.HEADING, Need.VELOCITY),
        source="ours; 0 for an ideal unicycle",
    ),
    Metric(
        name="stopping_distance",
        function=stopping_distance,
        formula="mean way from a command of at most 0.05 m/s, at more than 0.3 m/s, until the robot stands",
        better=Better.LESS,
        missing=Missing(rule="never stopped so", where=_no_stop),
        unit="m",
        low=0.0,
        needs=(Need.POSITION, Need.VELOCITY, Need.DRIVE),
        digits=2,
        source="ours",
    ),
)
