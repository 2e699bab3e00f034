"""The tables of forces in docs/metrics.md: a walker goes into a standing robot, from three sides at three speeds.

`python tests/forces.py` writes them. The robot stands with its brakes on; the walker keeps its speed for `DURATION`.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from socialnav_mj.config import Scenario
from socialnav_mj.contact import IMPACT_DURATION
from socialnav_mj.geometry import quaternion_of_yaw
from socialnav_mj.metrics.severity import LEG_STIFFNESS, ROBOT_MASS, reduced_mass
from socialnav_mj.physics import Physics
from socialnav_mj.report.markdown import table
from socialnav_mj.scene import build_model
from socialnav_mj.touch import Touch

PAGE = Path(__file__).resolve().parents[1] / "docs" / "metrics.md"
BEGIN, END = "<!-- Made by `python tests/forces.py`. -->\n", "<!-- End of what it makes. -->"
BEGIN_PEOPLE = "<!-- Made by `python tests/forces.py`: both kinds of people. -->\n"

BEGIN_DRIVE = "<!-- Made by `python tests/forces.py`: a robot that drives. -->\n"

SIDES = {"front": np.pi, "side": 0.5 * np.pi, "behind": 0.0}
"""Heading of the robot, towards which somebody walks along +x [rad]."""
SPEEDS = (0.5, 1.0, 1.5)
"""Of the walker [m/s]."""
WALKS = (-1.0, 0.0, 0.5, 0.8)
"""Of somebody ahead of a robot that drives at 1 m/s, along its way [m/s]."""
DURATION = 4.0
"""Of the walk, from 0.05 m before the touch on [s]."""
TYRE_FRICTION, GRAVITY = 0.8, 9.81
"""assets/robot.xml; arena.xml [m/s^2]."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A walker into a standing robot."""

    side: str
    speed: float
    """[m/s]"""
    touch: Touch
    """What the physics made of it."""
    moved: float
    """How far the robot was carried along [m]."""

    @property
    def impulse(self) -> float:
        """Over all of the contact [N s]."""
        return self.touch.impact_impulse + self.touch.push_impulse

    @property
    def peak_force(self) -> float:
        """Of all of the contact [N]."""
        return max(self.touch.impact_force, self.touch.push_force)

    @property
    def grip(self) -> float:
        """What the tyres hold against a push across the wheels, in the time of the impact at most [N s]."""
        across = abs(np.sin(SIDES[self.side]))
        return float(across * TYRE_FRICTION * ROBOT_MASS * GRAVITY * IMPACT_DURATION)

    @property
    def estimate(self) -> float:
        """Momentum that two free bodies exchange, and the tyres' grip [N s]."""
        # Whoever walks along +x strikes the robot at the opposite of its heading.
        bearing = np.pi - SIDES[self.side]
        return float(self.speed * reduced_mass(np.array([bearing]))[0]) + self.grip


def run(side: str, speed: float, *, physics_timestep: float = 0.01, pedestrian_body: str = "rigid") -> Case:
    """Walk into a robot that stands.

    Args:
        side: Of `SIDES`.
        speed: [m/s].
        physics_timestep: [s].
        pedestrian_body: Kind of the walker.

    Returns:
        The case with its only touch.
    """
    scenario = Scenario(physics_timestep=physics_timestep, pedestrian_body=pedestrian_body)
    bounds = {"low": np.full(2, -5.0), "high": np.full(2, 5.0)}
    physics = Physics.from_mujoco(build_model(scenario, n_agent_slots=1, n_pedestrian_slots=1, **bounds))
    with physics.reset_context():
        physics.place_agent(0, np.zeros(2), SIDES[side])
    physics.step(round(0.5 / physics_timestep))  # the wheels sink in
    start, walker = -(scenario.contact_distance + 0.05), np.array([0])
    steps = round(DURATION / physics_timestep)
    path = np.zeros((steps, 1, 2))
    path[:, 0, 0] = start + speed * physics_timestep * np.arange(steps)
    velocity = np.zeros_like(path)
    velocity[..., 0] = speed
    physics.set_pedestrian_pose(walker, path[0], quaternion_of_yaw(np.zeros(1)), velocity[0])
    physics.set_pedestrian_contacts(walker, np.ones(1, dtype=bool))
    physics.set_pedestrian_path(path, velocity)
    physics.step(steps)
    (touch,) = physics.new_touches()
    moved = float(np.linalg.norm(physics.agent_position()[0], axis=-1))
    return Case(side=side, speed=speed, touch=touch, moved=moved)


def cases(pedestrian_body: str = "rigid") -> list[Case]:
    """All sides and speeds."""
    return [run(side, speed, pedestrian_body=pedestrian_body) for side in SIDES for speed in SPEEDS]


