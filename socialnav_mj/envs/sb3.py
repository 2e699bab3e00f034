"""A crowd as a stable-baselines3 VecEnv: every slot of the scene is one environment."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from socialnav_mj.environment import Environment
from socialnav_mj.envs.crowd import UNDER_WAY
from socialnav_mj.envs.guided import CrowdSettings, GuidedCrowd, infos_of
from socialnav_mj.envs.spaces import action_space, observation_space
from socialnav_mj.geometry import Array


class PlainVecEnv(VecEnv):
    """What crowds are as environments, however they are run: seeded once, and wrapped in nothing."""

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Leave the draws as they are: they are seeded once, when it is made.

        stable-baselines3 seeds its environments with the learner's seed, which would repeat the first scene's draw and,
        after a resume, the scenes of the training's beginning.

        Args:
            seed: Not used.

        Returns:
            None for every environment.
        """
        return [None] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No environment is wrapped.

        Args:
            wrapper_class: Not used.
            indices: Which environments.

        Returns:
            False for each.
        """
        return [False for _ in self._get_indices(indices)]


class CrowdVecEnv(PlainVecEnv):
    """Agents of one scene after another, each for as long as its run lasts.

    An observation is a state of `socialnav_mj.features`. A slot without an agent stands still: its observation is 0 and
    `infos[slot]["active"]` is False for what its step was. When a run ends, `dones[slot]` is True,
    `infos[slot]["terminal_observation"]` holds its last state (absorbing at the goal, collided or overturned), and
    `infos[slot]["TimeLimit.truncated"]` says that a deadline ended it. When the last run of a scene has ended, the next
    scene begins. Rewards are the tasks' own.
    """

    def __init__(self, settings: CrowdSettings, *, seed: int) -> None:
        """Build the first scene.

        Args:
            settings: Of all scenes; every slot is an environment.
            seed: Seed from which the seeds of all draws are taken.

        Raises:
            ValueError: If no draw has so few agents at once, or there is no such guide.
        """
        self._crowd = GuidedCrowd(settings, seed=seed)
        self._actions = np.zeros((settings.n_slots, 2))
        super().__init__(settings.n_slots, observation_space(self._crowd.observer), action_space())

    @property
    def environment(self) -> Environment:
        """The scene that is being played."""
        return self._crowd.environment

    def reset(self) -> NDArray[np.float32]:
        """Begin the scene.

        Returns:
            Shape (n_slots, state size).
        """
        return self._crowd.begin()[""]

    def state(self) -> dict[str, Any]:
        """All that brings this moment back: what the scene was drawn from, and what was done in it.

        Returns:
            Plain values and arrays for `restore`.
        """
        return self._crowd.state()

    def restore(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Draw a scene again and do in it what was done; simulations are repeatable to the bit.

        Args:
            state: As `state` returns it, of a crowd that was made alike.

        Returns:
            What the agents see then, shape (n_slots, state size).
        """
        return self._crowd.bring_back(state)[""]

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step.

        Args:
            actions: (speed, turn) in [-1, 1], shape (n_slots, 2); see `Limits.twist_of_action`.
        """
        self._actions = np.array(actions, dtype=float)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step the scene.

        Returns:
            States (n_slots, size), rewards (n_slots,), dones (n_slots,), infos.
        """
        step = self._crowd.step(self._actions)
        infos = infos_of(step.active, step.outcome, self._crowd.last_states(step))
        return step.seen[""], step.reward, step.outcome != UNDER_WAY, infos

    def guide_action(self) -> Array:
        """What the guide would do now.

        Returns:
            (speed, turn) in [-1, 1], shape (n_slots, 2); of no meaning in empty slots.
        """
        return self._crowd.guide_action()

    def close(self) -> None:
        """Nothing to close."""

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
