"""`dynamic_window`: Fox, Burgard and Thrun 1997 (doi 10.1109/100.580977), with clearance from where others will be."""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from socialnav_mj.controllers.base import Limits, Observation, TwistController
from socialnav_mj.controllers.planning.foresight import Foresight
from socialnav_mj.controllers.prediction import STEP, Prediction, load_prediction
from socialnav_mj.elementary import arctan2, cos, sin
from socialnav_mj.geometry import Array, wrap_angle

STEPS = 12
"""Of a candidate's arc, of `prediction.STEP` each: 2.4 s."""
SPEEDS = 5
"""Forward speeds of the window."""
TURNS = 17
"""Yaw rates of the window."""
_AIM = 1
"""Step at whose end the heading is judged: when the robot has turned and could have stopped."""


def arcs(speed: Array, yaw_rate: Array, *, steps: int) -> tuple[Array, Array]:
    """Places along circular arcs from the origin, heading along x.

    Args:
        speed: Shape (...,) [m/s].
        yaw_rate: A shape that broadcasts with that of the speeds; sines and cosines are taken of these alone [rad/s].
        steps: How many steps of `prediction.STEP`.

    Returns:
        Places at the end of each step, shape (..., steps, 2) of both broadcast [m], and headings there, shape
        (..., steps) of the yaw rates [rad].
    """
    time = STEP * np.arange(1, steps + 1)
    heading = yaw_rate[..., None] * time
    half = 0.5 * heading
    # The chord of an arc: its length times sin(x) / x, along half the turn.
    bend = np.where(np.abs(half) > 1e-6, sin(half) / np.where(half == 0.0, 1.0, half), 1.0)
    length = speed[..., None] * time * bend
    return np.stack([length * cos(half), length * sin(half)], axis=-1), heading


