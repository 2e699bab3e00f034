"""Demonstrations: the recorded people as they would have seen the scene from an agent's place."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.features import (
    COLLISION_FLAG,
    GOAL_FLAG,
    Continuous,
    FeatureSet,
    View,
    absorbing_state,
    running_state,
)
from socialnav_mj.geometry import Array, to_agent_frame, wrap_angle
from socialnav_mj.learning.mirror import Mirror
from socialnav_mj.recordings import Recording
from socialnav_mj.recordings.companions import companions

_ARMS_LENGTH = 1.5
"""Whoever is nearer counts for nearness and not for density [m]."""


@dataclass(frozen=True, kw_only=True)
class Demonstrations:
    """States of all experts, and where each of their runs was absorbed."""

    running: Array
    """(k, size + 2) states on the way."""
    absorbed: Array
    """(e, size + 2) the absorbing state at the end of each expert's run."""

    @classmethod
    def joined(cls, parts: list["Demonstrations"]) -> "Demonstrations":
        """Demonstrations of several recordings.

        Args:
            parts: At least one.

        Returns:
            All of them.
        """
        return cls(
            running=np.concatenate([part.running for part in parts]),
            absorbed=np.concatenate([part.absorbed for part in parts]),
        )


def demonstrate(
    recording: Recording,
    features: FeatureSet,
    scenario: Scenario,
    *,
    minimum_displacement: float,
    contact_distance: float,
    clearance: float,
    companions_seen: bool = False,
) -> Demonstrations:
    """States of everybody who goes somewhere.

    A person's companions (see `socialnav_mj.recordings.companions`) are not among those it sees unless asked for: it
    keeps near them on purpose. Runs end as an agent's: at the goal radius, or at the first contact with
    somebody who is no companion. Speeds are clipped to the robot's limits, so that the reward does not ask for
    what no robot can do.

    Args:
        recording: Whose people, if they move far enough, are the experts.
        features: Feature set.
        scenario: Gives the time step, limits, goal radius.
        minimum_displacement: Of an expert [m].
        contact_distance: Between the centres of two people who touch [m].
        clearance: States in which a stranger is nearer than this are left out [m].
        companions_seen: Whether an expert sees its companions too.

    Returns:
        The demonstrations.

    Raises:
        ValueError: If nobody moves that far, or nobody is ever that clear of strangers.
    """
    dt = scenario.control_timestep
    times = np.arange(int(recording.duration / dt + 1e-6) + 1) * dt
    crowd = recording.at(times)
    apart = np.ones((recording.n_people, recording.n_people), dtype=bool)
    np.fill_diagonal(apart, False)
    pairs = companions(recording)
    apart[pairs[:, 0], pairs[:, 1]] = apart[pairs[:, 1], pairs[:, 0]] = False
    expert = np.linalg.norm(recording.end - recording.start, axis=1) >= minimum_displacement
    if not expert.any():
        raise ValueError(f"nobody in recording {recording.name!r} moves {minimum_displacement} m; there is no expert")
    under_way = expert.copy()
    running, ends = [], []
    for k in range(len(times) - 1):
        here = np.flatnonzero(crowd.present[k])
        rows = np.flatnonzero(under_way & crowd.present[k] & crowd.present[k + 1])
        if not rows.size:
            continue
        nearest = _nearest_stranger(crowd.position[k], here, rows, apart)
        arrived = np.linalg.norm(recording.end[rows] - crowd.position[k, rows], axis=1) <= scenario.goal_radius
        ended = np.where(nearest <= contact_distance, COLLISION_FLAG, np.where(arrived, GOAL_FLAG, 0))
        ends += [absorbing_state(features.size, flag) for flag in ended[ended != 0]]
        under_way[rows[ended != 0]] = False
        rows = rows[(ended == 0) & (nearest >= clearance)]
        if rows.size:
            # As a robot's is measured: the turn of the step that led here.
            turn = np.nan_to_num(wrap_angle(crowd.heading[k, rows] - crowd.heading[max(k - 1, 0), rows])) / dt
            view = _view(
                recording, crowd.position[k], crowd.velocity[k], crowd.heading[k], turn, rows, here, apart, scenario
            )
            if companions_seen:
                others = here != rows[:, None]
                view = replace(view, present=others, companion=others & ~view.present)
            running.append(running_state(features(view)))
    if not running:
        raise ValueError(
            f"no expert of recording {recording.name!r} is ever {clearance} m clear of strangers; there is no state"
        )
    # Whoever was still under way left the scene at its goal.
    ends += [absorbing_state(features.size, GOAL_FLAG) for _ in range(int(under_way.sum()))]
    return Demonstrations(running=np.concatenate(running), absorbed=np.array(ends))


