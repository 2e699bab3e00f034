"""The attention network and its learner: stable-baselines3's PPO on the transitions of agents alone."""

import json
from collections.abc import Generator, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn
from torch import Tensor, nn

from socialnav_mj.envs.sb3 import CrowdVecEnv
from socialnav_mj.features import SIGHT, People
from socialnav_mj.learning.attention_config import AttentionConfig

_OWN, _EACH, _COUNT = People.n_own, People.n_each, People.n_people


class AttentionExtractor(BaseFeaturesExtractor):
    """Own numbers and people pooled by attention, see `socialnav_mj.controllers.attention.AttentionPolicy`."""

    def __init__(self, observation_space: Any, width: int) -> None:
        """Make the layers.

        Args:
            observation_space: Of a slot.
            width: Of a person's embedding.
        """
        super().__init__(observation_space, _OWN + width)
        self.embed = nn.Sequential(nn.Linear(_OWN + _EACH, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())
        self.score = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, 1))
        self.value = nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width))

    def forward(self, observations: Tensor) -> Tensor:
        """Pool.

        Args:
            observations: States, shape (n, 78).

        Returns:
            Shape (n, 6 + width).
        """
        own = observations[:, :_OWN]
        each = observations[:, _OWN : People.size].reshape(-1, _EACH, _COUNT).transpose(1, 2)
        there = each[..., :1] > 0.5
        embedded = self.embed(torch.cat([own[:, None].expand(-1, _COUNT, -1), each], dim=2))
        mean = (embedded * there).sum(dim=1) / there.sum(dim=1).clamp(min=1)
        score = self.score(torch.cat([embedded, mean[:, None].expand(-1, _COUNT, -1)], dim=2))
        # Where there is nobody all scores are alike, and what they weigh is struck out.
        share = torch.softmax(score.masked_fill(~there, -1e9), dim=1) * there
        return torch.cat([own, (share * self.value(embedded)).sum(dim=1)], dim=1)


