"""Agent-steps a second for a learner: scenes in worker processes beside the same in one, in turn, as ratios."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from statistics import median
from time import perf_counter, process_time
from typing import TYPE_CHECKING

import numpy as np

from socialnav_mj.cast import cast_recording
from socialnav_mj.config import SHARES, Scenario
from socialnav_mj.envs.guided import CrowdSettings
from socialnav_mj.features import feature_set
from socialnav_mj.recordings import Recording
from socialnav_mj.resources import install_hint

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

FEATURES = "continuous"
"""What agents see."""
_LOOKED_AT = 10
"""Draws that tell how many slots there have to be."""
_WARM_UP = 5
"""Steps before the first measurement."""


@dataclass(frozen=True, kw_only=True)
class Spread:
    """A figure over repetitions."""

    values: tuple[float, ...]
    """Of each repetition."""
    middle: float
    """Their median."""
    low: float
    """The least."""
    high: float
    """The greatest."""

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Sum up repetitions.

        Args:
            values: One or more.

        Returns:
            Median and range.
        """
        return cls(values=tuple(values), middle=median(values), low=min(values), high=max(values))

    def __str__(self) -> str:
        return f"{self.middle:.2f} ({self.low:.2f} to {self.high:.2f})"


@dataclass(frozen=True, kw_only=True)
class Throughput:
    """What so many worker processes do beside one process that plays the same scenes, a step of each after another."""

    scenario: str
    n_scenes: int
    """Worker processes, each with a scene."""
    n_slots: int
    """Slots of a scene."""
    control_steps: int
    """Of each scene in a repetition."""
    agent_steps: tuple[int, ...]
    """Of all scenes in each repetition, the same on either side."""
    one: Spread
    """Agent-steps a second of one process [1/s]."""
    workers: Spread
    """Agent-steps a second of the workers [1/s]."""
    ratio: Spread
    """workers / one, within each repetition."""
    one_cpu: Spread
    """Agent-steps for a second of CPU time, of one process [1/s]."""
    workers_cpu: Spread
    """Agent-steps for a second of CPU time, of the workers and the process that leads them [1/s]."""
    cpu_ratio: Spread
    """workers_cpu / one_cpu, within each repetition."""


class _Side:
    """Environments that are driven at random, and timed."""

    def __init__(self, envs: Sequence["VecEnv"], cpu_time: Callable[[], float], seed: int) -> None:
        self._envs, self._cpu_time, self._random = envs, cpu_time, np.random.default_rng(seed)
        for env in envs:
            env.reset()
        self.run(_WARM_UP)

    def run(self, control_steps: int) -> tuple[int, float, float]:
        """Agent-steps, and what they took by the clock and of CPU time [s]."""
        agent_steps, cpu, begin = 0, self._cpu_time(), perf_counter()
        for _ in range(control_steps):
            for env in self._envs:
                *_, infos = env.step(self._random.uniform(-1.0, 1.0, (env.num_envs, 2)))
                agent_steps += sum(info["active"] for info in infos)
        return agent_steps, perf_counter() - begin, self._cpu_time() - cpu


def measure_scenes(
    recording: Recording,
    scenario: str,
    n_scenes: int,
    *,
    seed: int = 0,
    repetitions: int = 3,
    control_steps: int = 200,
) -> Throughput:
    """Let one process and workers play the same scenes, in turn, with the same random actions.

    A learner's own time comes on top of both.

    Args:
        recording: Crowd whose people are replaced.
        scenario: Name of a task; gives the share of replaced people.
        n_scenes: Worker processes, >= 1.
        seed: Of the scenes, and of the actions.
        repetitions: Measurements of either, in turn, >= 1.
        control_steps: Of each scene in a repetition; so many that there are agents in them.

    Returns:
        Agent-steps a second of both, and their ratios.

    Raises:
        ValueError: If n_scenes < 1.
        RuntimeError: If the extra `train` is missing, or a worker fails.
    """
    try:
        from socialnav_mj.envs.sb3 import CrowdVecEnv  # brings torch, which is slow to import
        from socialnav_mj.envs.scenes import ScenesVecEnv, scene_seed
    except ImportError as error:
        raise RuntimeError(f"scenes for learners need the extra 'train' ({install_hint('train')}): {error}") from error
    setting = Scenario(share=SHARES[scenario])
    n_slots = _slots_needed(recording, setting)
    settings = CrowdSettings(
        recordings=(recording,), features=feature_set(FEATURES), shares=(setting.share,), n_slots=n_slots
    )
    with closing(ScenesVecEnv(settings, n_scenes=n_scenes, seed=seed)) as many:
        ones = [CrowdVecEnv(settings, seed=scene_seed(seed, scene)) for scene in range(n_scenes)]
        sides = (
            _Side(ones, process_time, seed),
            _Side([many], lambda: process_time() + sum(many.cpu_time()), seed),
        )
        taken = [[side.run(control_steps) for side in sides] for _ in range(repetitions)]
    wall, cpu = ([[steps / times[kind] for steps, *times in pair] for pair in taken] for kind in (0, 1))
    return Throughput(
        scenario=scenario,
        n_scenes=n_scenes,
        n_slots=n_slots,
        control_steps=control_steps,
        agent_steps=tuple(one[0] for one, _ in taken),
        one=Spread.of([one for one, _ in wall]),
        workers=Spread.of([workers for _, workers in wall]),
        ratio=Spread.of([workers / one for one, workers in wall]),
        one_cpu=Spread.of([one for one, _ in cpu]),
        workers_cpu=Spread.of([workers for _, workers in cpu]),
        cpu_ratio=Spread.of([workers / one for one, workers in cpu]),
    )


def _slots_needed(recording: Recording, scenario: Scenario) -> int:
    """Agents at once, at most, in the first draws."""
    return max(cast_recording(recording, replace(scenario, seed=draw)).n_agent_slots for draw in range(_LOOKED_AT))
