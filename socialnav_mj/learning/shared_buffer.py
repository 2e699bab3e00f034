"""The replay buffer that SAC and the reward step share."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples

from socialnav_mj.features import FeatureSet
from socialnav_mj.learning.mirror import Mirror
from socialnav_mj.learning.reward import RewardOf

_ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_OWN_ARRAYS = ("log_probs", "runs", "previous")


class SharedReplayBuffer(ReplayBuffer):
    """Transitions of all agents in one row each; rewards are computed when it is sampled.

    Left and right are alike, so every sampled transition is mirrored with probability 1/2. Unlike its parent it keeps
    only transitions of slots that held an agent, whatever their number, and for each the behaviour policy's log density
    of the action and the row of the same run's transition before it.
    """

    reward_of: RewardOf
    """Set by the learner before the first sample."""

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        device: torch.device | str = "auto",
        n_envs: int = 1,
        optimize_memory_usage: bool = False,
        *,
        features: FeatureSet,
        seed: int,
    ) -> None:
        """Make an empty buffer.

        Args:
            buffer_size: Transitions that it holds, of all slots together.
            observation_space: Of a slot.
            action_space: Of a slot.
            device: Of the samples.
            n_envs: Number of slots.
            optimize_memory_usage: Not used.
            features: Of the observations.
            seed: Seed of the choice of transitions.
        """
        super().__init__(buffer_size, observation_space, action_space, device, n_envs=1)
        self.mirror = Mirror(features)
        self.random = np.random.default_rng(seed)
        self.log_probs = np.zeros(self.buffer_size, dtype=np.float32)
        self.runs = np.full(self.buffer_size, -1, dtype=np.int64)
        self.previous = np.full(self.buffer_size, -1, dtype=np.int64)
        self._slot_run = np.arange(n_envs, dtype=np.int64)
        self._slot_row = np.full(n_envs, -1, dtype=np.int64)
        self._next_run = n_envs

    def store(
        self,
        observation: NDArray[Any],
        next_observation: NDArray[Any],
        action: NDArray[Any],
        done: NDArray[np.bool_],
        infos: list[dict[str, Any]],
        log_prob: NDArray[Any],
        reward: NDArray[Any],
    ) -> None:
        """Add the transitions of the slots that held an agent.

        Args:
            observation: Shape (n_slots, size).
            next_observation: Of the same run, shape (n_slots, size).
            action: In [-1, 1], shape (n_slots, 2).
            done: Shape (n_slots,).
            infos: With "active" and, where done, "TimeLimit.truncated".
            log_prob: Behaviour policy's log density of the actions, shape (n_slots,).
            reward: The task's own, shape (n_slots,).
        """
        for slot in [i for i, info in enumerate(infos) if info["active"]]:
            row = self.pos
            self.observations[row, 0], self.next_observations[row, 0] = observation[slot], next_observation[slot]
            self.actions[row, 0], self.dones[row, 0] = action[slot], done[slot]
            self.timeouts[row, 0] = infos[slot].get("TimeLimit.truncated", False)
            self.log_probs[row], self.rewards[row, 0] = log_prob[slot], reward[slot]
            self.runs[row], self.previous[row] = self._slot_run[slot], self._slot_row[slot]
            self._slot_row[slot] = row
            if done[slot]:
                self._slot_run[slot], self._slot_row[slot] = self._next_run, -1
                self._next_run += 1
            self.pos += 1
            if self.pos == self.buffer_size:
                self.full, self.pos = True, 0

    def sample(self, batch_size: int, env: Any = None) -> ReplayBufferSamples:
        """Transitions for SAC, with the rewards that `reward_of` gives now.

        Args:
            batch_size: Number of transitions.
            env: Not used; observations are not normalised.

        Returns:
            The samples; dones are 0 where a deadline ended the run, so that SAC bootstraps there.
        """
        rows = self.random.integers(self.size(), size=batch_size)
        done = self.dones[rows] * (1.0 - self.timeouts[rows])
        turned = self.random.random(batch_size) < 0.5
        action = self.actions[rows, 0].copy()
        action[turned, 1] *= -1.0
        next_state = torch.from_numpy(self.mirror(self.next_observations[rows, 0], turned))
        terminal = torch.from_numpy(done)
        return ReplayBufferSamples(
            torch.from_numpy(self.mirror(self.observations[rows, 0], turned)),
            torch.from_numpy(action),
            next_state,
            terminal,
            self.reward_of(next_state, terminal, torch.from_numpy(self.rewards[rows])),
        )

    def sample_states(self, batch_size: int, absorbing_share: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """States for the reward step.

        Args:
            batch_size: Number of states.
            absorbing_share: Share of them that is absorbing, as far as there are any.

        Returns:
            States that actions led to, shape (batch_size, size), and the log densities of these actions.
        """
        size = self.size()
        absorbed = np.flatnonzero((self.dones[:size, 0] > 0.0) & (self.timeouts[:size, 0] == 0.0))
        count = round(batch_size * absorbing_share) if absorbed.size else 0
        rows = self.random.integers(size, size=batch_size)
        rows[:count] = self.random.choice(absorbed, size=count) if count else rows[:0]
        return self.next_observations[rows, 0], self.log_probs[rows]

    def sample_segments(self, batch_size: int, length: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Segments of runs for the reward step.

        Args:
            batch_size: Number of segments.
            length: Transitions of each; a run that began later gives a shorter segment, padded with its first state.

        Returns:
            States (batch_size, length, size) and log densities (batch_size, length), in reverse order of time; the
            padding's log density is 0.
        """
        row = self.random.integers(self.size(), size=batch_size)
        rows, known = [row], [np.ones(batch_size, dtype=bool)]
        for _ in range(length - 1):
            before = self.previous[row]
            valid = known[-1] & (before >= 0) & (self.runs[before] == self.runs[row])
            row = np.where(valid, before, row)
            rows.append(row)
            known.append(valid)
        index = np.stack(rows, axis=1)
        return self.next_observations[index, 0], self.log_probs[index] * np.stack(known, axis=1)

    def state(self) -> dict[str, Any]:
        """The filled part of the buffer and all that decides what is stored and sampled next, for a checkpoint.

        Returns:
            Arrays by name, the transitions first, a cursor of three integers, the runs of the slots, and the random
            state as JSON; `restore` takes them.
        """
        size = self.size()
        arrays = {name: getattr(self, name)[:size] for name in (*_ARRAYS, *_OWN_ARRAYS)}
        return {
            **arrays,
            "cursor": np.array([self.pos, int(self.full), self._next_run]),
            "slot_run": self._slot_run.copy(),
            "slot_row": self._slot_row.copy(),
            "random": json.dumps(self.random.bit_generator.state),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Fill from a checkpoint.

        Args:
            state: As `state` returns it.
        """
        for name in (*_ARRAYS, *_OWN_ARRAYS):
            getattr(self, name)[: len(state[name])] = state[name]
        self.pos, self.full, self._next_run = int(state["cursor"][0]), bool(state["cursor"][1]), int(state["cursor"][2])
        self._slot_run[:], self._slot_row[:] = state["slot_run"], state["slot_row"]
        self.random.bit_generator.state = json.loads(state["random"])
