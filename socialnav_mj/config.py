"""Frozen configuration: the robot's dimensions and the scenario's numbers."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from math import ceil, isfinite, pi
from numbers import Integral, Real
from typing import Any, Literal, get_args

TurnLimit = Literal["per_step", "per_second"]
OnCollision = Literal["continue", "retire"]
Pedestrians = Literal["replay", "weak", "yielding"]
Plant = Literal["wheels", "unicycle"]
PedestrianBody = Literal["rigid", "compliant"]

SHARES = {"scenario_1": 0.1, "scenario_2": 0.3, "scenario_3": 0.7, "scenario_4": 0.9}
"""Share of the people who are replaced by robots (paper section IV)."""

ROBOT_RADII = (0.1, 0.4)
"""Least and largest radius of a robot's bumper. A sphere whose centre is 0.10 m high has to reach down to the floor;
a wide one tips on wheels that stand 0.12 m beside the middle: docs/metrics.md, "What the physics bears" [m]."""
PEDESTRIAN_RADII = (0.05, 0.4)
"""Least and largest radius of a person's body: thinner than a leg, or so wide that robots are thrown, as above [m]."""
FLOOR_FRICTIONS = (0.05, 1.5)
"""Least and largest friction of wheels on the floor: wet ice, and more than rubber has on any floor."""
MIN_CONTACT_DISTANCE = 0.25
"""Least sum of a robot's and a person's radius. A person at u sinks 0.105 s u + 0.02 m into a robot that stands, and is
through when that is the sum: at 2.2 m/s, faster than 99.6 % of recorded steps; at 0.15 m already at 1.3 m/s [m]."""
MAX_SPEED = 2.0
"""Beyond it the wheels lose their grip in a turn: at 3 m/s a commanded 2.6 rad/s becomes 7.3 [m/s]."""
MAX_YAW_RATE = 5.3
"""Beyond it a robot at 1 m/s slides out of its circle: 0.92 m/s are left at 5.2 rad/s, 0.80 at 6.5 [rad/s]."""
MAX_PHYSICS_TIMESTEP = 0.02
"""Half of the wheels' contact time constant of 0.04 s; from more MuJoCo softens contacts without a word [s]."""


def _require(condition: bool, name: str, given: object, allowed: str) -> None:
    if not condition:
        raise ValueError(f"{name} = {given!r} is not allowed; allowed: {allowed}")


def _require_number(given: Any, name: str, allowed: str, holds: Callable[[float], bool]) -> None:
    is_number = isinstance(given, Real) and not isinstance(given, bool) and isfinite(given)
    _require(is_number and holds(given), name, given, allowed)


def _require_within(given: Any, name: str, low: float, high: float) -> None:
    _require_number(given, name, f"numbers in [{low}, {high}]", lambda value: low <= value <= high)


