"""Episodes in which the replaced people take the place of the agents, on their own recorded tracks: the human row."""

from collections import defaultdict
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
from socialnav_mj.parting import Part, Parting
from socialnav_mj.parts import PART
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
    """The same in parts, see `socialnav_mj.parting`.

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
    contacts, ghosts = _contacts(recording, scenario, people, np.concatenate([position, there], axis=1), part.begin)
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
    recording: Recording, scenario: Scenario, people: list[_Person], position: Array, begin: int
) -> tuple[list[Contact], list[int]]:
    """Touches as each agent among two people would have felt them, without forces; and agents on whom one appeared.

    Row 0 of `position` is control step `begin`.
    """
    limit, dt, h = scenario.contact_distance, scenario.control_timestep, scenario.physics_timestep
    contacts: list[Contact] = []
    ghosts: list[int] = []
    for (a, b), near in _close_pairs(position, limit + _FASTEST_APPROACH * dt).items():
        one, two = people[a], people[b]
        if one.kind == two.kind == Partner.PEDESTRIAN:
            continue
        first, end = max(one.first, two.first), min(one.end, two.end)
        times = np.arange(first * scenario.n_sub_steps, end * scenario.n_sub_steps, dtype=float) * h
        # Nobody touches between two control steps who is near at neither; what lies outside `position` is looked at
        # all the same, since a touch that is there at its ends may have begun outside.
        steps, rows = np.arange(first, end), begin + np.array(near)
        unknown = (steps < begin) | (steps >= begin + len(position) - 1)
        looked_at = np.flatnonzero(np.repeat(np.isin(steps, [rows - 1, rows]) | unknown, scenario.n_sub_steps))
        apart = _place(recording, two, times[looked_at]) - _place(recording, one, times[looked_at])
        touching = np.zeros(len(times), dtype=bool)
        touching[looked_at] = np.linalg.norm(apart, axis=1) <= limit
        for start, stop in _runs(touching, merge=round(scenario.contact_rearm_time / h)):
            if start == 0:
                if two.kind == Partner.PEDESTRIAN and two.first > one.first:
                    ghosts.append(one.row)
                continue
            around = times[start - 1 : start + 1]
            x, u, facing = recording.person(one.index).at(around)
            y, w, other_facing = recording.person(two.index).at(around)
            normal = (y[1] - x[1]) / max(float(np.linalg.norm(y[1:] - x[1:], axis=1)[0]), 1e-9)
            sides = [(one, two, normal, facing[0], u[0], w[0]), (two, one, -normal, other_facing[0], w[0], u[0])]
            contacts += [
                Contact(
                    time=float(times[start]),
                    agent=agent.row,
                    partner_kind=other.kind,
                    partner=other.row,
                    duration=(stop - start) * h,
                    position=0.5 * (x[1] + y[1]),
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


def _place(recording: Recording, person: _Person, times: Array) -> Array:
    return recording.curves.position_and_velocity(np.full(len(times), person.index), times)[0]


def _close_pairs(position: Array, distance: float) -> dict[tuple[int, int], list[int]]:
    """Pairs of columns that are nearer than a distance at any sample, ascending, and at which samples."""
    pairs: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    for k, row in enumerate(position):
        present = np.flatnonzero(~np.isnan(row[:, 0]))
        here = row[present]
        near = np.linalg.norm(here[:, None] - here, axis=-1) < distance
        i, j = np.nonzero(np.triu(near, 1))
        for pair in zip(present[i].tolist(), present[j].tolist(), strict=True):
            pairs[pair].append(k)
    return dict(sorted(pairs.items()))


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
