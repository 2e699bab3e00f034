"""ReplayIRL: SAC and guided cost learning on one replay buffer (paper section III-A; Baghi and Dudek 2021).

SAC is stable-baselines3's. It learns from the reward that the reward network gives at the moment of sampling; between
its updates a reward step compares expert states with states of the same buffer, so the reward costs no environment
step. The updates that follow a step of the scene are made while it makes the next one.
"""

import json
import math
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import asdict
from time import perf_counter
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.noise import ActionNoise

from socialnav_mj.envs.sb3 import CrowdVecEnv
from socialnav_mj.envs.scenes import ScenesVecEnv
from socialnav_mj.features import FeatureSet
from socialnav_mj.learning.config import TrainingConfig
from socialnav_mj.learning.experts import Demonstrations, ExpertSampler
from socialnav_mj.learning.meanwhile import Meanwhile
from socialnav_mj.learning.reward import (
    RewardNet,
    gradient_penalty,
    irl_loss,
    log_partition_fused,
    log_partition_importance,
    reward_for,
)
from socialnav_mj.learning.sac_update import SacUpdate, actor_network
from socialnav_mj.learning.shared_buffer import SharedReplayBuffer


class ReplayIRL(SAC):
    """SAC whose replay buffer is the one the reward is learned from."""

    replay_buffer: SharedReplayBuffer

    def __init__(
        self, env: CrowdVecEnv | ScenesVecEnv, experts: Demonstrations, features: FeatureSet, config: TrainingConfig
    ) -> None:
        """Make the networks and the buffer.

        Args:
            env: The crowd.
            experts: Demonstrations.
            features: Of environment and experts.
            config: Of the training.
        """
        self.config, self.features, self.crowd = config, features, env
        self._due = 0
        """SAC updates that are to be made while the scene steps."""
        self._rate = config.learning_rate
        """Learning rate of these."""
        super().__init__(
            "MlpPolicy",
            Meanwhile(env, self._catch_up),
            learning_rate=lambda left: config.learning_rate * (0.1 + 0.9 * left),
            buffer_size=config.buffer_size,
            learning_starts=config.guided_scene_steps * env.num_envs,
            target_entropy=config.target_entropy,
            batch_size=config.batch_size,
            tau=config.tau,
            gamma=config.gamma,
            train_freq=(1, "step"),
            gradient_steps=config.updates_per_scene_step,
            replay_buffer_class=SharedReplayBuffer,
            replay_buffer_kwargs={"features": features, "seed": config.seed},
            policy_kwargs={"net_arch": list(config.hidden)},
            seed=config.seed,
            device="cpu",
        )
        size = int(np.prod(env.observation_space.shape or ()))
        self.reward_net = RewardNet(size, config.hidden, spectral=config.spectral_norm)
        self.reward_optimizer = torch.optim.AdamW(
            self.reward_net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        self.replay_buffer.reward_of = reward_for(config, self.reward_net)
        self.average = deepcopy(self.actor).requires_grad_(False)
        """The actor's average over the updates: the policy that is validated and kept."""
        self._update = SacUpdate(self)
        self._averages = actor_network(self.average).parameters.flat
        self.random = np.random.default_rng(config.seed + 1)
        self.experts = ExpertSampler(experts, features)
        self.seconds = {"sac": 0.0, "reward": 0.0}
        """CPU-bound time spent so far, by kind [s]."""
        self.updates = 0
        """SAC updates so far."""
        self._log_prob: NDArray[Any] = np.zeros(env.num_envs)
        """Log densities of the actions of the step under way."""

    @property
    def scene_steps(self) -> int:
        """Control steps of the training scene so far; SB3 counts one for every slot."""
        return self.num_timesteps // self.n_envs

    def _average_actor(self) -> None:
        """Let the average take the actor in as update `updates`: polynomial-decay averaging."""
        power = self.config.averaging_power
        share = (power + 1.0) / (self.updates + power)
        self._averages += share * (self._update.actor.parameters.flat - self._averages)

    def _sample_action(
        self, learning_starts: int, action_noise: ActionNoise | None = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """The actor's action, or before learning starts the guide's with noise.

        Args:
            learning_starts: Time steps of the guide.
            action_noise: Not used with the guide.
            n_envs: Number of slots.

        Returns:
            The action, twice: actions are not rescaled.
        """
        if self.num_timesteps >= learning_starts:
            assert isinstance(self._last_obs, np.ndarray)
            action, self._log_prob = self._update.act(self._last_obs)
            return action, action
        noise = self.random.normal(size=(n_envs, 2))
        sigma = self.config.guide_noise
        self._log_prob = -0.5 * (noise**2).sum(axis=1) - 2.0 * math.log(sigma * math.sqrt(2.0 * math.pi))
        action = np.clip(self.crowd.guide_action() + sigma * noise, -1.0, 1.0).astype(np.float32)
        return action, action

    def _store_transition(
        self,
        replay_buffer: ReplayBuffer,
        buffer_action: NDArray[Any],
        new_obs: NDArray[Any] | dict[str, NDArray[Any]],
        reward: NDArray[Any],
        dones: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        """Store the transitions of active slots with the log densities of their actions.

        Args:
            replay_buffer: The shared buffer.
            buffer_action: In [-1, 1], shape (n_slots, 2).
            new_obs: Shape (n_slots, size).
            reward: The task's own, shape (n_slots,).
            dones: Shape (n_slots,).
            infos: Of the crowd.
        """
        assert isinstance(replay_buffer, SharedReplayBuffer) and isinstance(new_obs, np.ndarray)
        next_obs = new_obs.copy()
        for slot in np.flatnonzero(dones):
            next_obs[slot] = infos[slot]["terminal_observation"]
        before = self._last_obs
        assert isinstance(before, np.ndarray)
        replay_buffer.store(before, next_obs, buffer_action, dones, infos, self._log_prob, reward)
        self._last_obs = self._last_original_obs = new_obs

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Leave updates for the next step of the scene.

        Args:
            gradient_steps: SAC updates.
            batch_size: The configuration's is taken.
        """
        self._due, self._rate = gradient_steps, self.lr_schedule(self._current_progress_remaining)

    def _catch_up(self) -> None:
        """Make the SAC updates that are due, with reward steps between them."""
        if not self._due:
            return
        self.logger.record("train/learning_rate", self._rate)
        for _ in range(self._due):
            begin = perf_counter()
            losses = self._update(self.replay_buffer.sample(self.config.batch_size), self._rate)
            self.updates += 1
            self._average_actor()
            self.seconds["sac"] += perf_counter() - begin
            if self.config.reward == "learned" and self.updates % self.config.updates_per_reward_step == 0:
                begin = perf_counter()
                self.reward_step()
                self.seconds["reward"] += perf_counter() - begin
        self._n_updates += self._due
        self._due = 0
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        for name, value in asdict(losses).items():
            self.logger.record(f"train/{name}", value)

    def reward_step(self) -> None:
        """One step of the reward network on the shared buffer."""
        config = self.config
        for group in self.reward_optimizer.param_groups:
            group["lr"] = self._rate
        if config.partition == "segment":
            states, log_prob = self.replay_buffer.sample_segments(config.batch_size, config.segment_length)
            policy, sequences = torch.as_tensor(states[:, 0]), torch.as_tensor(states)
            expert = self._expert_states(states[:, 0])
            expert_reward, segment_reward = self.reward_net(expert), self.reward_net(sequences)
            log_partition, effective = log_partition_importance(
                segment_reward.sum(dim=1), torch.as_tensor(log_prob).sum(dim=1)
            )
            log_partition, policy_reward = log_partition / config.segment_length, segment_reward[:, 0]
        else:
            states, log_prob = self.replay_buffer.sample_states(config.batch_size, config.absorbing_share)
            policy, expert = torch.as_tensor(states), self._expert_states(states)
            expert_reward, policy_reward = self.reward_net(torch.stack([expert, policy]))
            if config.partition == "importance":
                log_partition, effective = log_partition_importance(policy_reward, torch.as_tensor(log_prob))
            else:
                log_partition, effective = log_partition_fused(policy_reward, expert_reward)
        loss = irl_loss(expert_reward, log_partition)
        mix = torch.as_tensor(self.random.random((config.batch_size, 1)), dtype=torch.float32)
        penalty = gradient_penalty(self.reward_net, expert, policy, mix)
        size = 0.5 * (expert_reward**2).mean() + 0.5 * (policy_reward**2).mean()
        total = loss + config.gradient_penalty * penalty + config.output_penalty * size
        self.reward_optimizer.zero_grad()
        total.backward()
        self.reward_optimizer.step()
        self.logger.record("reward/loss", float(loss.detach()))
        self.logger.record("reward/expert", float(expert_reward.detach().mean()))
        self.logger.record("reward/policy", float(policy_reward.detach().mean()))
        self.logger.record("reward/effective_sample_size", float(effective.detach()))
        self.logger.record("reward/gradient_penalty", float(penalty.detach()))

    def _expert_states(self, policy: NDArray[np.float32]) -> torch.Tensor:
        like = policy if self.config.matching == "density" else None
        return torch.as_tensor(self.experts(len(policy), self.config.absorbing_share, self.random, like))

    def checkpoint(self) -> dict[str, Any]:
        """Everything that decides how the training goes on, between two steps of the scene.

        Returns:
            Tensors and plain values, readable with torch.load(weights_only=True).
        """
        assert self.log_ent_coef is not None  # of the automatic temperature
        return {
            "policy": self.policy.state_dict(),
            "average": self.average.state_dict(),
            "log_ent_coef": self.log_ent_coef.detach(),
            "optimizers": {name: adam.state() for name, adam in self._update.optimizers.items()},
            "reward_net": self.reward_net.state_dict(),
            "reward_optimizer": self.reward_optimizer.state_dict(),
            "num_timesteps": self.num_timesteps,
            "updates": self.updates,
            "n_updates": self._n_updates,
            "due": self._due,
            "rate": self._rate,
            "seconds": dict(self.seconds),
            "torch_random": torch.get_rng_state(),
            "random": json.dumps(self.random.bit_generator.state),
            "episodes": self._episode_num,
            "buffer": _as_tensors(self.replay_buffer.state()),
            "crowd": _as_tensors(self.crowd.state()),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Set everything to a checkpoint's: what follows is what would have followed, to the bit.

        Args:
            state: As `checkpoint` returns it.
        """
        assert self.log_ent_coef is not None  # of the automatic temperature
        self.policy.load_state_dict(state["policy"])
        self.average.load_state_dict(state["average"])
        for name, adam in self._update.optimizers.items():
            adam.restore(state["optimizers"][name])
        with torch.no_grad():
            self.log_ent_coef.copy_(state["log_ent_coef"])
        self.reward_net.load_state_dict(state["reward_net"])
        self.reward_optimizer.load_state_dict(state["reward_optimizer"])
        self.num_timesteps, self.updates = int(state["num_timesteps"]), int(state["updates"])
        self._n_updates, self._due, self._rate = int(state["n_updates"]), int(state["due"]), float(state["rate"])
        self.seconds = dict(state["seconds"])
        torch.set_rng_state(state["torch_random"])
        self.random.bit_generator.state = json.loads(state["random"])
        self._episode_num = int(state["episodes"])
        self.replay_buffer.restore(_as_arrays(state["buffer"]))
        # With a last observation `learn` does not reset the scene.
        self._last_obs = self._last_original_obs = self.crowd.restore(_as_arrays(state["crowd"]))


def _as_tensors(value: Any) -> Any:
    """Arrays as what torch reads back without running code, in dictionaries and lists."""
    return _each(value, lambda one: torch.from_numpy(one) if isinstance(one, np.ndarray) else one)


def _as_arrays(value: Any) -> Any:
    return _each(value, lambda one: one.numpy() if isinstance(one, torch.Tensor) else one)


def _each(value: Any, change: Callable[[Any], Any]) -> Any:
    if isinstance(value, Mapping):
        return {name: _each(one, change) for name, one in value.items()}
    return [_each(one, change) for one in value] if isinstance(value, list) else change(value)
