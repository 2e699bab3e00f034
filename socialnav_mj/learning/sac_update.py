"""One update of SAC, with the gradients written out.

The networks are small, so most of the time of stable-baselines3's own update goes into building graphs and walking
modules. This one takes the same steps in the same order on the same networks, optimizers and random numbers (Haarnoja
et al. 2018, doi 10.48550/arXiv.1812.05905) and gives the same weights up to rounding; a test holds that.
"""

import math
from dataclasses import dataclass
from typing import Any

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.sac.policies import LOG_STD_MAX, LOG_STD_MIN
from torch import Tensor, nn

_HALF_LOG_TWO_PI = 0.5 * math.log(2.0 * math.pi)
_EPSILON = 1e-6
"""In the logarithm of 1 - tanh^2, as in stable-baselines3's SquashedDiagGaussianDistribution."""


class _Layers:
    """Linear layers with ReLU between them."""

    def __init__(self, module: nn.Module) -> None:
        """Collect the layers.

        Args:
            module: nn.Sequential of linear layers and ReLUs, or one linear layer.

        Raises:
            TypeError: If there is anything else in it.
        """
        parts = list(module) if isinstance(module, nn.Sequential) else [module]
        self.linear = [part for part in parts if isinstance(part, nn.Linear)]
        self.ends_with_relu = isinstance(parts[-1], nn.ReLU)
        if len(self.linear) + sum(isinstance(part, nn.ReLU) for part in parts) != len(parts):
            raise TypeError(f"{module} has layers that are neither linear nor ReLU")

    def forward(self, value: Tensor) -> list[Tensor]:
        """Values before the first layer and after each, ReLU included.

        Args:
            value: Shape (n, size).

        Returns:
            One tensor a layer, and the argument before them.
        """
        values = [value]
        for number, layer in enumerate(self.linear):
            value = torch.addmm(layer.bias, value, layer.weight.t())
            if number < len(self.linear) - 1 or self.ends_with_relu:
                value = value.relu_()
            values.append(value)
        return values

    def backward(self, values: list[Tensor], gradient: Tensor, *, keep: bool, inputs: bool) -> Tensor:
        """Gradients of parameters and inputs.

        Args:
            values: As `forward` returns them.
            gradient: Of the last of them.
            keep: Whether to set the parameters' gradients.
            inputs: Whether the gradient of the first value is wanted.

        Returns:
            The gradient of the first value, or of the first layer's output if `inputs` is False.
        """
        for number in reversed(range(len(self.linear))):
            layer = self.linear[number]
            if number < len(self.linear) - 1 or self.ends_with_relu:
                gradient = torch.ops.aten.threshold_backward(gradient, values[number + 1], 0.0)
            if keep:
                layer.weight.grad = gradient.t() @ values[number]
                layer.bias.grad = gradient.sum(dim=0)
            if number or inputs:
                gradient = gradient @ layer.weight
        return gradient


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
        actor: Any = model.actor
        self.model = model
        self.body, self.mean, self.log_std = _Layers(actor.latent_pi), _Layers(actor.mu), _Layers(actor.log_std)
        self.critics = [_Layers(network) for network in model.critic.q_networks]
        self.targets = [_Layers(network) for network in model.critic_target.q_networks]
        pairs = zip(model.critic.parameters(), model.critic_target.parameters(), strict=True)
        self.online, self.delayed = map(list, zip(*pairs, strict=True))
        if len(self.critics) != 2:
            raise TypeError(f"two critics are expected, not {len(self.critics)}")
        if model.log_ent_coef is None or model.ent_coef_optimizer is None or model.use_sde:
            raise TypeError("an automatic temperature and no state-dependent exploration are expected")
        self.log_temperature, self.temperature_optimizer = model.log_ent_coef, model.ent_coef_optimizer

    @torch.no_grad()
    def __call__(self, batch: ReplayBufferSamples) -> Losses:
        """Take one step with the temperature, the critics and the actor, and let the target critics follow.

        Args:
            batch: Transitions.

        Returns:
            The losses.
        """
        model, count = self.model, len(batch.observations)
        both = self.body.forward(torch.cat([batch.observations, batch.next_observations]))
        mean, raw_log_std = self.mean.forward(both[-1])[-1], self.log_std.forward(both[-1])[-1]
        log_std = raw_log_std.clamp(LOG_STD_MIN, LOG_STD_MAX)
        size = mean.shape[1]
        noise = torch.cat([torch.randn(count, size), torch.randn(count, size)])
        spread = log_std.exp() * noise
        action = torch.tanh(mean + spread)
        slope = 1.0 - action**2
        log_prob = (-0.5 * noise**2 - log_std - _HALF_LOG_TWO_PI - torch.log(slope + _EPSILON)).sum(dim=1)

        temperature = float(self.log_temperature.exp())
        entropy_error = float(log_prob[:count].mean()) + float(model.target_entropy)
        entropy_loss = -float(self.log_temperature) * entropy_error
        self.log_temperature.grad = torch.full_like(self.log_temperature, -entropy_error)
        self.temperature_optimizer.step()

        following = torch.cat([batch.next_observations, action[count:]], dim=1)
        value = torch.minimum(*(target.forward(following)[-1][:, 0] for target in self.targets))
        value = value - temperature * log_prob[count:]
        goal = batch.rewards[:, 0] + (1.0 - batch.dones[:, 0]) * model.gamma * value

        taken = torch.cat([batch.observations, batch.actions], dim=1)
        critic_loss = 0.0
        for critic in self.critics:
            values = critic.forward(taken)
            error = values[-1] - goal[:, None]
            critic_loss += 0.5 * float((error**2).mean())
            critic.backward(values, error / count, keep=True, inputs=False)
        model.critic.optimizer.step()

        wanted = torch.cat([batch.observations, action[:count]], dim=1)
        forwards = [critic.forward(wanted) for critic in self.critics]
        first, second = (values[-1] for values in forwards)
        least = torch.minimum(first, second)
        share = torch.where(first < second, 1.0, torch.where(first > second, 0.0, 0.5))  # of equals half each
        of_action = sum(
            critic.backward(values, weight, keep=False, inputs=True)[:, -size:]
            for critic, values, weight in zip(self.critics, forwards, (share, 1.0 - share), strict=True)
        )
        actor_loss = temperature * float(log_prob[:count].mean()) - float(least.mean())
        action, slope = action[:count], slope[:count]
        of_sum = (temperature * 2.0 * action * slope / (slope + _EPSILON) - of_action * slope) / count
        of_log_std = of_sum * spread[:count] - temperature / count
        raw = raw_log_std[:count]
        of_log_std = of_log_std * ((raw >= LOG_STD_MIN) & (raw <= LOG_STD_MAX))
        seen = [values[:count] for values in both]
        of_body = self.mean.backward([seen[-1], mean], of_sum, keep=True, inputs=True)
        of_body = of_body + self.log_std.backward([seen[-1], raw], of_log_std, keep=True, inputs=True)
        self.body.backward(seen, of_body, keep=True, inputs=False)
        model.actor.optimizer.step()

        torch._foreach_lerp_(self.delayed, self.online, model.tau)
        return Losses(actor=actor_loss, critic=critic_loss, entropy=entropy_loss, entropy_coefficient=temperature)
