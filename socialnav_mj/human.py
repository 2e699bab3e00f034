"""Episodes in which the replaced people take the place of the agents, on their own recorded tracks: the human row."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import cast_recording
from socialnav_mj.config import Scenario
from socialnav_mj.contact import FORCE_COLUMNS, Contact, contact_columns
from socialnav_mj.episode import Episode, Outcome, Partner
from socialnav_mj.geometry import Array, wrap_angle
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
    cast = cast_recording(recording, scenario)
    dt = scenario.control_timestep
    last = np.floor(recording.end_time[cast.agent_index] / dt + 1e-6).astype(np.int64)
    last = np.maximum(last, cast.agent_appear_step)
    steps = int(max(last.max(), cast.pedestrian_last_step.max(initial=0))) + 1
    time = np.arange(steps, dtype=float) * dt
    position, velocity, heading = recorded_series(recording, cast.agent_index, cast.agent_appear_step, last, steps, dt)
    near = np.linalg.norm(position - cast.agent_goal, axis=-1) <= scenario.goal_radius
    near[last, np.arange(len(last))] = True
    end = near.argmax(axis=0)
    gone = np.arange(steps)[:, None] > end
    position[gone], velocity[gone], heading[gone] = np.nan, np.nan, np.nan
    under_way = (np.arange(steps)[:, None] >= cast.agent_appear_step) & (np.arange(steps)[:, None] < end)
    there, speed, facing = recorded_series(
        recording, cast.pedestrian_index, cast.pedestrian_first_step, cast.pedestrian_last_step, steps, dt
    )
    people = [
        *(
            _Person(int(i), Partner.AGENT, k, int(cast.agent_appear_step[k]), int(end[k]))
            for k, i in enumerate(cast.agent_index)
        ),
        *(
            _Person(
                int(i), Partner.PEDESTRIAN, k, int(cast.pedestrian_first_step[k]), int(cast.pedestrian_last_step[k]) + 1
            )
            for k, i in enumerate(cast.pedestrian_index)
        ),
    ]
    n = cast.n_agents
    contacts, ghosts = _contacts(recording, scenario, people, np.concatenate([position, there], axis=1))
    digest = state_hash(position, velocity)
    return Episode(
        time=time,
        agent_person=cast.agent_person.copy(),
        agent_start=cast.agent_start.copy(),
        agent_goal=cast.agent_goal.copy(),
        agent_appear_time=cast.agent_appear_step.astype(float) * dt,
        agent_spawn_time=cast.agent_appear_step.astype(float) * dt,
        agent_deadline=np.full(n, np.nan),
        agent_end_time=end * dt,
        agent_outcome=np.full(n, Outcome.ARRIVED, dtype=np.int64),
        agent_ghost_overlaps=np.bincount(ghosts, minlength=n).astype(np.int64),
        agent_position=position,
        agent_heading=heading,
        agent_velocity=velocity,
        agent_yaw_rate=np.where(np.isnan(heading), np.nan, _yaw_rate(heading, dt)),
        agent_tilt=np.where(np.isnan(heading), np.nan, 0.0),
        agent_wheel_speed=np.full((steps, n, 2), np.nan),
        agent_policy=np.where(under_way, 0, -1),
        pedestrian_person=cast.pedestrian_person.copy(),
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
            steps=steps - 1,
            state_hash=digest,
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