@dataclass(frozen=True, kw_only=True)
class Robot:
    """Dimensions of a differential-drive robot; the MJCF file has to agree with them (checked at compile time)."""

    model: str = "robot.xml"
    """MJCF file, in the assets folder or an absolute path."""
    radius: float = 0.17
    """Radius of the bumper, the robot's footprint [m]."""
    wheel_radius: float = 0.06
    """Radius of the two driven wheels [m]."""
    track: float = 0.24
    """Distance between the wheels' contact points [m]."""
    max_speed: float = 1.0
    """Largest forward speed; there is no reverse (paper section III-B) [m/s]."""

    max_yaw_rate: float | None = None
    """Largest yaw rate of its own drive, besides the turn limit; by default only that counts [rad/s]."""

    def __post_init__(self) -> None:
        if self.max_yaw_rate is not None:
            _require_number(self.max_yaw_rate, "Robot.max_yaw_rate", "numbers > 0", lambda value: value > 0.0)
        for name in ("wheel_radius", "track"):
            _require_number(getattr(self, name), f"Robot.{name}", "numbers > 0", lambda value: value > 0.0)
        _require_within(self.radius, "Robot.radius", *ROBOT_RADII)
        _require_number(
            self.max_speed, "Robot.max_speed", f"numbers in (0, {MAX_SPEED}]", lambda value: 0.0 < value <= MAX_SPEED
        )


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that decides what happens in an episode, apart from the recording and the controller."""

    share: float = 0.1
    """Share of the replaceable people who become agents, in (0, 1]."""
    seed: int = 0
    """Seed of the permutation of people (the draw)."""
    robot: Robot = field(default_factory=Robot)
    """Body of every agent."""
    pedestrian_radius: float = 0.15
    """Radius of a replayed person's body [m]."""
    pedestrian_body: PedestrianBody = "rigid"
    """What a person's body is when it is touched: moved on whatever it meets, or 75 kg that push with a limited
    force."""
    pedestrians: Pedestrians = "replay"
    """What people do before they are touched: keep to the recorded track, or step off it for robots and come back,
    weakly or as walkers do for each other."""
    plant: Plant = "wheels"
    """What turns commands into motion: wheels with motors, mass and grip, or an ideal unicycle that follows exactly."""
    floor_friction: float | None = None
    """Friction of the wheels on the floor; None for what the robot's file says, 0.8 by default."""
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
        for name, choices in (
            ("pedestrian_body", get_args(PedestrianBody)),
            ("pedestrians", get_args(Pedestrians)),
            ("plant", get_args(Plant)),
            ("turn_limit", get_args(TurnLimit)),
            ("on_collision", get_args(OnCollision)),
        ):
            _require(getattr(self, name) in choices, name, getattr(self, name), ", ".join(choices))
        for name in ("control_timestep", "goal_radius"):
            _require_number(getattr(self, name), name, "numbers > 0", lambda value: value > 0.0)
        if self.floor_friction is not None:
            _require_within(self.floor_friction, "floor_friction", *FLOOR_FRICTIONS)
        _require_within(self.pedestrian_radius, "pedestrian_radius", *PEDESTRIAN_RADII)
        _require(
            self.contact_distance >= MIN_CONTACT_DISTANCE - 1e-9,
            "pedestrian_radius",
            self.pedestrian_radius,
            f"at least {MIN_CONTACT_DISTANCE - self.robot.radius:.3g} with Robot.radius = {self.robot.radius}, "
            "or people walk through robots",
        )
        _require_number(
            self.physics_timestep,
            "physics_timestep",
            f"numbers in (0, {MAX_PHYSICS_TIMESTEP}]",
            lambda value: 0.0 < value <= MAX_PHYSICS_TIMESTEP,
        )
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
        longest = 2.0 * self.goal_radius / self.robot.max_speed
        _require(
            self.control_timestep <= longest,
            "control_timestep",
            self.control_timestep,
            f"at most {longest:.3g} s, or a robot at {self.robot.max_speed} m/s could cross its goal between two",
        )
        _require(
            self.max_yaw_rate <= MAX_YAW_RATE,
            "control_timestep",
            self.control_timestep,
            f"at least {pi / 6.0 / MAX_YAW_RATE:.3g} with turn_limit = {self.turn_limit!r}, or a robot may turn at "
            f"{self.max_yaw_rate:.1f} rad/s",
        )

    @property
    def n_sub_steps(self) -> int:
        """Physics steps per control step."""
        return max(1, round(self.control_timestep / self.physics_timestep))

    @property
    def max_yaw_rate(self) -> float:
        """Largest yaw rate that the turn limit and the robot's drive allow [rad/s]."""
        limit = pi / 6.0 / (self.control_timestep if self.turn_limit == "per_step" else 1.0)
        return limit if self.robot.max_yaw_rate is None else min(limit, self.robot.max_yaw_rate)

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
            A nested dictionary that `from_dict` reads back. Settings that came later are left out at their defaults, so
            that episodes of before say the same.
        """
        values = asdict(self)
        for name in _LATER:
            if values[name] == getattr(Scenario, name):
                del values[name]
        return {_IN_FILES.get(name, name): value for name, value in values.items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Scenario":
        """Inverse of `as_dict`.

        Args:
            values: As `as_dict` returns them.

        Returns:
            The scenario.
        """
        names = {stored: name for name, stored in _IN_FILES.items()}
        own = {names.get(name, name): value for name, value in values.items()}
        return cls(**{**own, "robot": Robot(**own["robot"])})


_IN_FILES = {"pedestrian_body": "pedestrian"}
"""Settings that have another name in files."""
_LATER = ("pedestrians", "plant", "floor_friction")
_ROBOT = "robot_"
SETTINGS = (
    *(setting.name for setting in fields(Scenario) if setting.name != "robot"),
    *(f"{_ROBOT}{setting.name}" for setting in fields(Robot)),
)
"""Names of everything that can be set of a scenario, here and on the command line."""
