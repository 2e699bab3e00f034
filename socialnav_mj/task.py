"""What the scene means: who enters when, what an agent sees, what it gains, when its run ends."""

from typing import Any

import numpy as np
from dm_control.suite import base
from dm_env import specs
from numpy.typing import NDArray

from socialnav_mj.action import twist_of_action, wheel_speed_spec
from socialnav_mj.cast import NOBODY, Cast, cast_recording
from socialnav_mj.collision import Collision, collisions_of
from socialnav_mj.config import Scenario
from socialnav_mj.crowd import crowd_of
from socialnav_mj.entrance import AgentQueue, Ghosts, is_free
from socialnav_mj.episode import IntArray, Outcome
from socialnav_mj.geometry import Array
from socialnav_mj.observation import Neighbours, observe
from socialnav_mj.outcome import OVERTURNED_TILT
from socialnav_mj.physics import Physics
from socialnav_mj.reaction import Movers
from socialnav_mj.recordings import Recording
from socialnav_mj.sample import Sample, people_of

PROGRESS_REWARD = 1.0
"""Reward per metre that an agent came nearer to its goal [1/m]."""
ARRIVAL_REWARD = 5.0
"""Reward for coming within the goal radius."""
COLLISION_REWARD = -5.0
"""Reward for each new collision."""

_UNDER_WAY = -1


