"""Synthetic episodes for tests: tracks and touches given by hand, everything else derived from them."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode, Outcome, Partner
from socialnav_mj.geometry import Array, wheel_speed_of_twist


def line(start: ArrayLike, end: ArrayLike, n_steps: int) -> Array:
    """Straight track at constant speed.

    Args:
        start: (2,) first position [m].
        end: (2,) last position [m].
        n_steps: Control steps it takes; 0 gives one sample.

    Returns:
        Positions, shape (n_steps + 1, 2) [m].
    """
    share = np.linspace(0.0, 1.0, n_steps + 1)[:, None]
    return (1.0 - share) * np.asarray(start, dtype=float) + share * np.asarray(end, dtype=float)


@dataclass(frozen=True, kw_only=True)
class Agent:
    """One agent: where it was at every sample from its spawn to its end."""

    positions: ArrayLike
    """(k, 2), k >= 1 [m]; ignored for NEVER_SPAWNED except for its first row."""
    spawn_step: int = 0
    """Sample of the real spawn."""
    delay_steps: int = 0
    """Samples by which the spawn is later than the appearance."""
    outcome: Outcome = Outcome.ARRIVED
    """How it ended, at its last position."""
    goal: ArrayLike | None = None
    """(2,) [m]; its last position if not given."""
    person: int | None = None
    """Id; its index if not given."""
    ghosts: int = 0
    """People who appeared on it."""
    twist: ArrayLike | None = None
    """(k - 1, 2) commanded; what was driven if not given [m/s], [rad/s]."""
    policy: ArrayLike = 0
    """Index into the policies, one number or one for each of the k - 1 active samples."""


@dataclass(frozen=True, kw_only=True)
class Pedestrian:
    """One replayed person."""

    positions: ArrayLike
    """(k, 2), k >= 1 [m]."""
    first_step: int = 0
    """Sample of the first position."""
    deviation: ArrayLike = 0.0
    """From the recorded place, (k, 2) or one number [m]."""
    person: int | None = None
    """Id; 1000 + its index if not given."""


@dataclass(frozen=True, kw_only=True)
class Touch:
    """One contact; between two agents it makes the two rows by itself."""

    agent: int
    """Agent index."""
    partner: int
    """Index of the partner among its kind."""
    step: float
    """When it begins, in control steps since time 0; fractions allowed."""
    kind: Partner = Partner.PEDESTRIAN
    duration: float = 0.05
    """[s]."""
    impact_impulse: float = 1.0
    """[N s]."""
    impact_force: float = 20.0
    """[N]."""
    push_duration: float | None = None
    """[s]; the duration after the first 0.1 s if not given."""
    push_impulse: float = 0.0
    """[N s]."""
    push_force: float = 0.0
    """[N]."""
    peak_time: float = 0.03
    """[s]."""
    squeeze: float = 0.0
    """[N]."""
    held_back: float = 0.0
    """[m]."""


def build_episode(
    agents: Sequence[Agent],
    pedestrians: Sequence[Pedestrian] = (),
    touches: Sequence[Touch] = (),
    *,
    scenario: Scenario | None = None,
    controller: str = "straight",
    scenario_name: str = "scenario_1",
    draw: int = 0,
    policies: tuple[str, ...] | None = None,
    start_time: float = 0.0,
    n_samples: int | None = None,
    recording: dict[str, Any] | None = None,
) -> Episode:
    """Assemble an Episode; velocities are the forward differences of the tracks, headings point along them.

    Args:
        agents: At least none; ids must ascend.
        pedestrians: Ids must ascend.
        touches: In any order.
        scenario: Default `Scenario(seed=draw)`.
        controller: Name in the metadata.
        scenario_name: Name in the metadata.
        draw: Seed in the metadata.
        policies: Default (controller,).
        start_time: Time of sample 0 [s].
        n_samples: Length of the time axis; default just long enough.
        recording: Overrides of the recording's metadata.

    Returns:
        A valid Episode.
    """
    scenario = scenario or Scenario(seed=draw)
    step = scenario.control_timestep
    n = len(agents)
    tracks = [_track(a.positions) for a in agents]
    walks = [_track(p.positions) for p in pedestrians]
    spawned = np.array([a.outcome is not Outcome.NEVER_SPAWNED for a in agents], dtype=bool)
    first = np.array([a.spawn_step for a in agents], dtype=np.int64)
    last = np.array([a.spawn_step + len(track) - 1 for a, track in zip(agents, tracks, strict=True)], dtype=np.int64)
    ends = [*last[spawned], *(p.first_step + len(w) - 1 for p, w in zip(pedestrians, walks, strict=True))]
    t = n_samples or max((int(end) + 1 for end in ends), default=1)
    time = start_time + step * np.arange(t, dtype=np.float64)

    body = _samples([track if s else None for track, s in zip(tracks, spawned, strict=True)], first, t, step)
    wheel_speed = np.full((t, n, 2), np.nan)
    policy = np.full((t, n), -1, dtype=np.int64)
    twist = np.stack([np.hypot(*np.moveaxis(body["velocity"], -1, 0)), body["yaw_rate"]], axis=-1)
    for i in range(n):
        if not spawned[i]:
            continue
        active = slice(first[i], last[i])
        robot = scenario.robot
        commanded = agents[i].twist
        wheel_speed[active, i] = wheel_speed_of_twist(
            twist[active, i] if commanded is None else commanded, wheel_radius=robot.wheel_radius, track=robot.track
        )
        policy[active, i] = agents[i].policy
    tilt = np.where(np.isnan(body["heading"]), np.nan, 0.0)
    for i, agent in enumerate(agents):
        if agent.outcome is Outcome.OVERTURNED:
            tilt[last[i], i] = np.pi
    goal = np.array([tr[-1] if a.goal is None else a.goal for a, tr in zip(agents, tracks, strict=True)], dtype=float)
    start = np.array([track[0] for track in tracks], dtype=float)
    goal, start = goal.reshape(n, 2), start.reshape(n, 2)
    spawn_time = np.where(spawned, start_time + step * first, np.nan)
    allowed = np.array([step * scenario.allowed_steps(float(d)) for d in np.hypot(*(goal - start).T)], dtype=float)
    ids = [i if a.person is None else a.person for i, a in enumerate(agents)]
    crowd = _samples(walks, np.array([p.first_step for p in pedestrians], dtype=np.int64), t, step)
    anybody = any(np.any(person.deviation) for person in pedestrians)
    deviation = np.where(np.isnan(crowd["position"]), np.nan, 0.0)
    for j, (person, track) in enumerate(zip(pedestrians, walks, strict=True)):
        deviation[person.first_step : person.first_step + len(track), j] += person.deviation
    rows = _contacts(touches, body, crowd, start_time=start_time, step=step)
    policies = policies or (controller,)
    digest = hashlib.sha256()
    for array in (body["position"], crowd["position"], wheel_speed):
        digest.update(np.ascontiguousarray(array).tobytes())
    return Episode(
        time=time,
        agent_person=np.array(ids, dtype=np.int64),
        agent_start=start,
        agent_goal=goal,
        agent_appear_time=start_time + step * (first - np.array([a.delay_steps for a in agents], dtype=float)),
        agent_spawn_time=spawn_time,
        agent_deadline=spawn_time + allowed,
        agent_end_time=np.where(spawned, start_time + step * last, np.nan),
        agent_outcome=np.array([a.outcome for a in agents], dtype=np.int64),
        agent_ghost_overlaps=np.array([a.ghosts for a in agents], dtype=np.int64),
        **{f"agent_{name}": value for name, value in body.items()},
        agent_tilt=tilt,
        agent_wheel_speed=wheel_speed,
        agent_policy=policy,
        pedestrian_person=np.array(
            [1000 + j if p.person is None else p.person for j, p in enumerate(pedestrians)], dtype=np.int64
        ),
        **{f"pedestrian_{name}": value for name, value in crowd.items() if name != "yaw_rate"},
        pedestrian_deviation=deviation if anybody else None,
        **rows,
        policies=policies,
        metadata={
            "controller": controller,
            "controller_config": {"gain": 1.0},
            "scenario": scenario.as_dict(),
            "scenario_name": scenario_name,
            "draw": draw,
            "recording": {
                "name": "made_up",
                "variant": "by_hand",
                "checksum": "0" * 64,
                "frame_rate": 25.0,
                "reading": {},
            }
            | (recording or {}),
            "versions": {"socialnav_mj": "0.1.0", "mujoco": "3.17.0"},
            "state_hash": digest.hexdigest(),
        },
    )


def _track(positions: ArrayLike) -> Array:
    return np.asarray(positions, dtype=float).reshape(-1, 2)


def _samples(tracks: Sequence[Array | None], first: Any, t: int, step: float) -> dict[str, Any]:
    """Position, heading, velocity and yaw rate of tracks laid on the time axis, NaN where there is nobody."""
    n = len(tracks)
    position, velocity = np.full((t, n, 2), np.nan), np.full((t, n, 2), np.nan)
    heading, yaw_rate = np.full((t, n), np.nan), np.full((t, n), np.nan)
    for i, track in enumerate(tracks):
        if track is None:
            continue
        here = slice(first[i], first[i] + len(track))
        difference = np.diff(track, axis=0, append=track[-1:]) / step
        if len(track) > 1:
            difference[-1] = difference[-2]
        angle = np.unwrap(np.arctan2(difference[:, 1], difference[:, 0]))
        position[here, i], velocity[here, i], heading[here, i] = track, difference, angle
        yaw_rate[here, i] = np.diff(angle, append=angle[-1:]) / step
    return {"position": position, "heading": heading, "velocity": velocity, "yaw_rate": yaw_rate}


def _contacts(
    touches: Sequence[Touch], body: dict[str, Array], crowd: dict[str, Array], *, start_time: float, step: float
) -> dict[str, Any]:
    rows = []
    for touch in touches:
        at = int(touch.step)
        rows.append((touch, touch.agent, touch.partner, at))
        if touch.kind is Partner.AGENT:
            rows.append((touch, touch.partner, touch.agent, at))
    rows.sort(key=lambda row: (row[0].step, row[1], row[0].kind, row[2]))
    k = len(rows)
    other = [body if touch.kind is Partner.AGENT else crowd for touch, *_ in rows]
    own = np.array([body["position"][at, i] for _, i, _, at in rows], dtype=float).reshape(k, 2)
    theirs = np.array([o["position"][at, j] for o, (_, _, j, at) in zip(other, rows, strict=True)]).reshape(k, 2)
    gap = theirs - own
    distance = np.hypot(gap[:, 0], gap[:, 1])[:, None]
    normal = np.where(distance > 0.0, gap / np.where(distance > 0.0, distance, 1.0), [1.0, 0.0])
    return {
        "contact_agent": np.array([i for _, i, _, _ in rows], dtype=np.int64),
        "contact_partner_kind": np.array([touch.kind for touch, *_ in rows], dtype=np.int64),
        "contact_partner": np.array([j for _, _, j, _ in rows], dtype=np.int64),
        "contact_time": np.array([start_time + step * touch.step for touch, *_ in rows], dtype=float),
        "contact_duration": np.array([touch.duration for touch, *_ in rows], dtype=float),
        "contact_position": 0.5 * (own + theirs),
        "contact_normal": normal,
        "contact_agent_heading": np.array([body["heading"][at, i] for _, i, _, at in rows], dtype=float),
        "contact_agent_velocity": np.array([body["velocity"][at, i] for _, i, _, at in rows]).reshape(k, 2),
        "contact_partner_velocity": np.array(
            [o["velocity"][at, j] for o, (_, _, j, at) in zip(other, rows, strict=True)]
        ).reshape(k, 2),
        "contact_push_duration": np.array(
            [
                max(touch.duration - 0.1, 0.0) if touch.push_duration is None else touch.push_duration
                for touch, *_ in rows
            ],
            dtype=float,
        ),
        **{
            f"contact_{name}": np.array([getattr(touch, name) for touch, *_ in rows], dtype=float)
            for name in (
                "impact_impulse",
                "impact_force",
                "push_impulse",
                "push_force",
                "peak_time",
                "squeeze",
                "held_back",
            )
        },
    }
