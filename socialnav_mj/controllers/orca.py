"""`orca`: optimal reciprocal collision avoidance (van den Berg et al. 2011, doi 10.1007/978-3-642-19457-3_1).

Written here, since the libraries share every avoidance in halves, and recorded people do none of it. For agents that
share it in halves it gives pyrvo's velocities (tests/test_orca.py).
"""

from dataclasses import dataclass
from math import hypot, inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.controllers.steering import goal_direction, twist_towards
from socialnav_mj.geometry import Array

_PARALLEL = 1e-9
"""Lines whose directions have a smaller cross product than this do not cross."""


class Line(NamedTuple):
    """Half-plane of permitted velocities: those to the left of a directed line."""

    x: float
    y: float
    """A point of the line [m/s]."""
    along_x: float
    along_y: float
    """Its direction, of length 1."""

    def lacks(self, vx: float, vy: float) -> float:
        """How far a velocity is on the forbidden side, negative on the permitted one [m/s]."""
        return self.along_x * (self.y - vy) - self.along_y * (self.x - vx)


def half_plane(
    position: tuple[float, float],
    velocity: tuple[float, float],
    own: tuple[float, float],
    *,
    distance: float,
    horizon: float,
    time_step: float,
    share: float,
) -> Line:
    """Velocities with which an agent does its share of avoiding another one.

    Args:
        position: From the agent to the other [m].
        velocity: The agent's minus the other's [m/s].
        own: The agent's velocity [m/s].
        distance: Between the centres, at which they touch [m].
        horizon: For how long no touch is wanted [s].
        time_step: Within which two who touch are to be apart [s].
        share: Of the change of velocity that the agent makes: 1/2 if the other does the same, 1 if it does nothing.

    Returns:
        The half-plane.
    """
    (px, py), (vx, vy) = position, velocity
    square = px * px + py * py
    apart = square > distance * distance
    time = horizon if apart else time_step
    wx, wy = vx - px / time, vy - py / time
    w_square, ahead = wx * wx + wy * wy, wx * px + wy * py
    if not apart or (ahead < 0.0 and ahead * ahead > distance * distance * w_square):
        # The front of the truncated cone, or two who touch: straight out of the circle.
        size = sqrt(w_square)
        ux, uy = (wx / size, wy / size) if size > 0.0 else (-1.0, 0.0)
        along = (uy, -ux)
        lack = distance / time - size
        change = (lack * ux, lack * uy)
    else:
        leg = sqrt(square - distance * distance)
        if px * wy - py * wx > 0.0:
            along = ((px * leg - py * distance) / square, (px * distance + py * leg) / square)
        else:
            along = (-(px * leg + py * distance) / square, -(-px * distance + py * leg) / square)
        slide = vx * along[0] + vy * along[1]
        change = (slide * along[0] - vx, slide * along[1] - vy)
    return Line(own[0] + share * change[0], own[1] + share * change[1], *along)


def permitted_velocity(lines: list[Line], wanted: tuple[float, float], max_speed: float) -> tuple[float, float]:
    """The velocity nearest to the wanted one that all lines permit; if there is none, the one they least forbid.

    Args:
        lines: Half-planes, the most important first.
        wanted: [m/s].
        max_speed: [m/s].

    Returns:
        Velocity of at most that speed [m/s].
    """
    velocity, failed = _nearest(lines, wanted, max_speed, far=False)
    if failed < len(lines):
        velocity = _least_forbidden(lines, failed, velocity, max_speed)
    return velocity


def _nearest(
    lines: list[Line], wanted: tuple[float, float], radius: float, *, far: bool
) -> tuple[tuple[float, float], int]:
    """Incremental linear programme; with far, as far along the wanted direction as possible.

    Returns:
        The velocity, and the number of lines that it keeps before one cannot be kept.
    """
    x, y = wanted
    size = hypot(x, y)
    if far:
        x, y = x * radius, y * radius
    elif size > radius:
        x, y = x / size * radius, y / size * radius
    for number, line in enumerate(lines):
        if line.lacks(x, y) > 0.0:
            found = _on_line(lines, number, wanted, radius, far=far)
            if found is None:
                return (x, y), number
            x, y = found
    return (x, y), len(lines)


def _on_line(
    lines: list[Line], number: int, wanted: tuple[float, float], radius: float, *, far: bool
) -> tuple[float, float] | None:
    """Best velocity on one line within the circle and the lines before it; None if there is none."""
    line = lines[number]
    middle = line.x * line.along_x + line.y * line.along_y
    room = middle * middle + radius * radius - line.x * line.x - line.y * line.y
    if room < 0.0:
        return None
    low, high = -middle - sqrt(room), -middle + sqrt(room)
    for other in lines[:number]:
        cross = line.along_x * other.along_y - line.along_y * other.along_x
        offset = other.along_x * (line.y - other.y) - other.along_y * (line.x - other.x)
        if abs(cross) <= _PARALLEL:
            if offset < 0.0:
                return None
            continue
        at = offset / cross
        low, high = (low, min(high, at)) if cross >= 0.0 else (max(low, at), high)
        if low > high:
            return None
    if far:
        at = high if wanted[0] * line.along_x + wanted[1] * line.along_y > 0.0 else low
    else:
        at = line.along_x * (wanted[0] - line.x) + line.along_y * (wanted[1] - line.y)
        at = min(max(at, low), high)
    return line.x + at * line.along_x, line.y + at * line.along_y


