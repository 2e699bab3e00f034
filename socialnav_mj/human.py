"""Episodes in which the replaced people take the place of the agents, on their own recorded tracks: the human row."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import Cast, cast_recording
from socialnav_mj.config import Scenario
from socialnav_mj.contact import FORCE_COLUMNS, Contact, contact_columns
from socialnav_mj.episode import Episode, IntArray, Outcome, Partner
from socialnav_mj.geometry import Array, wrap_angle
from socialnav_mj.parts import PART, Part, Parting
from socialnav_mj.provenance import episode_metadata, state_hash
from socialnav_mj.recorder import recorded_series
from socialnav_mj.recordings import Recording

HUMAN = "human"
_FASTEST_APPROACH = 8.0
"""No two people approach each other faster; bounds what one control step can hide [m/s]."""


def human_episode(recording: Recording, scenario: Scenario, *, scenario_name: str = "") -> Episode:
    """Record of the people whom the agents of a draw replace, on their own tracks, among the same pedestrians.

    They arrive by the agents' rule, within the goal radius of their end, but have no deadline. Two people touch when
    their centres are nearer than the sum of a robot's and a pedestrian's radius, so that the row says how the recorded
    crowd itself does at the collision distance of an agent and a pedestrian. As for robots, a pair that overlaps when
    one of them appears does not count until it has been apart.

    Args:
        recording: Its tracks are those of agents and pedestrians alike.
        scenario: Its draw, radii and time steps.
        scenario_name: Kept in the metadata.

    Returns:
        An episode without wheel speeds (NaN) and contact forces (NaN); policy 0 stands for the person itself.
    """
    (episode,) = human_episode_in_parts(recording, scenario, scenario_name=scenario_name)
    return episode


def human_episode_in_parts(
    recording: Recording, scenario: Scenario, *, seconds: float = inf, scenario_name: str = ""
) -> Iterator[Episode]:
    """The same in parts, see `socialnav_mj.parts`.

    Args:
        recording: As for `human_episode`.
        scenario: As for `human_episode`.
        seconds: Length of a part at least; by default there is one, without an end [s].
        scenario_name: As for `human_episode`.

    Yields:
        Records.
    """
    cast, dt = cast_recording(recording, scenario), scenario.control_timestep
    last = np.floor(recording.end_time[cast.agent_index] / dt + 1e-6).astype(np.int64)
    last = np.maximum(last, cast.agent_appear_step)
    final = int(max(last.max(), cast.pedestrian_last_step.max(initial=0)))
    end = np.array([_arrival(recording, scenario, cast, agent, int(last[agent])) for agent in range(cast.n_agents)])
    length = max(seconds / dt, 1.0)
    parting, step = Parting(cast, length=length), 0
    while True:
        step = int(min(step + np.ceil(length), final))
        if step == final or parting.is_due(step, end):
            part = parting.cut(step, spawn=cast.agent_appear_step, end=end, is_last=step == final)
            said = {} if seconds == inf else {PART: part.metadata(seconds, cast)}
            yield _episode(recording, scenario, cast, part, end, scenario_name, said)
        if step == final:
            return


def _arrival(recording: Recording, scenario: Scenario, cast: Cast, agent: int, last: int) -> int:
    """Control step at which a person is within the goal radius of its end."""
    steps = np.arange(cast.agent_appear_step[agent], last + 1)
    place, _, _ = recording.person(int(cast.agent_index[agent])).at(steps * scenario.control_timestep)
    near = np.linalg.norm(place - cast.agent_goal[agent], axis=-1) <= scenario.goal_radius
    near[-1] = True
    return int(steps[near.argmax()])


def _episode(
    recording: Recording,
    scenario: Scenario,
    cast: Cast,
    part: Part,
    end: IntArray,
    scenario_name: str,
    said: dict[str, Any],
) -> Episode:
    dt, agents, pedestrians = scenario.control_timestep, part.agents, part.pedestrians
    # Who is under way when the part ends is cut there.
    until, spans = np.minimum(end[agents], part.end), (part.begin, part.end + 1)
    appear = cast.agent_appear_step[agents]
    position, velocity, heading = recorded_series(recording, cast.agent_index[agents], appear, until, spans, dt)
    steps = np.arange(*spans)[:, None]
    there, speed, facing = recorded_series(
        recording,
        cast.pedestrian_index[pedestrians],
        cast.pedestrian_first_step[pedestrians],
        cast.pedestrian_last_step[pedestrians],
        spans,
        dt,
    )
    people = [
        *(
            _Person(int(cast.agent_index[i]), Partner.AGENT, k, int(cast.agent_appear_step[i]), int(end[i]))
            for k, i in enumerate(agents)
        ),
        *(
            _Person(
                int(cast.pedestrian_index[i]),
                Partner.PEDESTRIAN,
                k,
                int(cast.pedestrian_first_step[i]),
                int(cast.pedestrian_last_step[i]) + 1,
            )
            for k, i in enumerate(pedestrians)
        ),
    ]
    n = len(agents)
    contacts, ghosts = _contacts(recording, scenario, people, np.concatenate([position, there], axis=1))
    contacts = [one for one in contacts if (part.begin - 0.5) * dt <= one.time <= (part.end + 1) * dt]
    finished = end[agents] <= part.end
    return Episode(
        time=np.arange(*spans, dtype=float) * dt,
        agent_person=cast.agent_person[agents],
        agent_start=cast.agent_start[agents],
        agent_goal=cast.agent_goal[agents],
        agent_appear_time=appear.astype(float) * dt,
        agent_spawn_time=appear.astype(float) * dt,
        agent_deadline=np.full(n, np.nan),
        agent_end_time=until * dt,
        agent_outcome=np.where(finished, Outcome.ARRIVED, Outcome.UNFINISHED).astype(np.int64),
        agent_ghost_overlaps=np.bincount(ghosts, minlength=n).astype(np.int64),
        agent_position=position,
        agent_heading=heading,
        agent_velocity=velocity,
        agent_yaw_rate=np.where(np.isnan(heading), np.nan, _yaw_rate(heading, dt)),
        agent_tilt=np.where(np.isnan(heading), np.nan, 0.0),
        agent_wheel_speed=np.full((part.n_samples, n, 2), np.nan),
        agent_policy=np.where((steps >= appear) & (steps < until), 0, -1),
        pedestrian_person=cast.pedestrian_person[pedestrians],
        pedestrian_position=there,
        pedestrian_heading=facing,
        pedestrian_velocity=speed,
        **contact_columns(contacts),
        policies=(HUMAN,),
        metadata=episode_metadata(
            recording,
            scenario,
            controller=HUMAN,
            controller_config={},
            scenario_name=scenario_name,
            steps=part.end,
            state_hash=state_hash(position, velocity),
            **said,
        ),
    )


@dataclass(frozen=True)
class _Person:
    index: int
    """Into the recording."""
    kind: Partner
    row: int
    """Into the agents or the pedestrians."""
    first: int
    """Control step of appearance."""
    end: int
    """Control step of disappearance."""


def _yaw_rate(heading: Array, dt: float) -> Array:
    """Change of heading to the next sample, 0 at the last [rad/s]."""
    turned = wrap_angle(np.diff(heading, axis=0)) / dt
    return np.concatenate([np.nan_to_num(turned), np.zeros_like(heading[:1])])


def _contacts(
    recording: Recording, scenario: Scenario, people: list[_Person], position: Array
) -> tuple[list[Contact], list[int]]:
    """Touches as each agent among two people would have felt them, without forces; and agents on whom one appeared."""
    limit, dt, h = scenario.contact_distance, scenario.control_timestep, scenario.physics_timestep
    pairs = _close_pairs(position, limit + _FASTEST_APPROACH * dt)
    contacts: list[Contact] = []
    ghosts: list[int] = []
    for a, b in pairs:
        one, two = people[a], people[b]
        if one.kind == two.kind == Partner.PEDESTRIAN:
            continue
        first, end = max(one.first, two.first), min(one.end, two.end)
        times = np.arange(first * scenario.n_sub_steps, end * scenario.n_sub_steps) * h
        x, u, facing = recording.person(one.index).at(times)
        y, w, other_facing = recording.person(two.index).at(times)
        apart = np.linalg.norm(y - x, axis=1)
        for start, stop in _runs(apart <= limit, merge=round(scenario.contact_rearm_time / h)):
            if start == 0:
                if two.kind == Partner.PEDESTRIAN and two.first > one.first:
                    ghosts.append(one.row)
                continue
            normal = (y[start] - x[start]) / max(float(apart[start]), 1e-9)
            before = start - 1
            sides = [(one, two, normal, facing[before], u[before], w[before])]
            sides.append((two, one, -normal, other_facing[before], w[before], u[before]))
            contacts += [
                Contact(
                    time=float(times[start]),
                    agent=agent.row,
                    partner_kind=other.kind,
                    partner=other.row,
                    duration=(stop - start) * h,
                    position=0.5 * (x[start] + y[start]),
                    normal=direction,
                    agent_heading=float(heading),
                    agent_velocity=own_velocity,
                    partner_velocity=other_velocity,
                    **dict.fromkeys(FORCE_COLUMNS, np.nan),
                )
                for agent, other, direction, heading, own_velocity, other_velocity in sides
                if agent.kind == Partner.AGENT
            ]
    return contacts, ghosts


def _close_pairs(position: Array, distance: float) -> list[tuple[int, int]]:
    """Pairs of columns that are nearer than a distance at any sample."""
    pairs: set[tuple[int, int]] = set()
    for row in position:
        present = np.flatnonzero(~np.isnan(row[:, 0]))
        here = row[present]
        near = np.linalg.norm(here[:, None] - here, axis=-1) < distance
        i, j = np.nonzero(np.triu(near, 1))
        pairs.update(zip(present[i].tolist(), present[j].tolist(), strict=True))
    return sorted(pairs)


def _runs(touching: NDArray[np.bool_], *, merge: int) -> list[tuple[int, int]]:
    """Runs [start, stop) of True; runs less than `merge` samples apart are one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], touching, [False]]).astype(np.int8)))
    runs: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if runs and start - runs[-1][1] < merge:
            runs[-1] = (runs[-1][0], stop)
        else:
            runs.append((start, stop))
    return runs
