"""Potential field (paper section III-B; Khatib 1986, doi 10.1177/027836498600500106)."""

from dataclasses import dataclass
from math import ceil, isfinite

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.elementary import arctan2
from socialnav_mj.geometry import Array
from socialnav_mj.observation import Neighbours

MINIMUM_DISTANCE = 0.05
"""Distances below this repel like this one, which keeps the force finite [m]."""
MINIMUM_TURN = 1e-3
"""Least turn that eq 7 divides by, as a share of pi; below pi times this the speed is at its limit anyway."""

NEIGHBOURS = 8.0
"""Most that are asked for in large crowds, times the influence distance squared: 2.5 in a square metre [1/m^2]."""

_USED = ("goal", "twist", "pedestrian_position", "pedestrian_mask", "agent_position", "agent_mask")


def attractive_force(
    goal: Array, velocity: Array, *, position_gain: float, velocity_gain: float, limit: float | None
) -> Array:
    """Pull towards the goal, damped (paper eq 3: -k_p (x - x_goal) - k_v dx/dt).

    The second x of the printed equation is the velocity, as the text below it says. The limit bounds the pull, not the
    damping: bounding their sum instead takes the damping away, since the pull of a far goal drowns it, and agents then
    touch each other three times as often.

    Args:
        goal: From the agent to its goal, shape (n_agents, 2) [m].
        velocity: The agent's own, in the same frame, shape (n_agents, 2) [m/s].
        position_gain: k_p >= 0, pull per metre to the goal.
        velocity_gain: k_v >= 0, damping per m/s.
        limit: Largest size of the pull; None for the equation as printed.

    Returns:
        Pull minus damping in the frame of the arguments, shape (n_agents, 2).
    """
    pull = position_gain * goal
    if limit is not None:
        size = np.linalg.norm(pull, axis=1, keepdims=True)
        pull = pull * np.minimum(1.0, limit / np.maximum(size, 1e-9))
    return pull - velocity_gain * velocity


def repulsive_force(obstacle: Array, present: NDArray[np.bool_], *, gain: float, influence_distance: float) -> Array:
    """Sum of the pushes of all obstacles (paper eqs 4-5: eta/2 (1/rho - 1/rho_0) / rho^2 along d rho/dx).

    d rho/dx is the unit vector from the obstacle to the agent. rho is taken between centres: the paper gives its
    agents no size. An obstacle at the agent's very centre pushes nowhere.

    Args:
        obstacle: From the agent to each obstacle, shape (n_agents, n_obstacles, 2) [m].
        present: Which obstacles are there, shape (n_agents, n_obstacles).
        gain: eta, >= 0.
        influence_distance: rho_0 > 0; obstacles farther away push nothing [m].

    Returns:
        Shape (n_agents, 2), away from the obstacles.
    """
    distance = np.hypot(obstacle[..., 0], obstacle[..., 1])
    rho = np.maximum(distance, MINIMUM_DISTANCE)
    size = 0.5 * gain * (1.0 / rho - 1.0 / influence_distance) / rho**2
    size = np.where(present & (distance <= influence_distance), size, 0.0)
    away = -obstacle / np.maximum(distance, 1e-9)[..., None]
    return np.einsum("nm,nmd->nd", size, away)


def speed_and_turn(force: Array) -> tuple[Array, Array]:
    """Map a force in the agent's frame to a desired speed and change of heading (paper eqs 7-8).

    The printed eq 7 projects the force on the unit velocity and divides by the signed angle over pi. The velocity is 0
    at the start, so the heading stands for its direction; the angle can be negative or 0, so we take its absolute
    value and keep it from 0; a force from behind gives a negative speed, which the robot cannot drive: it turns on the
    spot.

    Args:
        force: Shape (n_agents, 2), ahead and to the left.

    Returns:
        Speed s_f >= 0, not yet limited, and change of heading theta_fx in [-pi, pi] [rad], both of shape (n_agents,).
    """
    turn = arctan2(force[:, 1], force[:, 0])
    speed = np.maximum(force[:, 0], 0.0) / np.maximum(np.abs(turn) / np.pi, MINIMUM_TURN)
    return speed, turn


def _require_number(name: str, given: object, *, zero_allowed: bool, or_else: str = "") -> None:
    if isinstance(given, (int, float)) and isfinite(given) and (given > 0 or (zero_allowed and given == 0)):
        return
    raise ValueError(f"{name} = {given!r} is not allowed; allowed: numbers {'>=' if zero_allowed else '>'} 0{or_else}")


@dataclass(kw_only=True)
class PotentialField(TwistController):
    """Attraction to the goal and repulsion from everybody near, pedestrians and agents alike.

    Eq 3 as printed: the pull grows with the distance to the goal, 10 N at 10 m, and swamps the repulsion. The paper
    names no gains; docs/controllers.md has a sweep. It names no unit of time for the change of heading either: it is
    made in one control step as far as the yaw rate allows.
    """

    position_gain: float = 1.0
    """k_p >= 0: pull per metre to the goal, up to the limit."""
    velocity_gain: float = 0.5
    """k_v >= 0: damping per m/s."""
    repulsion_gain: float = 2.0
    """eta >= 0: strength of the pushes."""
    influence_distance: float = 2.0
    """rho_0 > 0: nobody farther away pushes [m]."""
    attraction_limit: float | None = None
    """Largest size of the pull towards the goal; None for eq 3 as printed."""
    name: str = "potential_field"

    def __post_init__(self) -> None:
        for name in ("position_gain", "velocity_gain", "repulsion_gain"):
            _require_number(name, getattr(self, name), zero_allowed=True)
        _require_number("influence_distance", self.influence_distance, zero_allowed=False)
        if self.attraction_limit is not None:
            _require_number("attraction_limit", self.attraction_limit, zero_allowed=False, or_else=", None")

    @property
    def sees_nearest(self) -> Neighbours:
        """Whoever is beyond the influence distance pushes nothing."""
        return ceil(NEIGHBOURS * self.influence_distance**2), self.influence_distance

    def force(self, observation: Observation) -> Array:
        """Total force in the agent's frame (paper eq 6).

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses goal, twist, positions and masks.

        Returns:
            Ahead and to the left, shape (n_agents, 2).
        """
        velocity = np.zeros_like(observation["goal"])
        velocity[:, 0] = observation["twist"][:, 0]
        force = attractive_force(
            observation["goal"],
            velocity,
            position_gain=self.position_gain,
            velocity_gain=self.velocity_gain,
            limit=self.attraction_limit,
        )
        for kind in ("pedestrian", "agent"):
            force = force + repulsive_force(
                observation[f"{kind}_position"],
                observation[f"{kind}_mask"],
                gain=self.repulsion_gain,
                influence_distance=self.influence_distance,
            )
        return force

    def twist(self, observation: Observation) -> Array:
        """Speed and yaw rate along the total force.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses active and what `force` uses.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        speed, turn = speed_and_turn(self.force({key: observation[key][rows] for key in _USED}))
        result = np.zeros((len(observation["active"]), 2))
        result[rows] = np.stack([speed, turn / self.limits.control_timestep], axis=1)
        return result


@dataclass(kw_only=True)
class PotentialFieldCapped(PotentialField):
    """The potential field with a pull of at most 1, however far the goal: ours, and clearly stronger than the paper's.

    The authors' research code caps attraction and repulsion alike; the paper does not say so.
    """

    attraction_limit: float | None = 1.0
    """Largest size of the pull towards the goal; None for eq 3 as printed."""
    name: str = "potential_field_capped"
