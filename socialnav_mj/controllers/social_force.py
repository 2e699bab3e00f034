"""`social_force`: Helbing and Molnar 1995 (doi 10.1103/PhysRevE.51.4282) with the interactions of Moussaid et al. 2009.

Moussaid et al. (doi 10.1098/rspb.2009.0405) measured how two walkers evade each other and fitted the force below.
"""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.controllers.steering import goal_direction, twist_towards
from socialnav_mj.elementary import arctan2, exp
from socialnav_mj.geometry import Array, wrap_angle


def interaction_force(
    position: Array,
    velocity: Array,
    present: NDArray[np.bool_],
    *,
    strength: float,
    importance: float,
    reach: float,
    n: float,
    n_prime: float,
) -> Array:
    """Sum of the forces of all others (Moussaid et al. 2009, eqs 2.4 to 2.6).

    With e the direction to the other and D = importance (v - v_other) + e, t = D / |D|, B = reach |D| and theta the
    angle from e to t, an other at distance d pushes with A exp(-d / B) (sign(theta) exp(-(n B theta)^2) times
    the left normal of t - exp(-(n' B theta)^2) t): it is evaded on the side on which it is passed, and braked for.

    Args:
        position: From each agent to the others, shape (n_agents, k, 2) [m].
        velocity: The agent's velocity minus the other's, same shape and axes [m/s].
        present: Which others are there, shape (n_agents, k).
        strength: A [m/s^2].
        importance: lambda, of the relative velocity beside the direction [s/m].
        reach: gamma [m].
        n: Of the evading force.
        n_prime: Of the braking force.

    Returns:
        Shape (n_agents, 2) [m/s^2].
    """
    force = np.zeros(position.shape)
    position, velocity = position[present], velocity[present]
    distance = np.hypot(position[..., 0], position[..., 1])
    towards = position / np.maximum(distance, 1e-9)[..., None]
    drive = importance * velocity + towards
    size = np.hypot(drive[..., 0], drive[..., 1])
    along = drive / np.maximum(size, 1e-9)[..., None]
    angle = wrap_angle(arctan2(along[..., 1], along[..., 0]) - arctan2(towards[..., 1], towards[..., 0]))
    spread = np.maximum(reach * size, 1e-9)
    near = -np.minimum(distance / spread, 700.0)
    braking = exp(np.maximum(near - (n_prime * spread * angle) ** 2, -700.0))
    evading = np.sign(angle) * exp(np.maximum(near - (n * spread * angle) ** 2, -700.0))
    left = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    force[present] = strength * (evading[..., None] * left - braking[..., None] * along)
    return np.einsum("nkd->nd", force)


@dataclass(kw_only=True)
class SocialForce(TwistController):
    """Drives the velocity to which the forces lead.

    A walker's velocity changes by (v_desired - v) / tau + force; where both cancel it is v_desired + tau force. The
    robot takes that as its command at once, since its own motors already relax.
    """

    relaxation_time: float = 0.5
    """tau > 0, as in PySocialForce [s]."""
    strength: float = 4.5
    """A >= 0 (Moussaid et al. 2009) [m/s^2]."""
    importance: float = 2.0
    """lambda >= 0, as above [s/m]."""
    reach: float = 0.35
    """gamma > 0, as above [m]."""
    n: float = 2.0
    """n >= 0, as above."""
    n_prime: float = 3.0
    """n' >= 0, as above."""
    name: str = "social_force"

    def __post_init__(self) -> None:
        for name in ("relaxation_time", "strength", "importance", "reach", "n", "n_prime"):
            value, positive = getattr(self, name), name in ("relaxation_time", "reach")
            if not (
                isinstance(value, (int, float)) and isfinite(value) and (value > 0 or (value == 0 and not positive))
            ):
                raise ValueError(f"{name} = {value!r} is not allowed; allowed: numbers {'>' if positive else '>='} 0")

    def force(self, observation: Observation) -> Array:
        """Push of everybody who is seen.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses twist, and places, velocities and masks.

        Returns:
            In the agent's frame, shape (n_agents, 2) [m/s^2].
        """
        own = np.zeros((len(observation["active"]), 1, 2))
        own[:, 0, 0] = observation["twist"][:, 0]
        people, agents = (
            interaction_force(
                observation[f"{kind}_position"],
                own - observation[f"{kind}_velocity"],
                observation[f"{kind}_mask"],
                strength=self.strength,
                importance=self.importance,
                reach=self.reach,
                n=self.n,
                n_prime=self.n_prime,
            )
            for kind in ("pedestrian", "agent")
        )
        return people + agents

    def twist(self, observation: Observation) -> Array:
        """Speed and yaw rate towards the velocity at which all forces cancel.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s].
        """
        desired = self.limits.max_speed * goal_direction(observation["goal"])
        return twist_towards(desired + self.relaxation_time * self.force(observation), self.limits)
