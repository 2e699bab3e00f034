"""How an episode's record is filled: slot by slot during a rollout, and with what the recording says of its people."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import NOBODY
from socialnav_mj.contact import Contact, contact_columns
from socialnav_mj.episode import MAX_BYTES, Episode, EpisodeError, IntArray, Outcome, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.parting import NOT_YET, Part
from socialnav_mj.recordings import Recording
from socialnav_mj.task import CrowdTask

_AGENT_BYTES, _PERSON_BYTES = 80, 40
"""What a sample of an agent, and of a person, takes in the arrays of an episode, at least."""


class Recorder:
    """Gathers what happens, slot by slot, and turns it into the record of agents."""

    def __init__(self, task: CrowdTask) -> None:
        """Begin with nothing.

        Args:
            task: Is looked at whenever something is noted; it has to be reset before the first sample.
        """
        self._task = task
        self._first = 0  # control step of the first sample that is still needed
        self._samples: list[tuple[IntArray, Array, Array, Array, Array, Array]] = []
        self._actions: list[tuple[IntArray, Array, IntArray, Array | None]] = []
        self._people: list[tuple[IntArray, Array, Array]] = []

    def note_sample(self) -> None:
        """Keep the state of every agent under way, at the reset and after every control step.

        Raises:
            EpisodeError: If the record has grown larger than a file is allowed to be.
        """
        self._check_size()
        sample = self._task.sample
        slots = np.flatnonzero(sample.agent != NOBODY)
        self._samples.append(
            (
                sample.agent[slots],
                sample.position[slots],
                sample.heading[slots],
                sample.velocity[slots],
                sample.yaw_rate[slots],
                sample.tilt[slots],
            )
        )

        scenario = self._task.scenario
        if scenario.pedestrian_body == "compliant" or scenario.pedestrians != "replay":
            people = self._task.people
            there = people.present
            self._people.append((people.pedestrian[there], people.position[there], people.velocity[there]))

    def _check_size(self) -> None:
        task, cast = self._task, self._task.cast
        ended = (task.end_step != NOT_YET) & (task.end_step < self._first)
        n_agents = int(np.sum((task.spawn_step != NOT_YET) & ~ended))
        people = (cast.pedestrian_first_step <= task.step) & (cast.pedestrian_last_step >= self._first)
        n_people = int(np.sum(people))
        size = (len(self._samples) + 1) * (_AGENT_BYTES * n_agents + _PERSON_BYTES * n_people)
        if size > MAX_BYTES:
            raise EpisodeError(
                f"at {task.time:.0f} s the record of {n_agents} agents and {n_people} people takes {size} bytes; "
                f"allowed: up to {MAX_BYTES}. Have it written in shorter parts, with --part"
            )

    def note_action(self, agent: IntArray, action: Array, policy: IntArray, scores: Array | None = None) -> None:
        """Keep what was commanded between two samples.

        Args:
            agent: Index of the agent in each slot before the step, `NOBODY` for none, shape (n_slots,).
            action: Wheel speeds, shape (n_slots, 2) [rad/s].
            policy: Index of the policy that chose them, shape (n_slots,).
            scores: What each policy would have cost, shape (n_slots, policies), if the controller says so.
        """
        slots = np.flatnonzero(agent != NOBODY)
        self._actions.append((agent[slots], action[slots], policy[slots], None if scores is None else scores[slots]))

    def episode(self, part: Part, *, policies: tuple[str, ...], metadata: dict[str, Any]) -> Episode:
        """The record of a part of what was noted, or of all of it.

        Args:
            part: Which part; ends with the latest sample.
            policies: Names that the noted indices stand for.
            metadata: Of the episode, see `provenance.episode_metadata`.

        Returns:
            With a sample for every control step of the part. What no later part needs is forgotten.
        """
        task, cast, dt = self._task, self._task.cast, self._task.scenario.control_timestep
        chosen, begin = part.agents, part.begin - self._first
        t, n = part.n_samples, len(chosen)
        column = np.full(cast.n_agents, -1, dtype=np.int64)
        column[chosen] = np.arange(n)
        position, velocity = np.full((t, n, 2), np.nan), np.full((t, n, 2), np.nan)
        heading, yaw_rate, tilt = (np.full((t, n), np.nan) for _ in range(3))
        wheel_speed, policy = np.full((t, n, 2), np.nan), np.full((t, n), -1, dtype=np.int64)
        for k, (agent, *values) in enumerate(self._samples[begin:]):
            at = column[agent]
            position[k, at], heading[k, at], velocity[k, at], yaw_rate[k, at], tilt[k, at] = values
        scored = any(scores is not None for *_, scores in self._actions)
        scores = np.full((t, n, len(policies)), np.nan, dtype=np.float32) if scored else None
        for k, (agent, action, active, own) in enumerate(self._actions[begin:]):
            wheel_speed[k, column[agent]], policy[k, column[agent]] = action, active
            if scores is not None and own is not None:
                scores[k, column[agent]] = own
        spawn_step, end_step, outcome = task.spawn_step[chosen], task.end_step[chosen], task.outcome[chosen]
        spawned = spawn_step != NOT_YET
        end_step = np.where(end_step != NOT_YET, end_step, part.end)
        spawn_time = np.where(spawned, spawn_step * dt, np.nan)
        unfinished = np.where(spawned, Outcome.UNFINISHED, Outcome.NEVER_SPAWNED)
        ghosts = np.bincount([agent for agent, _ in sorted(task.ghosts.overlaps)], minlength=cast.n_agents)
        episode = Episode(
            time=np.arange(part.begin, part.end + 1, dtype=float) * dt,
            agent_person=cast.agent_person[chosen],
            agent_start=cast.agent_start[chosen],
            agent_goal=cast.agent_goal[chosen],
            agent_appear_time=cast.agent_appear_step[chosen].astype(float) * dt,
            agent_spawn_time=spawn_time,
            agent_deadline=spawn_time + cast.agent_allowed_steps[chosen] * dt,
            agent_end_time=np.where(spawned, end_step * dt, np.nan),
            agent_outcome=np.where(outcome >= 0, outcome, unfinished).astype(np.int64),
            agent_ghost_overlaps=ghosts[chosen].astype(np.int64),
            agent_position=position,
            agent_heading=heading,
            agent_velocity=velocity,
            agent_yaw_rate=yaw_rate,
            agent_tilt=tilt,
            agent_wheel_speed=wheel_speed,
            agent_policy=policy,
            agent_scores=scores,
            **self._pedestrians(part),
            **self._contacts(part, column),
            policies=policies,
            metadata=metadata,
        )
        self._forget()
        return episode

    def _forget(self) -> None:
        """Drop what was before the latest sample and before everybody who is under way came in."""
        task = self._task
        under_way = (task.spawn_step != NOT_YET) & (task.end_step == NOT_YET)
        first = int(task.spawn_step[under_way].min(initial=task.step))
        for noted in (self._samples, self._actions, self._people):
            del noted[: first - self._first]
        self._first = first
        task.forget_collisions(first)

    def _pedestrians(self, part: Part) -> dict[str, NDArray[Any]]:
        """Motion of the people: the recording's, or what was noted of those who react or can be held back."""
        cast, chosen = self._task.cast, part.pedestrians
        position, velocity, heading = recorded_series(
            self._task.recording,
            cast.pedestrian_index[chosen],
            cast.pedestrian_first_step[chosen],
            cast.pedestrian_last_step[chosen],
            (part.begin, part.end + 1),
            self._task.scenario.control_timestep,
        )
        series = {
            "pedestrian_person": cast.pedestrian_person[chosen],
            "pedestrian_position": position,
            "pedestrian_velocity": velocity,
            "pedestrian_heading": heading,
        }
        if self._people:
            recorded, column = position.copy(), np.full(cast.n_pedestrians, -1, dtype=np.int64)
            column[chosen] = np.arange(len(chosen))
            for k, (pedestrian, place, speed) in enumerate(self._people[part.begin - self._first :]):
                position[k, column[pedestrian]], velocity[k, column[pedestrian]] = place, speed
            series["pedestrian_deviation"] = position - recorded
        return series

    def _contacts(self, part: Part, column: IntArray) -> dict[str, NDArray[Any]]:
        """Columns of the contact log; a touch between two agents gives a row to each."""
        step = self._task.scenario.physics_timestep
        first = (part.begin - 0.5) * self._task.scenario.control_timestep
        walker = np.full(self._task.cast.n_pedestrians, -1, dtype=np.int64)
        walker[part.pedestrians] = np.arange(len(part.pedestrians))
        contacts = []
        for collision in self._task.collisions:
            touch = collision.touch
            agent = int(column[collision.agent])
            partner = int((column if touch.kind == Partner.AGENT else walker)[collision.partner])
            if touch.time < first or min(agent, partner) < 0:
                continue
            contact = Contact(
                time=touch.time,
                agent=agent,
                partner_kind=touch.kind,
                partner=partner,
                duration=touch.last_time - touch.time + step,
                position=touch.position,
                normal=touch.normal,
                agent_heading=touch.agent_heading,
                agent_velocity=touch.agent_velocity,
                partner_velocity=touch.partner_velocity,
                impact_impulse=touch.impact_impulse,
                impact_force=touch.impact_force,
                push_duration=touch.push_duration,
                push_impulse=touch.push_impulse,
                push_force=touch.push_force,
                peak_time=touch.peak_time,
                squeeze=touch.squeeze,
                held_back=touch.held_back,
            )
            contacts.append(contact)
            if touch.kind == Partner.AGENT:
                contacts.append(contact.seen_by_partner(touch.partner_heading))
        return contact_columns(contacts)


def recorded_series(
    recording: Recording,
    index: IntArray,
    first: IntArray,
    last: IntArray,
    steps: tuple[int, int],
    dt: float,
) -> tuple[Array, Array, Array]:
    """Recorded motion of some people at the control steps at which they are there.

    Args:
        recording: Whose tracks are evaluated.
        index: Indices into it, shape (k,).
        first: First control step of each, shape (k,).
        last: Last control step, included, shape (k,).
        steps: First control step of the result, and the one after its last.
        dt: Control time step [s].

    Returns:
        Position (t, k, 2) [m], velocity (t, k, 2) [m/s] and heading (t, k) [rad]; NaN where absent.
    """
    begin, end = steps
    position, heading = np.full((end - begin, len(index), 2), np.nan), np.full((end - begin, len(index)), np.nan)
    velocity = np.full_like(position, np.nan)
    for column, person in enumerate(index):
        there = np.arange(max(first[column], begin), min(last[column] + 1, end))
        where, speed, facing = recording.person(int(person)).at(there * dt)
        rows = there - begin
        position[rows, column], velocity[rows, column], heading[rows, column] = where, speed, facing
    return position, velocity, heading
