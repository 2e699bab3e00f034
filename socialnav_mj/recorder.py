"""How an episode's record is filled: slot by slot during a rollout, and with what the recording says of its people."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import NOBODY, Cast
from socialnav_mj.contact import Contact, contact_columns
from socialnav_mj.episode import MAX_BYTES, Episode, EpisodeError, IntArray, Outcome, Partner
from socialnav_mj.geometry import Array
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
        self._samples: list[tuple[IntArray, Array, Array, Array, Array, Array]] = []
        self._actions: list[tuple[IntArray, Array, IntArray, Array | None]] = []
        self._people: list[tuple[IntArray, Array, Array]] = []

    def note_sample(self) -> None:
        """Keep the state of every agent under way, at the reset and after every control step.

        Raises:
            EpisodeError: If the record has grown larger than a file is allowed to be.
        """
        cast = self._task.cast
        size = (len(self._samples) + 1) * (_AGENT_BYTES * cast.n_agents + _PERSON_BYTES * cast.n_pedestrians)
        if size > MAX_BYTES:
            raise EpisodeError(
                f"at {self._task.time:.0f} s the record of {cast.n_agents} agents and {cast.n_pedestrians} people "
                f"takes {size} bytes; allowed: up to {MAX_BYTES}. Run the recording in parts, with --since and --until"
            )
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

    def episode(self, *, policies: tuple[str, ...], metadata: dict[str, Any]) -> Episode:
        """The record of all agents, those that never spawned included.

        Args:
            policies: Names that the noted indices stand for.
            metadata: Of the episode, see `provenance.episode_metadata`.

        Returns:
            With T = number of noted samples.
        """
        task, cast, dt = self._task, self._task.cast, self._task.scenario.control_timestep
        t, n = len(self._samples), cast.n_agents
        position, velocity = np.full((t, n, 2), np.nan), np.full((t, n, 2), np.nan)
        heading, yaw_rate, tilt = (np.full((t, n), np.nan) for _ in range(3))
        wheel_speed, policy = np.full((t, n, 2), np.nan), np.full((t, n), -1, dtype=np.int64)
        for k, (agent, *values) in enumerate(self._samples):
            position[k, agent], heading[k, agent], velocity[k, agent], yaw_rate[k, agent], tilt[k, agent] = values
        scored = any(scores is not None for *_, scores in self._actions)
        scores = np.full((t, n, len(policies)), np.nan, dtype=np.float32) if scored else None
        for k, (agent, action, chosen, own) in enumerate(self._actions):
            wheel_speed[k, agent], policy[k, agent] = action, chosen
            if scores is not None and own is not None:
                scores[k, agent] = own
        spawned = task.spawn_step >= 0
        end_step = np.where(task.end_step >= 0, task.end_step, t - 1)
        spawn_time = np.where(spawned, task.spawn_step * dt, np.nan)
        unfinished = np.where(spawned, Outcome.UNFINISHED, Outcome.NEVER_SPAWNED)
        time = np.arange(t, dtype=float) * dt
        return Episode(
            time=time,
            agent_person=cast.agent_person.copy(),
            agent_start=cast.agent_start.copy(),
            agent_goal=cast.agent_goal.copy(),
            agent_appear_time=cast.agent_appear_step.astype(float) * dt,
            agent_spawn_time=spawn_time,
            agent_deadline=spawn_time + cast.agent_allowed_steps * dt,
            agent_end_time=np.where(spawned, end_step * dt, np.nan),
            agent_outcome=np.where(task.outcome >= 0, task.outcome, unfinished).astype(np.int64),
            agent_ghost_overlaps=np.bincount([agent for agent, _ in sorted(task.ghosts.overlaps)], minlength=n).astype(
                np.int64
            ),
            agent_position=position,
            agent_heading=heading,
            agent_velocity=velocity,
            agent_yaw_rate=yaw_rate,
            agent_tilt=tilt,
            agent_wheel_speed=wheel_speed,
            agent_policy=policy,
            agent_scores=scores,
            **self._pedestrians(time),
            **self._contacts(),
            policies=policies,
            metadata=metadata,
        )

    def _pedestrians(self, time: Array) -> dict[str, NDArray[Any]]:
        """Motion of the people: the recording's, or what was noted of those who react or can be held back."""
        series = _pedestrian_series(self._task.recording, self._task.cast, time, self._task.scenario.control_timestep)
        recorded = series["pedestrian_position"].copy() if self._people else None
        for k, (pedestrian, position, velocity) in enumerate(self._people):
            series["pedestrian_position"][k, pedestrian] = position
            series["pedestrian_velocity"][k, pedestrian] = velocity
        if recorded is not None:
            series["pedestrian_deviation"] = series["pedestrian_position"] - recorded
        return series

    def _contacts(self) -> dict[str, NDArray[Any]]:
        """Columns of the contact log; a touch between two agents gives a row to each."""
        step = self._task.scenario.physics_timestep
        contacts = []
        for collision in self._task.collisions:
            touch = collision.touch
            contact = Contact(
                time=touch.time,
                agent=collision.agent,
                partner_kind=touch.kind,
                partner=collision.partner,
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


def _pedestrian_series(recording: Recording, cast: Cast, time: Array, dt: float) -> dict[str, NDArray[Any]]:
    position, velocity, heading = recorded_series(
        recording, cast.pedestrian_index, cast.pedestrian_first_step, cast.pedestrian_last_step, len(time), dt
    )
    return {
        "pedestrian_person": cast.pedestrian_person.copy(),
        "pedestrian_position": position,
        "pedestrian_velocity": velocity,
        "pedestrian_heading": heading,
    }


def recorded_series(
    recording: Recording,
    index: IntArray,
    first: IntArray,
    last: IntArray,
    steps: int,
    dt: float,
) -> tuple[Array, Array, Array]:
    """Recorded motion of some people at the control steps at which they are there.

    Args:
        recording: Whose tracks are evaluated.
        index: Indices into it, shape (k,).
        first: First control step of each, shape (k,).
        last: Last control step, included, shape (k,).
        steps: Number of control steps of the result.
        dt: Control time step [s].

    Returns:
        Position (steps, k, 2) [m], velocity (steps, k, 2) [m/s] and heading (steps, k) [rad]; NaN where absent.
    """
    position, heading = np.full((steps, len(index), 2), np.nan), np.full((steps, len(index)), np.nan)
    velocity = np.full_like(position, np.nan)
    for column, person in enumerate(index):
        rows = np.arange(first[column], min(last[column] + 1, steps))
        where, speed, facing = recording.person(int(person)).at(rows * dt)
        position[rows, column], velocity[rows, column], heading[rows, column] = where, speed, facing
    return position, velocity, heading