class CrowdTask(base.Task):
    """Robots start when and where recorded people appeared, and have to reach where those people went.

    The reward, one number a slot, is `PROGRESS_REWARD` for each metre of progress, `ARRIVAL_REWARD` at the goal and
    `COLLISION_REWARD` for each new collision, with a pedestrian or an agent alike.
    """

    def __init__(
        self,
        recording: Recording,
        scenario: Scenario,
        random: int | np.random.RandomState | None = None,
        *,
        replaced: IntArray | None = None,
    ) -> None:
        """Prepare the cast and the pedestrians' motion at every physics step.

        Args:
            recording: Whose people are replaced and replayed.
            scenario: Its draw, bodies, limits and rules.
            random: Kept for dm_control; nothing in an episode is random once the scenario is given.
            replaced: Indices of the people who become agents, ascending; those of the draw by default.
        """
        super().__init__(random=random)
        self.recording = recording
        self.scenario = scenario
        self.cast: Cast = cast_recording(recording, scenario, replaced=replaced)
        self.crowd = crowd_of(recording, scenario, self.cast)
        """How the people move."""
        self.neighbours: Neighbours | None = None
        """How many of the nearest an agent is shown, and how near; None for all. See `socialnav_mj.observation`."""
        self._clear()

    def _clear(self) -> None:
        n, slots = self.cast.n_agents, self.cast.n_agent_slots
        self.step = 0
        self.outcome = np.full(n, _UNDER_WAY, dtype=np.int64)
        self.spawn_step = np.full(n, -1, dtype=np.int64)
        self.end_step = np.full(n, -1, dtype=np.int64)
        self.collisions: list[Collision] = []
        self._slot_agent = np.full(slots, NOBODY, dtype=np.int64)
        self._queue = AgentQueue(self.cast)
        self.ghosts = Ghosts()
        self._goal_distance = np.zeros(slots)
        self._reward = np.zeros(slots)
        self._sample = Sample.nobody(slots)
        self.crowd.begin()
        self.people = self.crowd.crowd(0)

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

    def forget_collisions(self, step: int) -> None:
        """Drop the collisions that are older than a control step, for whoever has written them down.

        Args:
            step: Control step.
        """
        since = (step - 0.5) * self.scenario.control_timestep
        self.collisions = [one for one in self.collisions if one.touch.time >= since]

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """Wheel speeds (left, right) of every slot, shape (n_slots, 2) [rad/s].

        Args:
            physics: Not used; the limits are the scenario's.

        Returns:
            See `action.wheel_speed_spec`.
        """
        return wheel_speed_spec(self.scenario, self.cast.n_agent_slots)

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
        self._sample = Sample.of(physics, self._slot_agent)

    def before_step(self, action: Array, physics: Physics) -> None:
        """Turn wheel speeds into commands of the plant, let people react, and set them in motion.

        Args:
            action: Wheel speeds (left, right), shape (n_slots, 2) [rad/s]; rows of empty slots are ignored.
            physics: Takes the commands and the people's paths.

        Raises:
            ValueError: If the shape is wrong or a row of an active slot is not finite.
        """
        under_way = self._slot_agent != NOBODY
        physics.set_twist(twist_of_action(action, under_way, self.scenario, time=self.time))
        robots = Movers(position=self._sample.position[under_way], velocity=self._sample.velocity[under_way])
        self.crowd.react(self.step, self.people, robots)
        physics.set_pedestrian_path(*self.crowd.motion(self.step))

    def after_step(self, physics: Physics) -> None:
        """Advance the clock; end runs, let people and agents in, and account for all of it.

        Args:
            physics: After the physics steps of a control step.
        """
        self.step += 1
        self._reward = np.zeros(self.cast.n_agent_slots)
        struck = self._note_collisions(physics)
        self._sample = Sample.of(physics, self._slot_agent)
        self._end_runs(physics, struck)
        self._update_pedestrians(physics)
        if self._spawn(physics):
            # No slot can hold a newly spawned agent and one who just left.
            new = np.flatnonzero((self._slot_agent != NOBODY) & (self._sample.agent == NOBODY))
            self._sample = self._sample.updated(Sample.of(physics, self._slot_agent), new)
        physics.refresh_poses()

    def get_observation(self, physics: Physics) -> dict[str, NDArray[Any]]:
        """What every slot's agent sees; see `socialnav_mj.observation`.

        Args:
            physics: Not asked: its state was taken after the step.

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
        sample, people = self._sample, self.people
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
                neighbours=self.neighbours,
            )
        )

    def get_reward(self, physics: Physics) -> Array:
        """Reward of every slot for the last control step.

        Args:
            physics: Not asked.

        Returns:
            Shape (n_slots,); 0 for slots that were empty.
        """
        return self._reward.copy()

    def get_termination(self, physics: Physics) -> float | None:
        """The episode ends when every agent's trip has ended.

        Args:
            physics: Not asked.

        Returns:
            0.0 at the end, else None.
        """
        return 0.0 if np.all(self.outcome != _UNDER_WAY) else None

    def _update_pedestrians(self, physics: Physics) -> None:
        """Place people at the current step; whoever appears on a robot stays contact-free until clear of all robots."""
        now = self.crowd.crowd(self.step)
        if now.changed.size:
            physics.park_pedestrians(now.changed)
        there = now.present
        physics.set_pedestrian_pose(there, now.position[there], now.quaternion[there], now.velocity[there])
        self.people = people_of(physics, now)
        agent, distance = self._slot_agent[self._slot_agent != NOBODY], self.scenario.contact_distance
        solid = self.ghosts.solidify(self.people, agent, self._robots(physics), distance=distance)
        if solid.size:
            physics.set_pedestrian_contacts(solid, np.ones(len(solid), dtype=bool))

    def _robots(self, physics: Physics) -> Array:
        """Positions of the robots under way, shape (k, 2) [m]."""
        return physics.agent_position()[self._slot_agent != NOBODY]

    def _spawn(self, physics: Physics) -> bool:
        """Let agents in whose person has appeared, in that order, where there is room; the others wait."""
        # Slots that hold an agent in the sample are not free yet, even if its run has just ended.
        free = np.flatnonzero((self._slot_agent == NOBODY) & (self._sample.agent == NOBODY))
        standing = self.people.position[self.people.present]
        n_free = len(free)
        for agent in self._queue.waiting(self.step):
            start = self.cast.agent_start[agent]
            if not len(free) or not is_free(
                start, people=standing, robots=self._robots(physics), scenario=self.scenario
            ):
                continue
            slot, free = int(free[0]), free[1:]
            physics.place_agent(slot, start, float(self.cast.agent_heading[agent]))
            self._queue.let_in(agent)
            self._slot_agent[slot], self.spawn_step[agent] = agent, self.step
            self._goal_distance[slot] = np.linalg.norm(self.cast.agent_goal[agent] - start, axis=-1)
        return len(free) < n_free

    def _note_collisions(self, physics: Physics) -> list[int]:
        """Translate new touches from slots to people; slots of the agents struck in this step, once a touch."""
        new = collisions_of(physics.new_touches(), agent=self._slot_agent, pedestrian=self.people.pedestrian)
        self.collisions += new
        struck = [slot for collision in new for slot in collision.agent_slots]
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
        # What comes last here ends the run if several do in one step.
        outcome = np.full(len(slots), _UNDER_WAY, dtype=np.int64)
        outcome[self.step - self.spawn_step[agents] >= self.cast.agent_allowed_steps[agents]] = Outcome.TIMED_OUT
        outcome[distance <= self.scenario.goal_radius] = Outcome.ARRIVED
        if struck and self.scenario.on_collision == "retire":
            outcome[np.isin(slots, struck)] = Outcome.COLLIDED
        outcome[self._sample.tilt[slots] > OVERTURNED_TILT] = Outcome.OVERTURNED
        self._reward[slots[outcome == Outcome.ARRIVED]] += ARRIVAL_REWARD
        for row in np.flatnonzero(outcome != _UNDER_WAY):
            slot, agent = int(slots[row]), int(agents[row])
            self.outcome[agent], self.end_step[agent] = outcome[row], self.step
            self._slot_agent[slot] = NOBODY
            physics.park_agent(slot)
