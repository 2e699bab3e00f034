"""Social-force work: how hard agents and people would have to push each other off, were they social-force walkers."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Metric, Need
from socialnav_mj.metrics.missing import NO_STEP
from socialnav_mj.metrics.navigation import active_steps
from socialnav_mj.metrics.pairs import pairs

# Moussaid et al. (2009), Experimental study of the behavioural mechanisms underlying self-organization in human
# crowds, eqs 4-5, with the magnitude 2.1 that HuNavSim's evaluator (sfm.py) gives the force.
MAGNITUDE = 2.1
"""[m/s^2], per unit of mass."""
ANTICIPATION = 2.0
"""lambda: weight of the relative velocity in the direction of interaction [s/m]."""
RANGE = 0.35
"""gamma: B = gamma |D| is the range of the force [m]."""
ANGULAR = 2.0
"""n, of the turning force [1/m]."""
ANGULAR_BRAKING = 3.0
"""n', of the braking force [1/m]."""

_STRAIGHT = 1e-9
"""Angles nearer than this to 0 or pi have no side [rad]: rounding must not choose where the force turns."""


def social_force(offset: Array, velocity: Array, *, turn: float = 1.0) -> Array:
    """Force of each pedestrian on each agent; the force of the agent on the pedestrian is its opposite.

    With e = offset / |offset| and t = D / |D|, D = lambda (-velocity) + e; theta is the angle from e to t, B = gamma
    |D|, d = |offset|; f = -A [exp(-d/B - (n' B theta)^2) t + turn sign(theta) exp(-d/B - (n B theta)^2) t_left].

    Args:
        offset: From the agent's centre to the pedestrian's, shape (k, 2) [m].
        velocity: The pedestrian's minus the agent's, shape (k, 2) [m/s].
        turn: 1 as Moussaid et al. print it; -1 turns to the other side, as HuNavSim's sfm.py does.

    Returns:
        Shape (k, 2); 0 where the two centres or the direction of interaction vanish [m/s^2].
    """
    d = np.linalg.norm(offset, axis=-1)
    e = np.divide(offset, d[:, None], out=np.zeros_like(offset), where=d[:, None] > 0.0)
    interaction = e - ANTICIPATION * velocity
    length = np.linalg.norm(interaction, axis=-1)
    defined = (d > 0.0) & (length > 0.0)
    length = np.where(defined, length, 1.0)
    t = interaction / length[:, None]
    theta = np.arctan2(e[:, 0] * t[:, 1] - e[:, 1] * t[:, 0], np.einsum("kd,kd->k", e, t))
    reach = RANGE * length
    braking = np.exp(-d / reach - (ANGULAR_BRAKING * reach * theta) ** 2)
    side = np.where(np.abs(np.sin(theta)) < _STRAIGHT, 0.0, np.sign(theta))
    turning = turn * side * np.exp(-d / reach - (ANGULAR * reach * theta) ** 2)
    left = np.stack([-t[:, 1], t[:, 0]], axis=-1)
    force = -MAGNITUDE * (braking[:, None] * t + turning[:, None] * left)
    return np.where(defined[:, None], force, 0.0)


def social_work(episode: Episode) -> Array:
    """Social work (Perez-Higueras et al. 2018; HuNavSim), integrated over time instead of summed over log steps.

    Integral over active steps of |sum_j f_j| + sum_j |f_j|: the force of all replayed people on the agent, and the
    force of the agent on each of them. HuNavSim adds the same terms once a log step, so that its value doubles with
    the log rate (dialect `hunavsim`). There are no obstacles. For the human row the agent is the recorded person.

    Args:
        episode: Record with the tracks of agents and pedestrians, and the control step.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents without an active step [m/s].
    """
    work = summed_social_work(episode) * episode.control_timestep
    return np.where(active_steps(episode) > 0.0, work, np.nan)


def summed_social_work(episode: Episode, *, turn: float = 1.0) -> Array:
    """The sum over active steps that `social_work` multiplies by the control step.

    Args:
        episode: Record with the tracks of agents and pedestrians.
        turn: 1 for the side to which Moussaid et al. let people turn, -1 for the other.

    Returns:
        Shape (n_agents,) [m/s^2].
    """
    near = pairs(episode)
    force = np.where(near.active[:, None], social_force(near.offset, near.velocity, turn=turn), 0.0)
    on_agent = np.zeros((len(episode.time), episode.n_agents, 2))
    np.add.at(on_agent, (near.step, near.agent), force)
    on_people = np.bincount(near.agent, np.linalg.norm(force, axis=-1), minlength=episode.n_agents)
    return np.linalg.norm(on_agent, axis=-1).sum(axis=0) + on_people


METRICS = (
    Metric(
        name="social_work",
        function=social_work,
        unit="m/s",
        low=0.0,
        better=Better.LESS,
        missing=NO_STEP,
        needs=(Need.POSITION, Need.VELOCITY, Need.PEDESTRIANS),
        formula="dt sum (|sum_j f_j| + sum_j |f_j|), f_j: Moussaid's force of person j",
        source="HuNavSim sums over log steps (doubles with the rate) and turns to the other side",
    ),
)
