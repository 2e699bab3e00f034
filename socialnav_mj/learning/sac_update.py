"""One update of SAC, with the gradients written out.

It takes the same steps as stable-baselines3's own, in the same order, on the same networks and random numbers (Haarnoja
et al. 2018, doi 10.48550/arXiv.1812.05905), and gives the same weights up to rounding; a test holds that. Its reasons
are those of `socialnav_mj.learning.networks`.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.sac.policies import LOG_STD_MAX, LOG_STD_MIN
from torch import nn

from socialnav_mj.learning.networks import Adam, Array, Parameters, Perceptrons

_HALF_LOG_TWO_PI = 0.5 * math.log(2.0 * math.pi)
_EPSILON = 1e-6
"""In the logarithm of 1 - tanh^2, as in stable-baselines3's SquashedDiagGaussianDistribution."""


@dataclass(frozen=True, kw_only=True)
class Losses:
    """Of one update, before it."""

    actor: float
    critic: float
    entropy: float
    entropy_coefficient: float


class SacUpdate:
    """Updates of one learner's networks."""

    def __init__(self, model: SAC) -> None:
        """Look up the layers.

        Args:
            model: With the networks of "MlpPolicy", ReLU and an automatic temperature.

        Raises:
            TypeError: If the networks are others.
        """
        if model.log_ent_coef is None or model.ent_coef_optimizer is None or model.use_sde:
            raise TypeError("an automatic temperature and no state-dependent exploration are expected")
        if len(model.critic.q_networks) != 2:
            raise TypeError(f"two critics are expected, not {len(model.critic.q_networks)}")
        self.model = model
        self.actor = actor_network(model.actor)
        self.critics = Perceptrons(model.critic.q_networks)
        self.targets = Perceptrons(model.critic_target.q_networks)
        self.log_temperature = Parameters([[model.log_ent_coef]])
        self.optimizers = {
            "actor": Adam(self.actor.parameters),
            "critic": Adam(self.critics.parameters),
            "temperature": Adam(self.log_temperature),
        }

    def __call__(self, batch: ReplayBufferSamples, learning_rate: float) -> Losses:
        """Take one step with the temperature, the critics and the actor, and let the target critics follow.

        Args:
            batch: Transitions.
            learning_rate: Of all three.

        Returns:
            The losses.
        """
        model, count = self.model, len(batch.observations)
        seen, following = batch.observations.numpy(), batch.next_observations.numpy()
        both = self.actor.forward(np.concatenate([seen, following]))
        size = both[-1].shape[-1] // 2
        noise = torch.cat([torch.randn(count, size), torch.randn(count, size)]).numpy()
        action, spread, log_prob = _squashed(both[-1][0], noise)
        slope = 1.0 - action**2

        log_temperature = float(self.log_temperature.flat[0])
        temperature = math.exp(log_temperature)
        entropy_error = float(log_prob[:count].mean()) + float(model.target_entropy)
        self.log_temperature.flat_gradient[0] = -entropy_error
        self.optimizers["temperature"].step(learning_rate)

        value = self.targets.forward(np.concatenate([following, action[count:]], axis=1))[-1][..., 0].min(axis=0)
        value -= temperature * log_prob[count:]
        goal = batch.rewards.numpy()[:, 0] + (1.0 - batch.dones.numpy()[:, 0]) * (model.gamma * value)
        values = self.critics.forward(np.concatenate([seen, batch.actions.numpy()], axis=1))
        error = values[-1] - goal[:, None]
        self.critics.backward(values, error / count)
        self.optimizers["critic"].step(learning_rate)

        action, slope, spread, raw = action[:count], slope[:count], spread[:count], both[-1][0, :count, size:]
        of_action, least = self._of_action(seen, action)
        of_sum = (temperature * 2.0 * action * slope / (slope + _EPSILON) - of_action * slope) / count
        of_log_std = of_sum * spread - temperature / count
        of_log_std *= (raw >= LOG_STD_MIN) & (raw <= LOG_STD_MAX)
        self.actor.backward(
            [both[0][:count], *(layer[:, :count] for layer in both[1:])],
            np.concatenate([of_sum, of_log_std], axis=1)[None],
        )
        self.optimizers["actor"].step(learning_rate)

        delayed = self.targets.parameters.flat
        delayed += model.tau * (self.critics.parameters.flat - delayed)
        return Losses(
            actor=temperature * float(log_prob[:count].mean()) - least,
            critic=0.5 * float((error**2).mean(axis=1).sum()),
            entropy=-log_temperature * entropy_error,
            entropy_coefficient=temperature,
        )

    def act(self, observation: Array) -> tuple[Array, Array]:
        """Draw actions of the actor.

        Args:
            observation: Shape (n, observation size).

        Returns:
            Actions in [-1, 1], shape (n, action size), and their log densities, shape (n,).
        """
        output = self.actor.forward(observation)[-1][0]
        action, _, log_prob = _squashed(output, torch.randn(len(output), output.shape[1] // 2).numpy())
        return action, log_prob

    def _of_action(self, observation: Array, action: Array) -> tuple[Array, float]:
        """Gradient of the lesser critic's value by the action, and the mean of that value."""
        values = self.critics.forward(np.concatenate([observation, action], axis=1))
        first, second = values[-1]
        share = np.where(first < second, 1.0, np.where(first > second, 0.0, 0.5)).astype(np.float32)  # of equals half
        of_both = self.critics.backward_to_inputs(values, np.stack([share, 1.0 - share]), observation.shape[1])
        return of_both.sum(axis=0), float(np.minimum(first, second).mean())


def _squashed(output: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Actions of the actor's output and standard normal noise, what noise moves them by before tanh, log densities."""
    mean, raw_log_std = np.split(output, 2, axis=1)
    log_std = raw_log_std.clip(LOG_STD_MIN, LOG_STD_MAX)
    spread = np.exp(log_std) * noise
    action = torch.tanh(torch.from_numpy(mean + spread)).numpy()  # rounded as the library does, near 1
    log_prob = -0.5 * noise**2 - log_std - _HALF_LOG_TWO_PI - np.log(1.0 - action**2 + _EPSILON)
    return action, spread, log_prob.sum(axis=1)


def actor_network(actor: Any) -> Perceptrons:
    """An actor's layers, mean and log standard deviation in the place of one last layer.

    Args:
        actor: Of stable-baselines3's SAC.

    Returns:
        One network; its last layer gives (n, 2 * action size).

    Raises:
        TypeError: If the actor's layers are not linear with ReLU between them.
    """
    heads, size = (actor.mu, actor.log_std), actor.mu.out_features
    last = nn.Linear(actor.mu.in_features, 2 * size, device="meta")
    last.weight = nn.Parameter(torch.cat([head.weight.detach() for head in heads]))
    last.bias = nn.Parameter(torch.cat([head.bias.detach() for head in heads]))
    network = Perceptrons([nn.Sequential(*actor.latent_pi, last)])
    for part, head in enumerate(heads):
        rows = slice(part * size, (part + 1) * size)
        head.weight.data, head.bias.data = last.weight.data[rows], last.bias.data[rows]
    return network
