"""A crowd as a stable-baselines3 VecEnv: every slot of the scene is one environment."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from socialnav_mj.cast import NOBODY, cast_recording
from socialnav_mj.config import Robot, Scenario, TurnLimit
from socialnav_mj.controllers import Limits, make_controller
from socialnav_mj.environment import Environment, build_environment
from socialnav_mj.episode import Outcome
from socialnav_mj.features import COLLISION_FLAG, GOAL_FLAG, FeatureSet, absorbing_state, running_state, view_of
from socialnav_mj.geometry import Array, twist_of_wheel_speed
from socialnav_mj.recordings import Recording

_MOST_DRAWS = 1000


class CrowdVecEnv(VecEnv):
    """Agents of one scene after another, each for as long as its run lasts.

    An observation is a state of `socialnav_mj.features`. A slot without an agent stands still: its observation is 0 and
    `infos[slot]["active"]` is False for what its step was. When a run ends, `dones[slot]` is True,
    `infos[slot]["terminal_observation"]` holds its last state (absorbing at the goal, collided or overturned), and
    `infos[slot]["TimeLimit.truncated"]` says that a deadline ended it. When the last run of a scene has ended, the next
    scene begins. Rewards are the tasks' own; ReplayIRL replaces them.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        features: FeatureSet,
        *,
        shares: Sequence[float],
        n_slots: int,
        robot_radius: float,
        pedestrian_radius: float,
        turn_limit: TurnLimit = "per_step",
        guide: str,
        seed: int,
    ) -> None:
        """Build the first scene.

        Args:
            recordings: Take turns.
            features: What an agent sees.
            shares: Shares of replaced people; take turns.
            n_slots: Number of environments; draws that need more are passed over.
            robot_radius: [m].
            pedestrian_radius: [m].
            turn_limit: Of the agents.
            guide: Controller that `guide_action` asks.
            seed: Seed from which the seeds of all draws are taken.
        """
        self._guide = make_controller(guide)
        self._recordings, self._shares, self._features = tuple(recordings), tuple(shares), features
        self._scenario = Scenario(
            robot=Robot(radius=robot_radius),
            pedestrian_radius=pedestrian_radius,
            turn_limit=turn_limit,
            on_collision="retire",
        )
        self._random = np.random.default_rng(seed)
        self._scenes = 0
        self._actions = np.zeros((n_slots, 2))
        self._asked = False
        size = features.size + 2
        super().__init__(
            n_slots, spaces.Box(-np.inf, np.inf, (size,), np.float32), spaces.Box(-1.0, 1.0, (2,), np.float32)
        )
        self.environment = self._next_scene()

    def _next_scene(self) -> Environment:
        self._drawn_from = {"random": json.dumps(self._random.bit_generator.state), "scenes": self._scenes}
        recording = self._recordings[self._scenes % len(self._recordings)]
        share = self._shares[self._scenes // len(self._recordings) % len(self._shares)]
        self._scenes += 1
        for _ in range(_MOST_DRAWS):
            seed = int(self._random.integers(2**31))
            scenario = replace(self._scenario, share=share, seed=seed)
            if cast_recording(recording, scenario).n_agent_slots <= self.num_envs:
                break
        else:
            raise ValueError(
                f"no draw of recording {recording.name!r} at share {share} has at most n_slots = {self.num_envs} "
                "agents at once; allow more slots or a smaller share"
            )
        self._limits = Limits.of(scenario)
        self._guide.reset(self._limits, seed=seed)
        return build_environment(recording, scenario)

    def reset(self) -> NDArray[np.float32]:
        """Begin the scene.

        Returns:
            Shape (n_slots, state size).
        """
        self._past: list[tuple[Array, bool]] = []
        self.environment.reset()
        return self._states()[0]

    def state(self) -> dict[str, Any]:
        """All that brings this moment back: what the scene was drawn from, and what was done in it.

        Returns:
            Plain values and arrays for `restore`.
        """
        actions = np.array([action for action, _ in self._past]).reshape(len(self._past), self.num_envs, 2)
        return {**self._drawn_from, "actions": actions, "asked": np.array([asked for _, asked in self._past], bool)}

    def restore(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Draw a scene again and do in it what was done; simulations are repeatable to the bit.

        Args:
            state: As `state` returns it, of a crowd that was made alike.

        Returns:
            What the agents see then, shape (n_slots, state size).
        """
        self._random.bit_generator.state = json.loads(state["random"])
        self._scenes = int(state["scenes"])
        self.environment = self._next_scene()
        seen = self.reset()
        for action, asked in zip(np.asarray(state["actions"]), np.asarray(state["asked"]), strict=True):
            if asked:
                self.guide_action()  # a guide may have a memory
            self.step_async(action)
            seen, *_ = self.step_wait()
        return seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step.

        Args:
            actions: (speed, turn) in [-1, 1], shape (n_slots, 2); see `socialnav_mj.controllers.replay_irl`.
        """
        self._actions = np.array(actions, dtype=float)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step the scene.

        Returns:
            States (n_slots, size), rewards (n_slots,), dones (n_slots,), infos.
        """
        task = self.environment.task
        count = task.cast.n_agent_slots
        before = task.slot_agent
        self._past.append((self._actions, self._asked))
        self._asked = False
        time_step = self.environment.step(self._limits.wheel_speed(self._twist(self._actions[:count])))
        states, final = self._states()
        rewards = np.zeros(self.num_envs, dtype=np.float32)
        rewards[:count] = time_step.reward
        dones = np.zeros(self.num_envs, dtype=bool)
        infos: list[dict[str, Any]] = [{"active": False} for _ in range(self.num_envs)]
        for slot in np.flatnonzero(before != NOBODY):
            infos[slot]["active"] = True
            outcome = task.outcome[before[slot]]
            if outcome < 0:
                continue
            dones[slot] = True
            infos[slot]["terminal_observation"] = self._terminal(int(outcome), final[slot])
            infos[slot]["TimeLimit.truncated"] = outcome == Outcome.TIMED_OUT
            infos[slot]["outcome"] = int(outcome)
        if time_step.last():
            self.environment = self._next_scene()
            states = self.reset()
        return states, rewards, dones, infos

    def guide_action(self) -> Array:
        """What the guide would do now.

        Returns:
            (speed, turn) in [-1, 1], shape (n_slots, 2); of no meaning in empty slots.
        """
        self._asked = True
        task = self.environment.task
        wheel_speed = self._guide.act(task.get_observation(self.environment.physics))
        twist = twist_of_wheel_speed(wheel_speed, wheel_radius=self._limits.wheel_radius, track=self._limits.track)
        action = np.zeros((self.num_envs, 2))
        action[: len(twist), 0] = 2.0 * twist[:, 0] / self._limits.max_speed - 1.0
        action[: len(twist), 1] = twist[:, 1] / self._limits.max_yaw_rate
        return action

    def _twist(self, actions: Array) -> Array:
        return np.stack(
            [0.5 * (actions[:, 0] + 1.0) * self._limits.max_speed, actions[:, 1] * self._limits.max_yaw_rate], axis=1
        )

    def _terminal(self, outcome: int, state: NDArray[np.float32]) -> NDArray[np.float32]:
        if outcome == Outcome.ARRIVED:
            return absorbing_state(self._features.size, GOAL_FLAG).astype(np.float32)
        if outcome in (Outcome.COLLIDED, Outcome.OVERTURNED):
            return absorbing_state(self._features.size, COLLISION_FLAG).astype(np.float32)
        return state

    def _states(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """States of the agents under way, and the same with those whose run just ended."""
        task = self.environment.task
        final = np.zeros((self.num_envs, self._features.size + 2), dtype=np.float32)
        rows = np.flatnonzero(task.sample.agent != NOBODY)
        if rows.size:
            final[rows] = running_state(self._features(view_of(task.final_observation(), rows)))
        states = final.copy()
        states[: task.cast.n_agent_slots][task.slot_agent == NOBODY] = 0.0
        return states, final

    def close(self) -> None:
        """Nothing to close."""

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Leave the draws as they are: they are seeded once, when the crowd is made.

        stable-baselines3 seeds its environments with the learner's seed, which would repeat the first scene's draw and,
        after a resume, the scenes of the training's beginning.

        Args:
            seed: Not used.

        Returns:
            None for every environment.
        """
        return [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of this object, for every environment.

        Args:
            attr_name: Its name.
            indices: Which environments.

        Returns:
            One value an environment.
        """
        return [getattr(self, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of this object.

        Args:
            attr_name: Its name.
            value: Its value.
            indices: Not used: the environments share one scene.
        """
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Not supported: the environments share one scene.

        Args:
            method_name: Not used.
            *args: Not used.
            indices: Not used.
            **kwargs: Not used.

        Returns:
            Never.

        Raises:
            NotImplementedError: Always.
        """
        raise NotImplementedError(f"a crowd has no method {method_name!r} for each of its environments")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No environment is wrapped.

        Args:
            wrapper_class: Not used.
            indices: Which environments.

        Returns:
            False for each.
        """
        return [False for _ in self._get_indices(indices)]