def _nearest_stranger(
    position: Array, here: NDArray[np.int64], rows: NDArray[np.int64], apart: NDArray[np.bool_]
) -> Array:
    """Distance of each expert to the nearest of those here who is no companion, infinite alone [m]."""
    gap = np.linalg.norm(position[here] - position[rows][:, None], axis=-1)
    return np.where(apart[np.ix_(rows, here)], gap, np.inf).min(axis=1)


def _view(
    recording: Recording,
    position: Array,
    velocity: Array,
    heading: Array,
    turn: Array,
    rows: NDArray[np.int64],
    here: NDArray[np.int64],
    apart: NDArray[np.bool_],
    scenario: Scenario,
) -> View:
    facing = heading[rows]
    limit = scenario.max_yaw_rate
    speed = np.clip(to_agent_frame(velocity[rows], facing)[:, 0], 0.0, scenario.robot.max_speed)
    own = np.zeros((len(rows), 1, 2))
    own[:, 0, 0] = speed
    return View(
        goal=to_agent_frame(recording.end[rows] - position[rows], facing),
        twist=np.stack([speed, np.clip(turn, -limit, limit)], axis=1),
        position=to_agent_frame(position[here] - position[rows][:, None], facing[:, None]),
        velocity=to_agent_frame(velocity[here][None], facing[:, None]) - own,
        present=apart[np.ix_(rows, here)],
    )


class ExpertSampler:
    """Batches of expert states for the reward step."""

    def __init__(self, experts: Demonstrations, features: FeatureSet) -> None:
        """Sort the states by how full the place is.

        Args:
            experts: At least one state of each kind.
            features: Of the states.
        """
        self._mirror = Mirror(features)
        self._running = experts.running.astype(np.float32)
        self._absorbed = experts.absorbed.astype(np.float32)
        occupied = occupied_sectors(self._running)
        of_each = [np.flatnonzero(occupied == count) for count in range(Continuous.n_sectors + 1)]
        filled = np.flatnonzero([len(rows) > 0 for rows in of_each])
        self._alike = [of_each[filled[np.abs(filled - count).argmin()]] for count in range(len(of_each))]
        """Number of occupied sectors: rows of the states that have as many, or as nearly as any."""

    def __call__(
        self, count: int, absorbing_share: float, random: np.random.Generator, like: NDArray[Any] | None = None
    ) -> NDArray[np.float32]:
        """Draw states, each mirrored with probability 1/2.

        Args:
            count: Number of states.
            absorbing_share: Share of them that is absorbing; they come first.
            random: Generator to draw with.
            like: States of the policy, shape (count, size), of which each running one has an expert's state at as many
                occupied sectors drawn for it; None for states drawn from all.

        Returns:
            Shape (count, size).
        """
        absorbed = round(count * absorbing_share)
        ends = self._absorbed[random.integers(len(self._absorbed), size=absorbed)]
        if like is None:
            rows = random.integers(len(self._running), size=count - absorbed)
        else:
            pools = [self._alike[number] for number in occupied_sectors(like[absorbed:])]
            shares = random.random(len(pools))
            rows = np.array([pool[int(x * len(pool))] for pool, x in zip(pools, shares, strict=True)], dtype=np.int64)
        return self._mirror(np.concatenate([ends, self._running[rows]]), random.random(count) < 0.5)


def occupied_sectors(state: NDArray[Any]) -> NDArray[np.int64]:
    """How full the place is beyond arm's length, whoever is near.

    Args:
        state: States of the set "continuous" or "companions", shape (n, size).

    Returns:
        Number of sectors whose nearest person is more than 1.5 m and at most 6 m away, shape (n,).
    """
    proximity = state[:, 6 : 6 + Continuous.n_sectors]
    return ((proximity > 0.0) & (proximity < np.exp(-0.5 * _ARMS_LENGTH))).sum(axis=1)
