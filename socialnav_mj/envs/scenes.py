"""Many crowds behind one stable-baselines3 VecEnv: each in a worker process, observations in shared memory."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.envs.crowd import UNDER_WAY
from socialnav_mj.envs.guided import CrowdSettings, GuidedCrowd, infos_of
from socialnav_mj.envs.sb3 import PlainVecEnv
from socialnav_mj.envs.spaces import action_space, observation_space
from socialnav_mj.envs.worker import SharedSlots, command
from socialnav_mj.envs.workers import Workers
from socialnav_mj.features.seen import Flat
from socialnav_mj.geometry import Array


def scene_seed(seed: int, scene: int) -> int:
    """Seed of one of many scenes: `CrowdVecEnv(..., seed=scene_seed(s, k))` alone gives the bits of scene k of seed s.

    The sum of both would not do: trainings of seeds 0 and 1 would share all scenes but one.

    Args:
        seed: Of all scenes, >= 0.
        scene: Number of the scene, >= 0.

    Returns:
        numpy's `SeedSequence(seed, spawn_key=(scene,))`, its first 64 bits.
    """
    return int(np.random.SeedSequence(seed, spawn_key=(scene,)).generate_state(1, np.uint64)[0])


class ScenesVecEnv(PlainVecEnv):
    """Crowds side by side, each as a `CrowdVecEnv` plays it, in a process of its own.

    Environment `k * n_slots + i` is slot i of scene k. All scenes make a step at once, and each begins its next draw
    when its last run has ended. States, rewards, dones and infos are those of `CrowdVecEnv`.

    Workers are started anew, not forked: a script has to make this under `if __name__ == "__main__":`, and what it
    imports outside of that and of its functions, every worker imports too. They do not need torch.

    They end with `close`, with this object and with this process, however it ends; an interruption in the middle of a
    command closes.
    """

    def __init__(self, settings: CrowdSettings, *, n_scenes: int, seed: int) -> None:
        """Start the workers and build their first scenes.

        Args:
            settings: Of all scenes; in every one of them recordings and shares take turns.
            n_scenes: Worker processes, each with one scene at a time; more than there are cores gain nothing.
            seed: Seed from which `scene_seed` takes those of the scenes.

        Raises:
            ValueError: If n_scenes < 1.
            WorkerError: If a worker dies, or raises since no draw has so few agents at once.
        """
        if n_scenes < 1:
            raise ValueError(f"n_scenes = {n_scenes} is not allowed; allowed: integers >= 1")
        features, self.n_slots = Flat(settings.features), settings.n_slots
        shared = SharedSlots(n_scenes * self.n_slots, features.bounds[""][2])
        self._slots = shared.slots
        makes = [partial(GuidedCrowd, settings, seed=scene_seed(seed, scene)) for scene in range(n_scenes)]
        self._workers = Workers(makes, shared, self.n_slots)
        super().__init__(n_scenes * self.n_slots, observation_space(features), action_space())

    def reset(self) -> NDArray[np.float32]:
        """Begin all scenes; a step that is under way is finished and forgotten.

        Returns:
            States, shape (num_envs, state size).

        Raises:
            WorkerError: If a worker raises or dies.
        """
        if self._workers.are_asked:
            self._workers.answers()
        self._workers.ask("reset")
        return self._slots["seen"].copy()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Let all scenes step, without waiting.

        Args:
            actions: (speed, turn) in [-1, 1], shape (num_envs, 2); see `Limits.twist_of_action`.

        Raises:
            ValueError: If their shape is another.
            RuntimeError: If a step is under way, or the scenes are closed.
            WorkerError: If a worker has died.
        """
        if np.shape(actions) != (self.num_envs, 2):
            raise ValueError(f"actions of shape {np.shape(actions)} are not allowed; allowed: {(self.num_envs, 2)}")
        self._workers.check()
        self._slots["action"] = actions
        self._workers.send([command("step")] * len(self._workers))

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Wait for the step.

        Returns:
            States (num_envs, size), rewards (num_envs,), dones (num_envs,), infos; copies, no views.

        Raises:
            RuntimeError: If no step is under way, or the scenes are closed.
            WorkerError: If a worker raises or dies.
        """
        if not self._workers.are_asked:
            self._workers.check()
            raise RuntimeError("no step is under way; call step_async first")
        self._workers.answers()
        slots = self._slots.copy()
        infos = infos_of(slots["active"], slots["outcome"], slots["last_state"])
        return slots["seen"].copy(), slots["reward"].copy(), slots["outcome"] != UNDER_WAY, infos

    def guide_action(self) -> Array:
        """What the guides would do now.

        Returns:
            (speed, turn) in [-1, 1], shape (num_envs, 2); of no meaning in empty slots.
        """
        return np.concatenate(self._workers.ask("call", "guide_action"))

    def state(self) -> dict[str, Any]:
        """All that brings this moment back.

        Returns:
            scenes: of each scene what `CrowdVecEnv.state` returns.
        """
        return {"scenes": self._workers.ask("call", "state")}

    def restore(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Draw the scenes again and do in them what was done; simulations are repeatable to the bit.

        Args:
            state: As `state` returns it, of scenes that were made alike.

        Returns:
            What the agents see then, shape (num_envs, state size).

        Raises:
            ValueError: If it is of another number of scenes.
        """
        scenes = state["scenes"]
        if len(scenes) != len(self._workers):
            raise ValueError(f"a state of {len(scenes)} scenes is not allowed; allowed: of {len(self._workers)}")
        self._workers.send([command("call", "bring_back", (scene,)) for scene in scenes])
        return np.concatenate([seen[""] for seen in self._workers.answers()])

    def cpu_time(self) -> list[float]:
        """CPU time that each worker has taken so far.

        Returns:
            One value a scene, imports and the first build included [s].
        """
        return self._workers.ask("cpu_time")

    def close(self) -> None:
        """End the workers; everything but this raises from then on."""
        self._workers.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the crowds (`socialnav_mj.envs.guided.GuidedCrowd`), for every environment.

        Args:
            attr_name: Its name.
            indices: Which environments.

        Returns:
            One value an environment, that of its scene.

        Raises:
            AttributeError: If a crowd has none of this name.
            WorkerError: If it cannot travel between processes, or a worker has died.
        """
        return self._ask("get", attr_name, indices=indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the crowds.

        Args:
            attr_name: Its name.
            value: Its value.
            indices: Which environments; those of a scene share one crowd.
        """
        self._ask("set", attr_name, value, indices=indices)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the crowds, once in each scene.

        Args:
            method_name: Of `socialnav_mj.envs.guided.GuidedCrowd`.
            *args: Its arguments.
            indices: Which environments; those of a scene share one crowd.
            **kwargs: Its keyword arguments.

        Returns:
            One value an environment, that of its scene.

        Raises:
            AttributeError: If the crowds have no such method.
            WorkerError: If it raises, or its value cannot travel between processes, or a worker has died.
        """
        return self._ask("call", method_name, args, kwargs, indices=indices)

    def get_images(self) -> list[NDArray[np.uint8] | None]:
        """Nothing is drawn.

        Returns:
            None for every environment.
        """
        return [None] * self.num_envs

    def _ask(self, name: str, *args: Any, indices: Any) -> list[Any]:
        """The answers of the scenes of some environments, one an environment."""
        scenes = [int(index) // self.n_slots for index in self._get_indices(indices)]
        asked = sorted(set(scenes))
        answers = dict(zip(asked, self._workers.ask(name, *args, scenes=asked), strict=True))
        return [answers[scene] for scene in scenes]
