"""How fast and how smoothly agents move: speed, acceleration, jerk, standing still; from the logged velocities."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Metric, Need
from socialnav_mj.metrics.missing import FEWER_THAN_2_SAMPLES, FEWER_THAN_3_SAMPLES, NEVER_SPAWNED
from socialnav_mj.metrics.outcomes import never_spawned
from socialnav_mj.metrics.pairs import largest_over, mean_over

STANDING_SPEED = 0.1
"""Whoever is slower stands still [m/s]: a tenth of the robot's top speed, 16 times its steady tracking error (6 mm/s),
and a motion of 2 cm in a control step."""


def speed(episode: Episode) -> Array:
    """Speed over ground.

    Args:
        episode: Record with the agents' velocities at t samples.

    Returns:
        Shape (t, n_agents); NaN where the agent is not in the scene [m/s].
    """
    return np.linalg.norm(episode.agent_velocity, axis=-1)


def acceleration(episode: Episode) -> Array:
    """Length of the change of velocity from each sample to the next, over the control step: turning counts too.

    Args:
        episode: Record with the agents' velocities at t samples, a control step apart.

    Returns:
        Shape (t - 1, n_agents); NaN where the agent is not at both samples [m/s^2].
    """
    return np.linalg.norm(np.diff(episode.agent_velocity, axis=0), axis=-1) / episode.control_timestep


def jerk(episode: Episode) -> Array:
    """Length of the second difference of velocity over the square of the control step.

    Args:
        episode: Record with the agents' velocities at t samples, a control step apart.

    Returns:
        Shape (max(t - 2, 0), n_agents); NaN where the agent is not at all three samples [m/s^3].
    """
    return np.linalg.norm(np.diff(episode.agent_velocity, n=2, axis=0), axis=-1) / episode.control_timestep**2


def maximum_speed(episode: Episode) -> Array:
    """Largest speed from the spawn's sample to the end's; a push can make it larger than the robot's limit.

    Args:
        episode: Record with the agents' velocities.

    Returns:
        Shape (n_agents,); NaN for agents that never spawned [m/s].
    """
    return _largest(speed(episode))


def maximum_tilt(episode: Episode) -> Array:
    """Largest angle between the robot's mast and the vertical at a sample, from the spawn's to the end's.

    Args:
        episode: Record with the agents' tilts.

    Returns:
        Shape (n_agents,), in [0, pi]; NaN for agents that never spawned, 0 in the human row [rad].
    """
    return _largest(episode.agent_tilt)


def mean_acceleration(episode: Episode) -> Array:
    """Mean of `acceleration`; agents start from rest, people do not.

    Args:
        episode: Record with the agents' velocities.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents with fewer than 2 samples [m/s^2].
    """
    return _mean(acceleration(episode))


def maximum_acceleration(episode: Episode) -> Array:
    """Largest `acceleration`.

    Args:
        episode: Record with the agents' velocities.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents with fewer than 2 samples [m/s^2].
    """
    return _largest(acceleration(episode))


def mean_jerk(episode: Episode) -> Array:
    """Mean of `jerk`.

    Args:
        episode: Record with the agents' velocities.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents with fewer than 3 samples [m/s^3].
    """
    return _mean(jerk(episode))


def maximum_jerk(episode: Episode) -> Array:
    """Largest `jerk`.

    Args:
        episode: Record with the agents' velocities.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents with fewer than 3 samples [m/s^3].
    """
    return _largest(jerk(episode))


def time_not_moving(episode: Episode) -> Array:
    """Time on active steps that begin slower than `STANDING_SPEED`; every agent starts from rest, so its first counts.

    Args:
        episode: Record with the agents' velocities and the samples at which they are under way.

    Returns:
        Shape (n_agents,), at most `time_under_way`; NaN for agents that never spawned [s].
    """
    standing = (speed(episode) < STANDING_SPEED) & episode.agent_active
    return np.where(never_spawned(episode), np.nan, standing.sum(axis=0) * episode.control_timestep)


def _mean(values: Array) -> Array:
    return mean_over(values, np.isfinite(values))


def _largest(values: Array) -> Array:
    return largest_over(values, np.isfinite(values))


METRICS = (
    Metric(
        name="maximum_speed",
        function=maximum_speed,
        unit="m/s",
        low=0.0,
        better=Better.NEITHER,
        missing=NEVER_SPAWNED,
        needs=(Need.VELOCITY,),
        formula="max |v|, spawn to end",
        source="Francis 2023, V_max; pushed robots exceed 1 m/s",
    ),
    Metric(
        name="maximum_tilt",
        function=maximum_tilt,
        unit="rad",
        low=0.0,
        high=np.pi,
        better=Better.LESS,
        missing=NEVER_SPAWNED,
        needs=(Need.TILT,),
        formula="max angle between mast and vertical, spawn to end",
        source="ours; 0 in the human row",
    ),
    Metric(
        name="mean_acceleration",
        function=mean_acceleration,
        unit="m/s^2",
        low=0.0,
        better=Better.LESS,
        missing=FEWER_THAN_2_SAMPLES,
        needs=(Need.VELOCITY,),
        formula="mean |v(k+1) - v(k)| / dt",
        source="vector; HuNavSim takes the signed change of speed, which telescopes to (v_end - v_start) / T",
    ),
    Metric(
        name="maximum_acceleration",
        function=maximum_acceleration,
        unit="m/s^2",
        low=0.0,
        better=Better.LESS,
        missing=FEWER_THAN_2_SAMPLES,
        needs=(Need.VELOCITY,),
        formula="max of the same",
        source="Francis 2023, A_max",
    ),
    Metric(
        name="mean_jerk",
        function=mean_jerk,
        unit="m/s^3",
        low=0.0,
        better=Better.LESS,
        missing=FEWER_THAN_3_SAMPLES,
        needs=(Need.VELOCITY,),
        formula="mean |v(k+2) - 2 v(k+1) + v(k)| / dt^2",
        source="HuNavSim divides the acceleration once more by dt, without a difference",
    ),
    Metric(
        name="maximum_jerk",
        function=maximum_jerk,
        unit="m/s^3",
        low=0.0,
        better=Better.LESS,
        missing=FEWER_THAN_3_SAMPLES,
        needs=(Need.VELOCITY,),
        formula="max of the same",
        source="Francis 2023, J_max",
    ),
    Metric(
        name="time_not_moving",
        function=time_not_moving,
        unit="s",
        low=0.0,
        digits=1,
        better=Better.LESS,
        missing=NEVER_SPAWNED,
        needs=(Need.VELOCITY,),
        formula="dt times steps with |v| < 0.1 m/s, at most T",
        source="HuNavSim: < 0.001 m/s and < 0.01 rad/s, any turn to the right included; Francis 2023 leaves it open. "
        "Robots start from rest",
    ),
)