def force_table() -> str:
    """The table of docs/metrics.md."""
    headings = ["from", "walker [m/s]", "whole contact: impulse [N s]", "peak [N]", "at [s]"]
    headings += ["impact: impulse [N s]", "estimate", "ratio", "largest force [N]", "push: time [s]", "impulse [N s]"]
    rows = [
        [
            case.side,
            f"{case.speed:.1f}",
            f"{case.impulse:.0f}",
            f"{case.peak_force:.0f}",
            f"{case.touch.peak_time:.2f}",
            f"{case.touch.impact_impulse:.1f}",
            f"{case.estimate:.1f}",
            f"{case.touch.impact_impulse / case.estimate:.2f}",
            f"{case.touch.impact_force:.0f}",
            f"{case.touch.push_duration:.1f}",
            f"{case.touch.push_impulse:.0f}",
        ]
        for case in cases()
    ]
    return "\n".join(table(headings, rows))


def drive(walk: float, *, pedestrian_body: str = "rigid") -> Touch:
    """Drive at 1 m/s into somebody ahead who walks along, stands, or comes.

    Args:
        walk: Velocity of the person along the robot's way [m/s].
        pedestrian_body: Its kind.

    Returns:
        The first touch.
    """
    scenario = Scenario(pedestrian_body=pedestrian_body)
    bounds = {"low": np.full(2, -5.0), "high": np.full(2, 5.0)}
    physics = Physics.from_mujoco(build_model(scenario, n_agent_slots=1, n_pedestrian_slots=1, **bounds))
    with physics.reset_context():
        physics.place_agent(0, np.zeros(2), 0.0)
    physics.set_twist(np.array([[1.0, 0.0]]))
    physics.step(150)
    start = physics.agent_position()[0, 0] + scenario.contact_distance + 0.05
    steps, walker = 200, np.array([0])
    path, velocity = np.zeros((steps, 1, 2)), np.zeros((steps, 1, 2))
    path[:, 0, 0], velocity[..., 0] = start + walk * 0.01 * np.arange(steps), walk
    physics.set_pedestrian_pose(walker, path[0], quaternion_of_yaw(np.zeros(1)), velocity[0])
    physics.set_pedestrian_contacts(walker, np.ones(1, dtype=bool))
    physics.set_pedestrian_path(path, velocity)
    physics.step(steps)
    return physics.new_touches()[0]


def flesh_of(touch: Touch) -> float:
    """What the closing speed of a touch along the wheels would make on flesh [N]."""
    speed = float((touch.agent_velocity - touch.partner_velocity)[0] * touch.normal[0])
    return speed * float(np.sqrt(reduced_mass(np.zeros(1))[0] * LEG_STIFFNESS))


def people_table() -> str:
    """The table of the two kinds of people in docs/metrics.md."""
    headings = ["from", "walker [m/s]", "impact: impulse [N s]", "largest force [N]", "push: mean force [N]"]
    headings += ["robot carried along [m]", "walker held back [m]"]
    rows = [
        [
            rigid.side,
            f"{rigid.speed:.1f}",
            *(f"{one} / {two}" for one, two in zip(_of_kind(rigid), _of_kind(compliant), strict=True)),
            f"{rigid.touch.held_back:.0f} / {compliant.touch.held_back:.3f}",
        ]
        for rigid, compliant in zip(cases(), cases("compliant"), strict=True)
        if rigid.side != "behind"
    ]
    return "\n".join(table(headings, rows))


def drive_table() -> str:
    """The table of a robot that drives in docs/metrics.md."""
    headings = ["person ahead, velocity [m/s]", "two bodies [N s]", "impact: impulse [N s]", "largest force [N]"]
    rows = []
    for walk in WALKS:
        rigid, compliant = drive(walk), drive(walk, pedestrian_body="compliant")
        momentum = flesh_of(rigid) * float(np.sqrt(reduced_mass(np.zeros(1))[0] / LEG_STIFFNESS))
        impulse, force = ([getattr(t, name) for t in (rigid, compliant)] for name in ("impact_impulse", "impact_force"))
        told = [f"{impulse[0]:.1f} / {impulse[1]:.1f}", f"{force[0]:.0f} / {force[1]:.0f}", f"{flesh_of(rigid):.0f}"]
        rows.append([f"{walk:.1f}", f"{momentum:.1f}", *told])
    return "\n".join(table([*headings, "flesh [N]"], rows))


def _of_kind(case: Case) -> list[str]:
    touch = case.touch
    mean = touch.push_impulse / touch.push_duration
    return [f"{touch.impact_impulse:.1f}", f"{touch.impact_force:.0f}", f"{mean:.0f}", f"{case.moved:.1f}"]


def with_table(page: str) -> str:
    """The page with the table of today between its marks."""
    for begin, content in ((BEGIN, force_table()), (BEGIN_PEOPLE, people_table()), (BEGIN_DRIVE, drive_table())):
        before, _, rest = page.partition(begin)
        page = f"{before}{begin}\n{content}\n{END}{rest.partition(END)[2]}"
    return page


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    sys.stdout.write(f"{force_table()}\n{people_table()}\n{drive_table()}")
