"""What a controller is, and the one place where twists become wheel speeds."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.controllers.motion import LIGHT, Motion, motion_of
from socialnav_mj.geometry import Array, twist_of_wheel_speed, wheel_speed_of_twist
from socialnav_mj.observation import Neighbours

Observation = Mapping[str, NDArray[Any]]

IS_CONTROLLER = "is_controller"
"""Key in the metadata of a dataclass field that holds another controller, or a tuple of them; on the command line and
in an episode they are written as `make_controller` takes them."""

ActionKind = Literal["twist", "wheels"]
"""What the two numbers of a normalised action are, see `Limits.wheel_speed_of_action`."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the wheels can do; `Limits.of(task.scenario)` is what `Controller.reset` gets."""

    max_speed: float
    """Largest forward speed; the smallest is 0 [m/s]."""
    max_yaw_rate: float
    """Largest yaw rate to either side [rad/s]."""
    wheel_radius: float
    """Radius of the driven wheels [m]."""
    track: float
    """Distance between the wheels' contact points [m]."""
    control_timestep: float
    """Time between two actions [s]."""
    contact_distance: float
    """Distance between an agent's and a pedestrian's centre at which they touch [m]."""
    agent_contact_distance: float
    """Distance between two agents' centres at which they touch [m]."""
    motion: Motion = LIGHT
    """How the robots follow commands."""

    @classmethod
    def of(cls, scenario: Scenario) -> "Limits":
        """What the robots of a scenario can do, and at which distances they touch.

        Args:
            scenario: Gives the robot, the pedestrians' radius, the turn limit and the control time step.

        Returns:
            The same for all agents of an episode.
        """
        return cls(
            max_speed=scenario.robot.max_speed,
            max_yaw_rate=scenario.max_yaw_rate,
            wheel_radius=scenario.robot.wheel_radius,
            track=scenario.robot.track,
            control_timestep=scenario.control_timestep,
            contact_distance=scenario.contact_distance,
            agent_contact_distance=2.0 * scenario.robot.radius,
            motion=motion_of(scenario),
        )

    def wheel_speed(self, twist: Array) -> Array:
        """Clip twists to the limits and map them to the wheels.

        Args:
            twist: (forward speed [m/s], yaw rate [rad/s]), shape (n_agents, 2).

        Returns:
            (left, right) wheel speeds, shape (n_agents, 2) [rad/s].
        """
        twist = np.asarray(twist, dtype=float)
        low, high = (0.0, -self.max_yaw_rate), (self.max_speed, self.max_yaw_rate)
        return wheel_speed_of_twist(np.clip(twist, low, high), wheel_radius=self.wheel_radius, track=self.track)

    def twist_of_action(self, action: Array) -> Array:
        """The twist that a normalised action stands for.

        Args:
            action: (speed, turn) in [-1, 1], shape (n_agents, 2).

        Returns:
            Forward speed (speed + 1) / 2 of the limit [m/s] and turn times the limit of the yaw rate [rad/s].
        """
        return np.stack([0.5 * (action[:, 0] + 1.0) * self.max_speed, action[:, 1] * self.max_yaw_rate], axis=1)

    def action_of_twist(self, twist: Array) -> Array:
        """Inverse of `twist_of_action`.

        Args:
            twist: Shape (n_agents, 2) [m/s], [rad/s].

        Returns:
            (speed, turn), shape (n_agents, 2).
        """
        return np.stack([2.0 * twist[:, 0] / self.max_speed - 1.0, twist[:, 1] / self.max_yaw_rate], axis=1)

    def wheel_speed_of_action(self, action: Array, kind: ActionKind = "twist") -> Array:
        """The wheel speeds that a normalised action stands for, within the limits.

        Args:
            action: Numbers in [-1, 1], shape (n_agents, 2): (speed, turn) as in `twist_of_action`, or for "wheels" the
                left and right wheel's speed as a share of the fastest that a wheel can turn.
            kind: Which of the two.

        Returns:
            (left, right) wheel speeds, shape (n_agents, 2) [rad/s].

        Raises:
            ValueError: If there is no such kind.
        """
        if kind not in get_args(ActionKind):
            raise ValueError(f"action = {kind!r} is not allowed; allowed: {', '.join(get_args(ActionKind))}")
        action = np.asarray(action, dtype=float)
        if kind == "twist":
            return self.wheel_speed(self.twist_of_action(action))
        fastest = (self.max_speed + 0.5 * self.track * self.max_yaw_rate) / self.wheel_radius
        return self.wheel_speed(
            twist_of_wheel_speed(fastest * action, wheel_radius=self.wheel_radius, track=self.track)
        )


@runtime_checkable
class Controller(Protocol):
    """Anything with these three members can be evaluated.

    `reset` is called before each episode, `act` at each control step with the task's observation (see
    `socialnav_mj.observation`), for all slots at once; rows of inactive slots are ignored.
    """

    name: str

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Forget everything and take the limits of the episode to come."""

    def act(self, observation: Observation) -> Array:
        """Wheel speeds (left, right), shape (n_agents, 2) [rad/s]."""


def neighbours_of(controller: Controller) -> Neighbours | None:
    """Whom a controller asks to see.

    Args:
        controller: Its attribute `sees_nearest`, if it has one, is (k, radius): the k nearest within that radius.

    Returns:
        k and the radius [m]; None for everybody.

    Raises:
        ValueError: If it is something else.
    """
    match getattr(controller, "sees_nearest", None):
        case None:
            return None
        case (int(count), int(radius) | float(radius)) if count >= 1 and radius > 0.0:
            return count, float(radius)
        case other:
            raise ValueError(
                f"sees_nearest = {other!r} of controller {controller.name!r}; allowed: None, or (k, radius) with a "
                f"whole number k >= 1 and a radius > 0 [m]"
            )


class TwistController(ABC):
    """Base of controllers that think in twists: limits and wheel mapping are done here.

    Subclasses are frozen dataclasses in spirit: their fields are their configuration, plain JSON values or other
    controllers (`IS_CONTROLLER`), and travel in every episode. Those that switch between policies derive from
    `controllers.switching`.
    """

    name: str
    limits: Limits

    @property
    def policies(self) -> tuple[str, ...]:
        """Names of the policies it switches between."""
        return (self.name,)

    @property
    def active_policy(self) -> NDArray[np.int64] | None:
        """Index into `policies` of what chose each row of the last action, shape (n_agents,); None means 0."""
        return None

    @property
    def sees_nearest(self) -> Neighbours | None:
        """(k, radius [m]) if the k nearest within a radius are enough in a large crowd; None for everybody."""
        return None

    @property
    def scores(self) -> Array | None:
        """What each of `policies` would have cost at the last action, shape (n_agents, policies); None if unknown."""
        return None

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Take the limits of the episode to come.

        Args:
            limits: What the robots of that episode can do; kept as `limits`.
            seed: For controllers that draw random numbers.
        """
        self.limits = limits

    @abstractmethod
    def twist(self, observation: Observation) -> Array:
        """Desired twist of every agent, unclipped.

        Args:
            observation: Of all slots, with the keys and shapes of `socialnav_mj.observation`.

        Returns:
            (forward speed [m/s], yaw rate [rad/s]), shape (n_agents, 2); finite for finite observations.
        """

    def act(self, observation: Observation) -> Array:
        """Wheel speeds that drive the desired twists as far as the limits allow.

        Args:
            observation: Of all slots, with the keys and shapes of `socialnav_mj.observation`.

        Returns:
            (left, right), shape (n_agents, 2), within the limits [rad/s].
        """
        return self.limits.wheel_speed(self.twist(observation))
