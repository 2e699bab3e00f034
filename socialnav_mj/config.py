"""Frozen configuration: the robot's dimensions and the scenario's numbers."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from math import ceil, isfinite, pi
from numbers import Integral, Real
from typing import Any, Literal, get_args

TurnLimit = Literal["per_step", "per_second"]
OnCollision = Literal["continue", "retire"]


def _require(condition: bool, name: str, given: object, allowed: str) -> None:
    if not condition:
        raise ValueError(f"{name} = {given!r} is not allowed; allowed: {allowed}")


def _require_number(given: Any, name: str, allowed: str, holds: Callable[[float], bool]) -> None:
    is_number = isinstance(given, Real) and not isinstance(given, bool) and isfinite(given)
    _require(is_number and holds(given), name, given, allowed)


@dataclass(frozen=True, kw_only=True)
class Robot:
    """Dimensions of a differential-drive robot; the MJCF file has to agree with them (checked at compile time)."""

    model: str = "robot.xml"
    """MJCF file, in the assets folder or an absolute path."""
    radius: float = 0.17
    """Radius of the bumper, the robot's footprint [m]."""
    wheel_radius: float = 0.06
    """[m]."""
    track: float = 0.24
    """Distance between the wheels' contact points [m]."""
    max_speed: float = 1.0
    """Largest forward speed; there is no reverse (paper section III-B) [m/s]."""

    def __post_init__(self) -> None:
        for name in ("radius", "wheel_radius", "track", "max_speed"):
            _require_number(getattr(self, name), f"Robot.{name}", "numbers > 0", lambda value: value > 0.0)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that decides what happens in an episode, apart from the recording and the controller."""

    share: float = 0.1
    """Share of the replaceable people who become agents, in (0, 1]."""
    seed: int = 0
    """Seed of the permutation of people (the draw)."""
    robot: Robot = field(default_factory=Robot)
    """The agents' bodies."""
    pedestrian_radius: float = 0.15
    """Radius of a replayed person's body [m]."""
    turn_limit: TurnLimit = "per_step"
    """Reading of the paper's [-pi/6, pi/6]: a turn per control step, or a yaw rate in rad/s."""
    on_collision: OnCollision = "continue"
    """What an agent does after a collision; its success is void either way."""
    control_timestep: float = 0.2
    """Time between two actions [s]."""
    physics_timestep: float = 0.01
    """Time between two MuJoCo steps [s]."""
    goal_radius: float = 0.5
    """An agent has arrived when its centre is this near its goal [m]."""
    deadline_base: float = 15.0
    """Time every agent has, counted from its real spawn [s]."""
    deadline_per_metre: float = 2.0
    """Additional time per metre between start and goal [s/m]."""
    minimum_displacement: float = 1.0
    """People whose end is nearer to their start than this are never replaced [m]."""
    spawn_clearance: float = 0.05
    """Free gap to every body that a spawning agent needs [m]."""
    contact_rearm_time: float = 0.2
    """Two bodies must have been apart this long before their next touch counts as a new collision [s]."""

    def __post_init__(self) -> None:
        _require_number(self.share, "share", "numbers in (0, 1]", lambda value: 0.0 < value <= 1.0)
        _require(
            isinstance(self.seed, Integral) and not isinstance(self.seed, bool) and self.seed >= 0,
            "seed",
            self.seed,
            "integers >= 0",
        )
        object.__setattr__(self, "seed", int(self.seed))  # numpy's integers are no JSON values
        _require(self.turn_limit in get_args(TurnLimit), "turn_limit", self.turn_limit, ", ".join(get_args(TurnLimit)))
        _require(
            self.on_collision in get_args(OnCollision),
            "on_collision",
            self.on_collision,
            ", ".join(get_args(OnCollision)),
        )
        for name in ("pedestrian_radius", "control_timestep", "physics_timestep", "goal_radius"):
            _require_number(getattr(self, name), name, "numbers > 0", lambda value: value > 0.0)
        for name in (
            "deadline_base",
            "deadline_per_metre",
            "minimum_displacement",
            "spawn_clearance",
            "contact_rearm_time",
        ):
            _require_number(getattr(self, name), name, "numbers >= 0", lambda value: value >= 0.0)
        _require(
            abs(self.control_timestep / self.physics_timestep - self.n_sub_steps) < 1e-6,
            "control_timestep",
            self.control_timestep,
            f"whole multiples of physics_timestep = {self.physics_timestep}",
        )

    @property
    def n_sub_steps(self) -> int:
        """Physics steps per control step."""
        return max(1, round(self.control_timestep / self.physics_timestep))

    @property
    def max_yaw_rate(self) -> float:
        """Largest yaw rate that the turn limit allows [rad/s]."""
        return pi / 6.0 / (self.control_timestep if self.turn_limit == "per_step" else 1.0)

    @property
    def contact_distance(self) -> float:
        """Sum of the robot's and the pedestrian's radius [m]."""
        return self.robot.radius + self.pedestrian_radius

    def allowed_steps(self, distance: float) -> int:
        """Control steps an agent has from its spawn to its deadline.

        Args:
            distance: Between start and goal [m].

        Returns:
            At least 1.
        """
        allowed = self.deadline_base + self.deadline_per_metre * distance
        return max(1, ceil(allowed / self.control_timestep - 1e-9))

    def changed(self, **changes: Any) -> "Scenario":
        """The scenario with other settings.

        Args:
            **changes: Values of `SETTINGS`: fields of `Scenario`, and those of its robot as robot_NAME.

        Returns:
            A new scenario.

        Raises:
            ValueError: If a setting is unknown, or a value is not allowed.
        """
        if unknown := sorted(set(changes) - set(SETTINGS)):
            raise ValueError(f"unknown settings {', '.join(unknown)}; available: {', '.join(SETTINGS)}")
        of_robot = {name: value for name, value in changes.items() if name.startswith(_ROBOT)}
        own = {name: value for name, value in changes.items() if name not in of_robot}
        robot = replace(self.robot, **{name.removeprefix(_ROBOT): value for name, value in of_robot.items()})
        return replace(self, robot=robot, **own)

    def as_dict(self) -> dict[str, Any]:
        """The resolved configuration as plain JSON values.

        Returns:
            A nested dictionary that `from_dict` reads back.
        """
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Scenario":
        """Inverse of `as_dict`.

        Args:
            values: As `as_dict` returns them.

        Returns:
            The scenario.
        """
        return cls(**{**values, "robot": Robot(**values["robot"])})


_ROBOT = "robot_"
SETTINGS = (
    *(setting.name for setting in fields(Scenario) if setting.name != "robot"),
    *(f"{_ROBOT}{setting.name}" for setting in fields(Robot)),
)
"""Names of everything that can be set of a scenario, here and on the command line."""