def _least_forbidden(
    lines: list[Line], begin: int, velocity: tuple[float, float], radius: float
) -> tuple[float, float]:
    """The velocity whose worst violation is least: a linear programme in three dimensions."""
    worst = 0.0
    for number in range(begin, len(lines)):
        line = lines[number]
        if line.lacks(*velocity) <= worst:
            continue
        bisectors = []
        for other in lines[:number]:
            cross = line.along_x * other.along_y - line.along_y * other.along_x
            if abs(cross) <= _PARALLEL:
                if line.along_x * other.along_x + line.along_y * other.along_y > 0.0:
                    continue
                x, y = 0.5 * (line.x + other.x), 0.5 * (line.y + other.y)
            else:
                at = (other.along_x * (line.y - other.y) - other.along_y * (line.x - other.x)) / cross
                x, y = line.x + at * line.along_x, line.y + at * line.along_y
            dx, dy = other.along_x - line.along_x, other.along_y - line.along_y
            size = hypot(dx, dy)
            bisectors.append(Line(x, y, dx / size, dy / size))
        found, kept = _nearest(bisectors, (-line.along_y, line.along_x), radius, far=True)
        if kept == len(bisectors):
            velocity = found
        worst = line.lacks(*velocity)
    return velocity


@dataclass(kw_only=True)
class ORCA(TwistController):
    """Drives towards the permitted velocity nearest to full speed at the goal.

    A velocity is turned to within a control step and driven as far as it lies ahead (`steering.twist_towards`); the
    margin makes up for the time that takes. Only the nearest others count.
    """

    horizon: float = 2.0
    """For how long no touch is wanted, > 0 [s]."""
    margin: float = 0.2
    """Added to the distance at which bodies touch, >= 0 [m]."""
    agent_share: float = 0.5
    """Of avoiding another agent, in [0, 1]: agents do this alike."""
    pedestrian_share: float = 1.0
    """Of avoiding a person, in [0, 1]: recorded people do nothing."""
    neighbours: int = 10
    """How many others count at most, >= 1."""
    sight: float = 6.0
    """Who is farther away does not count, > 0 [m]."""
    name: str = "orca"

    def __post_init__(self) -> None:
        for name, low, high in (
            ("horizon", 1e-3, inf),
            ("margin", 0.0, inf),
            ("agent_share", 0.0, 1.0),
            ("pedestrian_share", 0.0, 1.0),
            ("neighbours", 1, inf),
            ("sight", 1e-3, inf),
        ):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and isfinite(value) and low <= value <= high):
                allowed = f"numbers in [{low:g}, {high:g}]" if high < inf else f"numbers >= {low:g}"
                raise ValueError(f"{name} = {value!r} is not allowed; allowed: {allowed}")

    def twist(self, observation: Observation) -> Array:
        """Speed and yaw rate towards each agent's permitted velocity.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        wanted = self.limits.max_speed * goal_direction(observation["goal"])
        velocity = np.zeros((len(observation["active"]), 2))
        for row in rows:
            lines = self._lines(observation, int(row))
            velocity[row] = permitted_velocity(lines, (wanted[row, 0], wanted[row, 1]), self.limits.max_speed)
        return twist_towards(velocity, self.limits) * observation["active"][:, None]

    def _lines(self, observation: Observation, row: int) -> list[Line]:
        own = (float(observation["twist"][row, 0]), 0.0)
        found = []
        for kind, contact, share in (
            ("pedestrian", self.limits.contact_distance, self.pedestrian_share),
            ("agent", self.limits.agent_contact_distance, self.agent_share),
        ):
            place, speed = observation[f"{kind}_position"][row], observation[f"{kind}_velocity"][row]
            gap = np.hypot(place[:, 0], place[:, 1])
            for other in np.flatnonzero(observation[f"{kind}_mask"][row] & (gap < self.sight)):
                (px, py), (vx, vy) = place[other].tolist(), speed[other].tolist()
                line = half_plane(
                    (px, py),
                    (own[0] - vx, own[1] - vy),
                    own,
                    distance=contact + self.margin,
                    horizon=self.horizon,
                    time_step=self.limits.control_timestep,
                    share=share,
                )
                found.append((float(gap[other]), line))
        return [line for _, line in sorted(found)[: int(self.neighbours)]]
