"""What is done while scenes step in other processes."""

from collections.abc import Callable

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn


class Meanwhile(VecEnvWrapper):
    """Environments that let the learner work between asking for a step and waiting for it."""

    def __init__(self, environments: VecEnv, work: Callable[[], None]) -> None:
        """Wrap environments.

        Args:
            environments: Whose steps take place elsewhere, or nothing is gained.
            work: Called once a step.
        """
        super().__init__(environments)
        self._work = work

    def reset(self) -> np.ndarray:
        """Reset them.

        Returns:
            Their observations.
        """
        observation = self.venv.reset()
        assert isinstance(observation, np.ndarray)
        return observation

    def step_wait(self) -> VecEnvStepReturn:
        """Work, then wait for the step.

        Returns:
            Observations, rewards, dones and infos.
        """
        self._work()
        return self.venv.step_wait()