@dataclass(kw_only=True)
class DynamicWindow(TwistController):
    """Takes the twist that can be reached and scores best: heading to the goal, clearance, speed.

    Candidates are those speeds and yaw rates that the motors reach within a control step. One is admissible if the
    robot can stop before it comes within the margin of where somebody will then be; if none is, it brakes and takes
    the yaw rate with most clearance.
    """

    heading_weight: float = 0.8
    """Of 1 - |angle to the goal| / pi at the arc's end, >= 0."""
    clearance_weight: float = 1.0
    """Of the time until somebody is within the margin, as a share of the horizon, >= 0."""
    speed_weight: float = 0.4
    """Of the speed, as a share of the largest, >= 0."""
    margin: float = 0.15
    """Between bodies; who will be nearer is in the way, >= 0 [m]."""
    prediction: str = "linear"
    """As `prediction.load_prediction` takes it."""
    name: str = "dynamic_window"
    _prediction: Prediction = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("heading_weight", "clearance_weight", "speed_weight", "margin"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} = {value!r} is not allowed; allowed: numbers >= 0")
        self._prediction = load_prediction(self.prediction, steps=STEPS)

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Forget everybody and take the limits of the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Not used.
        """
        super().reset(limits, seed=seed)
        self._foresight = Foresight(self._prediction, limits, steps=STEPS)

    def twist(self, observation: Observation) -> Array:
        """Best admissible candidate of each agent.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses all of them.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        result = np.zeros((len(observation["active"]), 2))
        ahead = self._foresight.look(observation)
        if not rows.size:
            return result
        speed, turn = self._speeds(observation["twist"][rows, 0]), self._turns(observation["twist"][rows, 1])
        place, heading = arcs(speed[:, :, None], turn, steps=STEPS)
        # One axis of candidates from those of speeds and turns.
        place, candidates = place.reshape(len(rows), -1, STEPS, 2), (len(rows), SPEEDS, TURNS)
        speed = np.broadcast_to(speed[:, :, None], candidates).reshape(len(rows), -1)
        turn, heading = (np.broadcast_to(of, candidates).reshape(len(rows), -1) for of in (turn, heading[..., _AIM]))
        contact = np.where(ahead.person, self.limits.contact_distance, self.limits.agent_contact_distance)
        free = _free_time(place, ahead.path, np.where(ahead.real, contact + self.margin, -1.0))
        to_goal = observation["goal"][rows][:, None] - place[:, :, _AIM]
        off = wrap_angle(arctan2(to_goal[..., 1], to_goal[..., 0]) - heading)
        score = (
            self.heading_weight * (1.0 - np.abs(off) / np.pi)
            + self.clearance_weight * free / (STEP * STEPS)
            + self.speed_weight * speed / self.limits.max_speed
        )
        # v <= sqrt(2 a distance), the distance being what is driven until somebody is in the way (Fox et al., eq 14).
        admissible = speed <= 2.0 * self.limits.motion.acceleration * free
        stuck = ~admissible.any(axis=1)
        best = np.where(stuck, free.argmax(axis=1), np.where(admissible, score, -np.inf).argmax(axis=1))
        every = np.arange(len(rows))
        result[rows, 0] = np.where(stuck, 0.0, speed[every, best])
        result[rows, 1] = turn[every, best]
        return result

    def _speeds(self, speed: Array) -> Array:
        """Forward speeds that can be reached within a control step, (n, SPEEDS)."""
        change = self.limits.motion.acceleration * self.limits.control_timestep
        low, high = np.maximum(speed - change, 0.0), np.minimum(speed + change, self.limits.max_speed)
        low = np.minimum(low, self.limits.max_speed)
        share = np.arange(SPEEDS) / (SPEEDS - 1)
        speeds: Array = low[:, None] + share * np.maximum(high - low, 0.0)[:, None]
        return speeds[:, ::-1]

    def _turns(self, yaw_rate: Array) -> Array:
        """Yaw rates that can be, (1, 1, TURNS) if any can, else (n, 1, TURNS)."""
        # Straight ahead first, or as now, so that it is taken of equals.
        share = np.arange(TURNS // 2 + 1) / (TURNS // 2)
        share = np.stack([share, -share], axis=1).ravel()[1:]
        limit, reach = self.limits.max_yaw_rate, self.limits.motion.yaw_change
        if reach >= 2.0 * limit:
            return limit * share[None, None]
        # The motors change the yaw rate by that much in a step of the prediction.
        reach = reach * self.limits.control_timestep / STEP
        turns: Array = np.clip(np.clip(yaw_rate, -limit, limit)[:, None] + reach * share, -limit, limit)
        return turns[:, None]


def _free_time(place: Array, path: Array, distance: Array) -> Array:
    """Time until somebody is nearer than a distance, or the horizon.

    Args:
        place: Of candidates at the end of each step, (n, c, steps, 2) [m].
        path: Of others now and at the end of each step, (n, steps + 1, k, 2) [m].
        distance: (n, k), negative where there is nobody [m].

    Returns:
        (n, c) [s]; 0 if somebody is too near at the end of the first step already.
    """
    away = np.hypot(path[..., 0], path[..., 1])
    # Whoever is too near now may be left: until then its distance only has to grow.
    distance = np.minimum(distance, away[:, 0])
    time = np.full(place.shape[:2], STEP * STEPS)
    # Only who can be met at the end of a step is looked at: how far the farthest candidate gets, and some rounding.
    reach = np.hypot(place[..., 0], place[..., 1]).max(axis=1)
    agent, step, other = np.nonzero(away[:, 1:] < distance[:, None] + reach[..., None] + 1e-9)
    if not agent.size:
        return time
    gap = place[agent, :, step] - path[agent, step + 1, other][:, None]
    near = np.hypot(gap[..., 0], gap[..., 1]) < distance[agent, other][:, None]
    first = np.flatnonzero(np.diff(agent, prepend=-1))
    time[agent[first]] = np.minimum.reduceat(np.where(near, (STEP * step)[:, None], STEP * STEPS), first, axis=0)
    return time
