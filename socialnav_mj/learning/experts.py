"""Demonstrations: the recorded people as they would have seen the scene from an agent's place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.features import COLLISION_FLAG, GOAL_FLAG, FeatureSet, View, absorbing_state, running_state
from socialnav_mj.geometry import Array, to_agent_frame, wrap_angle
from socialnav_mj.recordings import Recording
from socialnav_mj.recordings.companions import companions


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
) -> Demonstrations:
    """States of everybody who goes somewhere.

    A person's companions (see `socialnav_mj.recordings.companions`) are not among those it sees: it keeps near them on
    purpose. Runs end as an agent's: at the goal radius, or at the first contact with
    somebody who is no companion. Speeds are clipped to the robot's limits, so that the reward does not ask for
    what no robot can do.

    Args:
        recording: Whose people, if they move far enough, are the experts.
        features: Feature set.
        scenario: Gives the time step, limits, goal radius.
        minimum_displacement: Of an expert [m].
        contact_distance: Between the centres of two people who touch [m].
        clearance: States in which somebody is nearer than this are left out [m].

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
