"""What the scene means: who enters when, what an agent sees, what it gains, when its run ends."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from dm_control.suite import base
from dm_env import specs
from numpy.typing import NDArray

from socialnav_mj.cast import NOBODY, Cast, Replay, cast_recording
from socialnav_mj.config import Scenario
from socialnav_mj.episode import IntArray, Outcome, Partner
from socialnav_mj.geometry import Array, twist_of_wheel_speed, wheel_speed_of_twist
from socialnav_mj.observation import observe
from socialnav_mj.physics import Physics, Touch
from socialnav_mj.recordings import Recording

PROGRESS_REWARD = 1.0
"""Reward per metre that an agent came nearer to its goal [1/m]."""
ARRIVAL_REWARD = 5.0
"""Reward for coming within the goal radius."""
COLLISION_REWARD = -5.0
"""Reward for each new collision."""

_UNDER_WAY = -1


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Truth about every agent slot at one control step, before arrived agents leave."""

    agent: IntArray
    """(n_slots,) index of the agent that is there, -1 for nobody."""
    position: Array
    """(n_slots, 2) [m]."""
    heading: Array
    """(n_slots,) [rad]."""
    velocity: Array
    """(n_slots, 2) [m/s]."""
    yaw_rate: Array
    """(n_slots,) [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Collision:
    """A touch with the agents and the pedestrian behind the slots; indices into the task's cast."""

    touch: Touch
    agent: int
    partner: int