class AgentsOnly(RolloutBuffer):
    """Gives out the transitions of slots that held an agent; an empty slot's state is all 0."""

    random: np.random.Generator
    """Set by the learner: the order of the transitions."""

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Batches in random order.

        Args:
            batch_size: Transitions of each.

        Yields:
            Samples.
        """
        names = ("observations", "actions", "values", "log_probs", "advantages", "returns")
        rows = self.random.permutation(np.flatnonzero(self.observations.any(axis=2)))
        flat = {name: getattr(self, name).reshape(self.buffer_size * self.n_envs, -1) for name in names}
        size = batch_size or len(rows)
        for first in range(0, len(rows) - min(size, len(rows)) + 1, size):
            some = rows[first : first + size]
            own = {name: values[some] for name, values in flat.items()}
            yield RolloutBufferSamples(
                self.to_torch(own["observations"]),
                self.to_torch(own["actions"]),
                *(self.to_torch(own[name].ravel()) for name in ("values", "log_probs", "advantages", "returns")),
            )


class Engineered(VecEnvWrapper):
    """The reward of `attention`: the task's, less penalties for time, collisions and disturbing people.

    r = progress [m] + 5 at the goal - (5 + collision_penalty) at a collision - step_penalty
    - discomfort_weight * max(0, 1 - d / discomfort_distance), d the distance to the nearest person or agent; all times
    reward_scale.
    """

    def __init__(self, venv: CrowdVecEnv, config: AttentionConfig) -> None:
        """Wrap a crowd.

        Args:
            venv: The crowd.
            config: Of the training.
        """
        super().__init__(venv)
        self.crowd, self._config = venv, config

    def reset(self) -> NDArray[np.float32]:
        """Begin the scene.

        Returns:
            States.
        """
        return self.crowd.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """Step the scene.

        Returns:
            As the crowd's, with the engineered reward.
        """
        states, reward, dones, infos = self.crowd.step_wait()
        active = np.array([info["active"] for info in infos])
        config = self._config
        penalty = config.step_penalty + config.discomfort_weight * discomfort(states, config)
        reward = np.where(active, reward - penalty, 0.0)
        for slot in np.flatnonzero(dones):
            if infos[slot]["terminal_observation"][-1] > 0.5:
                reward[slot] -= config.collision_penalty
        return states, (config.reward_scale * reward).astype(np.float32), dones, infos


def discomfort(states: NDArray[np.float32], config: AttentionConfig) -> NDArray[np.float32]:
    """How far inside the discomfort distance the nearest person is.

    Args:
        states: Of the set "people", shape (n, 78).
        config: Gives the distance.

    Returns:
        max(0, 1 - d / distance), shape (n,); 0 where there is nobody.
    """
    ahead, left = (states[:, _OWN + quantity * _COUNT] * SIGHT for quantity in (1, 2))
    inside = np.maximum(0.0, 1.0 - np.hypot(ahead, left) / config.discomfort_distance)
    return (inside * (states[:, _OWN] > 0.5)).astype(np.float32)


class AttentionPPO(PPO):
    """PPO (Schulman et al. 2017, doi 10.48550/arXiv.1707.06347) that begins by imitating a guide."""

    rollout_buffer: AgentsOnly

    def __init__(self, crowd: CrowdVecEnv, config: AttentionConfig) -> None:
        """Make the network.

        Args:
            crowd: Where it learns.
            config: Of the training.
        """
        self.config, self.crowd = config, crowd
        super().__init__(
            "MlpPolicy",
            Engineered(crowd, config),
            learning_rate=lambda left: config.learning_rate * (0.1 + 0.9 * left),
            n_steps=config.rollout_steps,
            batch_size=config.batch_size,
            n_epochs=config.epochs,
            gamma=config.gamma,
            gae_lambda=config.gae_lambda,
            ent_coef=config.entropy_weight,
            rollout_buffer_class=AgentsOnly,
            policy_kwargs={
                "features_extractor_class": AttentionExtractor,
                "features_extractor_kwargs": {"width": config.width},
                "net_arch": [config.width, config.width],
                "activation_fn": nn.ReLU,
                "log_std_init": config.initial_log_std,
            },
            seed=config.seed,
            device="cpu",
        )
        self.random = np.random.default_rng(config.seed + 1)
        self.rollout_buffer.random = self.random

    @property
    def scene_steps(self) -> int:
        """Control steps of the training scene so far, without the demonstrations; SB3 counts one for every slot."""
        return self.num_timesteps // self.n_envs

    def imitate(self) -> float:
        """Watch the guide, then learn what it does and what comes of it: the first values of actor and critic.

        Returns:
            Mean squared error of the actions at the end.
        """
        config, env = self.config, self.env
        assert env is not None
        states = np.asarray(env.reset())
        seen, shown, rewards, ends, active = [], [], [], [], []
        for _ in range(config.demonstration_steps):
            action = np.clip(self.crowd.guide_action(), -1.0, 1.0)
            noise = self.random.normal(size=action.shape) * config.guide_noise
            seen.append(states)
            shown.append(action)
            after, reward, dones, infos = env.step(np.clip(action + noise, -1.0, 1.0))
            states = np.asarray(after)
            rewards.append(reward)
            ends.append(dones)
            active.append([info["active"] for info in infos])
        value = np.zeros(self.n_envs)
        returns = np.zeros((len(seen), self.n_envs))
        for step in reversed(range(len(seen))):
            value = rewards[step] + config.gamma * value * ~ends[step] * np.array(active[step])
            returns[step] = value
        mask = np.array(active)
        return self._fit(np.array(seen)[mask], np.array(shown, dtype=np.float32)[mask], returns[mask])

    def _fit(self, states: NDArray[Any], actions: NDArray[Any], returns: NDArray[Any]) -> float:
        people, error = People(), 0.0
        mirrored = np.concatenate([people.mirror(states[:, : People.size]), states[:, People.size :]], axis=1)
        size = self.config.batch_size
        for group in self.policy.optimizer.param_groups:
            group["lr"] = 2.0 * self.config.learning_rate
        for epoch in range(self.config.imitation_epochs):
            order, error = self.random.permutation(len(states)), 0.0
            for first in range(0, len(order), size):
                rows = order[first : first + size]
                inputs = torch.as_tensor((mirrored if epoch % 2 else states)[rows])
                target = torch.as_tensor(actions[rows] * ([1.0, -1.0] if epoch % 2 else [1.0, 1.0])).float()
                value = self.policy.predict_values(inputs)[:, 0]
                mean = self.policy.get_distribution(inputs).mode()
                wanted = torch.as_tensor(returns[rows]).float()
                action_loss = ((mean - target) ** 2).sum(dim=1).mean()
                loss = action_loss + 0.5 * ((value - wanted) ** 2).mean()
                self.policy.optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                self.policy.optimizer.step()
                error += float(action_loss.detach()) * len(rows) / len(order)
        return error

    def checkpoint(self) -> dict[str, Any]:
        """Everything that decides how the training goes on, between two rollouts.

        Returns:
            Tensors and plain values, readable with torch.load(weights_only=True).
        """
        crowd = self.crowd.state()
        assert self._last_episode_starts is not None
        return {
            "policy": self.policy.state_dict(),
            "optimizer": self.policy.optimizer.state_dict(),
            "num_timesteps": self.num_timesteps,
            "n_updates": self._n_updates,
            "torch_random": torch.get_rng_state(),
            "random": json.dumps(self.random.bit_generator.state),
            "episode_starts": torch.from_numpy(self._last_episode_starts),
            "crowd": {k: torch.from_numpy(v) if isinstance(v, np.ndarray) else v for k, v in crowd.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Set everything to a checkpoint's: what follows is what would have followed, to the bit.

        Args:
            state: As `checkpoint` returns it.
        """
        self.policy.load_state_dict(state["policy"])
        self.policy.optimizer.load_state_dict(state["optimizer"])
        self.num_timesteps, self._n_updates = int(state["num_timesteps"]), int(state["n_updates"])
        torch.set_rng_state(state["torch_random"])
        self.random.bit_generator.state = json.loads(state["random"])
        crowd = {k: v.numpy() if isinstance(v, Tensor) else v for k, v in state["crowd"].items()}
        # With a last observation `learn` does not reset the scene.
        self._last_obs = self._last_original_obs = self.crowd.restore(crowd)
        self._last_episode_starts = state["episode_starts"].numpy()
