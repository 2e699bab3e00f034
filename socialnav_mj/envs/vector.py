"""All agents of one scene after another as a Gymnasium vector environment: one slot, one environment."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from socialnav_mj.envs.crowd import UNDER_WAY, Crowd
from socialnav_mj.envs.settings import Settings
from socialnav_mj.envs.spaces import Seen, action_space, bare, observation_space, row_of
from socialnav_mj.episode import Outcome


class CrowdVectorEnv(VectorEnv[Seen, NDArray[np.float32], NDArray[Any]]):
    """Every slot of a scene is an environment; the learners of this package learn in the same crowd.

    Agents come and go, so that a slot is empty most of the time. `infos["active"]` is the mask: whether the slot held
    an agent in the step that was just made, whose transition counts; `infos["under_way"]`, whether it holds one now,
    whose action will count. Of an empty slot observation and reward are 0.

    A run that ends in a step is terminated or truncated there, `infos["final_obs"]` has its last observation and
    `infos["outcome"]` how it ended; the observation returned is already that of the slot after it, mostly empty (same
    step autoreset). When the last run of a scene has ended, the next draw begins.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": [],
        "render_fps": 5,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(self, num_envs: int, *, scenario: int = 1, seed: int = 0, **settings: Any) -> None:
        """Draw the first scene.

        Args:
            num_envs: Slots; draws with more agents at once are passed over.
            scenario: 1 to 4.
            seed: From which draws are drawn until `reset` is given one.
            **settings: Of `socialnav_mj.envs.settings.Settings.of`.

        Raises:
            ValueError: If something is unknown or not allowed, or no draw has so few agents at once.
            FileNotFoundError: If the recording is not there.
        """
        own = Settings.of(scenario, **settings)
        self.num_envs, self.render_mode = num_envs, None
        self.single_observation_space = observation_space(own.observer)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._crowd = Crowd(
            [own.recording],
            own.observer,
            own.scenario,
            shares=[own.scenario.share],
            n_slots=num_envs,
            action=own.action,
            seed=seed,
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin a scene.

        Args:
            seed: Of this draw and those after it; None draws on.
            options: None are known.

        Returns:
            Observations, and infos: under_way.
        """
        super().reset(seed=seed)
        if seed is None:
            self._crowd.next_scene()
        else:
            self._crowd.seed(seed)
        seen = self._crowd.begin()
        return bare(seen), {"under_way": self._crowd.under_way()}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Seen, NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Step the scene.

        Args:
            actions: Two numbers in [-1, 1] for each slot, shape (num_envs, 2).

        Returns:
            Observations, rewards, terminations, truncations, and infos: active, under_way, and if a run ended,
            final_obs and outcome ("arrived", "timed_out", "collided", "overturned"), each with its mask (_final_obs,
            _outcome).
        """
        step = self._crowd.step(np.asarray(actions, dtype=float))
        ended, late = step.outcome != UNDER_WAY, step.outcome == Outcome.TIMED_OUT
        infos: dict[str, Any] = {"active": step.active, "under_way": step.under_way}
        if ended.any():
            final, outcome = np.full(self.num_envs, None), np.full(self.num_envs, None)
            for slot in np.flatnonzero(ended):
                how = int(step.outcome[slot])
                final[slot] = bare(self._crowd.observer.ended(row_of(step.final, slot), how))
                outcome[slot] = Outcome(how).name.lower()
            infos |= {"final_obs": final, "_final_obs": ended, "outcome": outcome, "_outcome": ended.copy()}
        return bare(step.seen), step.reward, ended & ~late, late, infos