class CrowdTask(base.Task):
    """Robots start when and where recorded people appeared, and have to reach where those people went.

    The reward, one number a slot, is `PROGRESS_REWARD` for each metre of progress, `ARRIVAL_REWARD` at the goal and
    `COLLISION_REWARD` for each new collision, with a pedestrian or an agent alike.
    """

    def __init__(
        self, recording: Recording, scenario: Scenario, random: int | np.random.RandomState | None = None
    ) -> None:
        """Prepare the cast and the pedestrians' motion at every physics step.

        Args:
            recording: The crowd.
            scenario: Its draw, bodies, limits and rules.
            random: As in dm_control; nothing in an episode is random once the scenario is given.
        """
        super().__init__(random=random)
        self.recording = recording
        self.scenario = scenario
        self.cast: Cast = cast_recording(recording, scenario)
        self._replay = Replay(recording, scenario, self.cast)
        self._clear()

    def _clear(self) -> None:
        n, slots = self.cast.n_agents, self.cast.n_agent_slots
        self.step = 0
        self.outcome = np.full(n, _UNDER_WAY, dtype=np.int64)
        self.spawn_step = np.full(n, -1, dtype=np.int64)
        self.end_step = np.full(n, -1, dtype=np.int64)
        self.collisions: list[Collision] = []
        self._slot_agent = np.full(slots, NOBODY, dtype=np.int64)
        self._next_agent = 0
        self._order = np.argsort(self.cast.agent_appear_step, kind="stable")
        self._waiting: list[int] = []
        self._ghosts: set[int] = set()
        self._goal_distance = np.zeros(slots)
        self._reward = np.zeros(slots)
        self._sample = Sample(
            agent=self._slot_agent.copy(),
            position=np.zeros((slots, 2)),
            heading=np.zeros(slots),
            velocity=np.zeros((slots, 2)),
            yaw_rate=np.zeros(slots),
        )

    @property
    def time(self) -> float:
        """Time of the current control step since the recording's first frame [s]."""
        return self.step * self.scenario.control_timestep

    @property
    def sample(self) -> Sample:
        """Truth at the current control step, with the agents whose run ended at it."""
        return self._sample

    @property
    def slot_agent(self) -> IntArray:
        """Index of the agent under way in each slot, -1 for nobody, shape (n_slots,)."""
        return self._slot_agent.copy()

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """Wheel speeds (left, right) of every slot, shape (n_slots, 2) [rad/s].

        Args:
            physics: Not used; the limits are the scenario's.

        Returns:
            Bounds of a single wheel. The tendon actuators also hold forward speed and yaw rate within theirs.
        """
        robot, turn = self.scenario.robot, self.scenario.max_yaw_rate
        corners = wheel_speed_of_twist(
            [[0.0, turn], [robot.max_speed, turn]], wheel_radius=robot.wheel_radius, track=robot.track
        )
        shape = (self.cast.n_agent_slots, 2)
        return specs.BoundedArray(shape, float, minimum=corners.min(), maximum=corners.max(), name="wheel_speed")

    def reward_spec(self, physics: Physics) -> specs.Array:
        """One reward a slot.

        Args:
            physics: Not used.

        Returns:
            Shape (n_slots,).
        """
        return specs.Array((self.cast.n_agent_slots,), float, name="reward")

    def initialize_episode(self, physics: Physics) -> None:
        """Empty the scene and let the first people in.

        Args:
            physics: Inside its reset context.
        """
        self._clear()
        self._update_pedestrians(physics)
        self._spawn(physics)
        self._take_sample(physics)

    def before_step(self, action: Array, physics: Physics) -> None:
        """Turn wheel speeds into tendon commands and set people in motion.

        Args:
            action: Wheel speeds (left, right), shape (n_slots, 2) [rad/s]; rows of empty slots are ignored.
            physics: The physics.

        Raises:
            ValueError: If the shape is wrong or a row of an active slot is not finite.
        """
        action = np.asarray(action, dtype=float)
        shape = (self.cast.n_agent_slots, 2)
        if action.shape != shape:
            raise ValueError(f"action has shape {action.shape}; expected {shape} = (n_agents, (left, right))")
        active = self._slot_agent != NOBODY
        if not np.isfinite(action[active]).all():
            slot = int(np.flatnonzero(active & ~np.isfinite(action).all(axis=1))[0])
            raise ValueError(
                f"action[{slot}] = {action[slot]} of an active agent at {self.time:.2f} s; expected finite wheel speeds"
            )
        robot = self.scenario.robot
        twist = twist_of_wheel_speed(
            np.where(active[:, None], action, 0.0), wheel_radius=robot.wheel_radius, track=robot.track
        )
        physics.set_twist(twist)
        physics.set_pedestrian_path(*self._replay.motion(self.step))

    def after_step(self, physics: Physics) -> None:
        """Advance the clock; end runs, let people and agents in, and account for all of it.

        Args:
            physics: After the physics steps of a control step.
        """
        self.step += 1
        self._reward = np.zeros(self.cast.n_agent_slots)
        struck = self._note_collisions(physics)
        self._take_sample(physics)
        self._end_runs(physics, struck)
        self._update_pedestrians(physics)
        if self._spawn(physics):
            self._add_spawned(physics)
        physics.refresh_poses()

    def get_observation(self, physics: Physics) -> dict[str, NDArray[Any]]:
        """What every slot's agent sees; see `socialnav_mj.observation`.

        Args:
            physics: The physics.

        Returns:
            Arrays with a row a slot.
        """
        return self._observe(self._slot_agent)

    def final_observation(self) -> dict[str, NDArray[Any]]:
        """The observation with the agents whose run ended at this control step still in it, for whoever learns.

        Returns:
            As `get_observation`.
        """
        return self._observe(self._sample.agent)

    def _observe(self, agent: IntArray) -> dict[str, NDArray[Any]]:
        sample, people = self._sample, self._replay.crowd(self.step)
        return dict(
            observe(
                active=agent != NOBODY,
                person=self.cast.agent_person[agent],
                position=sample.position,
                heading=sample.heading,
                velocity=sample.velocity,
                yaw_rate=sample.yaw_rate,
                goal=self.cast.agent_goal[agent],
                pedestrian_position=people.position,
                pedestrian_velocity=people.velocity,
                pedestrian_slots=people.present,
            )
        )

    def get_reward(self, physics: Physics) -> Array:
        """Reward of every slot for the last control step.

        Args:
            physics: The physics.

        Returns:
            Shape (n_slots,); 0 for slots that were empty.
        """
        return self._reward.copy()

    def get_termination(self, physics: Physics) -> float | None:
        """The episode ends when every agent's run has ended.

        Args:
            physics: The physics.

        Returns:
            0.0 at the end, else None.
        """
        return 0.0 if np.all(self.outcome != _UNDER_WAY) else None

    # People

    def _update_pedestrians(self, physics: Physics) -> None:
        """Place people at the current step; whoever appears on a robot stays contact-free until clear of all robots."""
        now = self._replay.crowd(self.step)
        if now.changed.size:
            physics.park_pedestrians(now.changed)
            self._ghosts = self._ghosts - set(now.changed.tolist()) | (
                set(now.changed.tolist()) & set(now.present.tolist())
            )
        physics.set_pedestrian_pose(now.present, now.position[now.present], now.quaternion[now.present])
        if not self._ghosts:
            return
        pending = np.array(sorted(self._ghosts), dtype=np.int64)
        robots = physics.agent_position()[self._slot_agent != NOBODY]
        gap = np.linalg.norm(now.position[pending][:, None] - robots, axis=-1)
        clear = (gap > self.scenario.contact_distance).all(axis=1)
        physics.set_pedestrian_contacts(pending[clear], np.ones(int(clear.sum()), dtype=bool))
        self._ghosts = set(pending[~clear].tolist())

    # Agents

    def _take_sample(self, physics: Physics) -> None:
        self._sample = Sample(
            agent=self._slot_agent.copy(),
            position=physics.agent_position(),
            heading=physics.agent_heading(),
            velocity=physics.agent_velocity(),
            yaw_rate=physics.agent_yaw_rate(),
        )

    def _add_spawned(self, physics: Physics) -> None:
        """Let the sample hold the newly spawned beside those who just left; no slot can be both."""
        new = (self._slot_agent != NOBODY) & (self._sample.agent == NOBODY)
        self._sample.agent[new] = self._slot_agent[new]
        self._sample.position[new] = physics.agent_position()[new]
        self._sample.heading[new] = physics.agent_heading()[new]
        self._sample.velocity[new] = 0.0
        self._sample.yaw_rate[new] = 0.0

    def _spawn(self, physics: Physics) -> bool:
        """Let agents in whose person has appeared, in that order, where there is room; the others wait."""
        while self._next_agent < len(self._order):
            agent = int(self._order[self._next_agent])
            if self.cast.agent_appear_step[agent] > self.step:
                break
            self._waiting.append(agent)
            self._next_agent += 1
        # Slots that hold an agent in the sample are not free yet, even if its run has just ended.
        free = np.flatnonzero((self._slot_agent == NOBODY) & (self._sample.agent == NOBODY))
        still_waiting = []
        n_free = len(free)
        for agent in self._waiting:
            if not len(free) or not self._is_free(physics, self.cast.agent_start[agent]):
                still_waiting.append(agent)
                continue
            slot, free = int(free[0]), free[1:]
            physics.place_agent(slot, self.cast.agent_start[agent], float(self.cast.agent_heading[agent]))
            self._slot_agent[slot] = agent
            self.spawn_step[agent] = self.step
            self._goal_distance[slot] = np.linalg.norm(self.cast.agent_goal[agent] - self.cast.agent_start[agent])
        self._waiting = still_waiting
        return len(free) < n_free

    def _is_free(self, physics: Physics, place: Array) -> bool:
        scenario, clearance = self.scenario, self.scenario.spawn_clearance
        now = self._replay.crowd(self.step)
        people = now.position[now.present]
        robots = physics.agent_position()[self._slot_agent != NOBODY]
        return bool(
            (np.linalg.norm(people - place, axis=1) >= scenario.contact_distance + clearance).all()
            and (np.linalg.norm(robots - place, axis=1) >= 2.0 * scenario.robot.radius + clearance).all()
        )

    def _note_collisions(self, physics: Physics) -> list[int]:
        """Translate new touches from slots to people; agents struck in this step, by slot."""
        present = self._replay.crowd(self.step - 1).pedestrian
        struck: list[int] = []
        for touch in physics.new_touches():
            agent = int(self._slot_agent[touch.agent])
            struck.append(touch.agent)
            if touch.kind == Partner.AGENT:
                struck.append(touch.partner)
                partner = int(self._slot_agent[touch.partner])
            else:
                partner = int(present[touch.partner])
            self.collisions.append(Collision(touch=touch, agent=agent, partner=partner))
        for slot in struck:
            self._reward[slot] += COLLISION_REWARD
        return struck

    def _end_runs(self, physics: Physics, struck: list[int]) -> None:
        slots = np.flatnonzero(self._slot_agent != NOBODY)
        if not slots.size:
            return
        agents = self._slot_agent[slots]
        distance = np.linalg.norm(self.cast.agent_goal[agents] - self._sample.position[slots], axis=1)
        self._reward[slots] += PROGRESS_REWARD * (self._goal_distance[slots] - distance)
        self._goal_distance[slots] = distance
        arrived = distance <= self.scenario.goal_radius
        late = self.step - self.spawn_step[agents] >= self.cast.agent_allowed_steps[agents]
        taken_out = np.isin(slots, struck if self.scenario.on_collision == "retire" else [])
        self._reward[slots[arrived & ~taken_out]] += ARRIVAL_REWARD
        for row in np.flatnonzero(taken_out | arrived | late):
            slot, agent = int(slots[row]), int(agents[row])
            if taken_out[row]:
                self.outcome[agent] = Outcome.COLLIDED
            else:
                self.outcome[agent] = Outcome.ARRIVED if arrived[row] else Outcome.TIMED_OUT
            self.end_step[agent] = self.step
            self._slot_agent[slot] = NOBODY
            physics.park_agent(slot)
