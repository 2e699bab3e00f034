"""The reward network and the maximum-entropy loss with its estimates of the partition function.

The loss is the negative log-likelihood of paper eq 1 per state, -E_expert[r] + log Z (Ziebart et al. 2008; Finn et al.
2016, "Guided Cost Learning", PMLR 48, doi 10.48550/arXiv.1603.00448). log Z is estimated from the samples of the shared
replay buffer in one of three ways:

- "fused": log mean exp(r) over buffer samples and expert samples together, which keeps an expert state that the buffer
  does not know from getting an unbounded reward (Finn et al. 2016, section 4.3, fuse both sets likewise).
- "importance": every buffer state weighed by 1/q, q the density with which the behaviour policy chose the action that
  led to it (paper eq 2, a state at a time).
- "segment": paper eq 2 as printed, over segments of trajectories: sums of r and products of q along each segment.

The effective sample size, (sum w)^2 / sum w^2 with w the weights of the estimate, says how many samples it rests on.
"""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.parametrizations import spectral_norm

from socialnav_mj.features import COLLISION_FLAG, GOAL_FLAG
from socialnav_mj.learning.config import TrainingConfig


class RewardNet(nn.Module):
    """State-only reward r(s) in (-1, 1): ReLU layers and a tanh."""

    def __init__(self, state_size: int, hidden: Sequence[int], *, spectral: bool = False) -> None:
        """Make the network.

        Args:
            state_size: Length of a state, with flags.
            hidden: Widths of the hidden layers.
            spectral: Whether no linear layer may have a greater gain than 1.
        """
        super().__init__()
        layers: list[nn.Module] = []
        for width in hidden:
            layers += [_linear(state_size, width, spectral), nn.ReLU()]
            state_size = width
        self.layers = nn.Sequential(*layers, _linear(state_size, 1, spectral), nn.Tanh())

    def forward(self, state: Tensor) -> Tensor:
        """Reward of states.

        Args:
            state: Shape (..., state_size).

        Returns:
            Shape (...).
        """
        reward: Tensor = self.layers(state).squeeze(-1)
        return reward

    def gradient(self, state: Tensor) -> Tensor:
        """Gradient of the reward by the state, written out: torch differentiates it by the weights in one pass.

        Args:
            state: Shape (n, state_size).

        Returns:
            Shape (n, state_size).
        """
        linear = [layer for layer in self.layers if isinstance(layer, nn.Linear)]
        weights = [layer.weight for layer in linear]
        value, passes = state, []
        for layer, weight in zip(linear[:-1], weights[:-1], strict=True):
            value = torch.relu(functional.linear(value, weight, layer.bias))
            passes.append((value.detach() > 0.0).to(value.dtype))
        reward = torch.tanh(functional.linear(value, weights[-1], linear[-1].bias))
        gradient = (1.0 - reward**2) * weights[-1]
        for weight, let_through in zip(reversed(weights[:-1]), reversed(passes), strict=True):
            gradient = (gradient * let_through) @ weight
        return gradient


def _linear(size: int, width: int, spectral: bool) -> nn.Module:
    layer = nn.Linear(size, width)
    return spectral_norm(layer) if spectral else layer


def log_partition_fused(policy_reward: Tensor, expert_reward: Tensor) -> tuple[Tensor, Tensor]:
    """Estimate "fused".

    Args:
        policy_reward: Of buffer samples, shape (n,).
        expert_reward: Of expert samples, shape (m,).

    Returns:
        log Z and the effective sample size, scalars.
    """
    return _log_mean_exp(torch.cat([policy_reward, expert_reward]))


def log_partition_importance(policy_reward: Tensor, log_prob: Tensor) -> tuple[Tensor, Tensor]:
    """Estimate "importance"; also "segment", with sums along segments in place of single values.

    Args:
        policy_reward: Of buffer samples, shape (n,).
        log_prob: Log density of the behaviour policy for each, shape (n,).

    Returns:
        log Z up to a constant, and the effective sample size, scalars.
    """
    return _log_mean_exp(policy_reward - log_prob)


def _log_mean_exp(logit: Tensor) -> tuple[Tensor, Tensor]:
    total = torch.logsumexp(logit, dim=0)
    weight = torch.softmax(logit.detach(), dim=0)
    return total - torch.log(torch.tensor(float(len(logit)))), 1.0 / (weight**2).sum()


def irl_loss(expert_reward: Tensor, log_partition: Tensor) -> Tensor:
    """Negative log-likelihood of the expert per state (paper eq 1).

    Args:
        expert_reward: Shape (m,), or (m,) sums along segments.
        log_partition: Scalar estimate of log Z.

    Returns:
        Scalar.
    """
    return log_partition - expert_reward.mean()


def gradient_penalty(reward_net: RewardNet, expert: Tensor, policy: Tensor, mix: Tensor) -> Tensor:
    """Mean squared norm of the reward's gradient between expert and policy states.

    Args:
        reward_net: The network.
        expert: Shape (n, state_size).
        policy: Shape (n, state_size).
        mix: Shares of the expert in the mixture, shape (n, 1).

    Returns:
        Scalar.
    """
    return (reward_net.gradient(mix * expert + (1.0 - mix) * policy) ** 2).sum(dim=-1).mean()


RewardOf = Callable[[Tensor, Tensor, Tensor], Tensor]
"""From next states (n, size), whether the trip ended there (n, 1) and the task's own rewards (n, 1): rewards (n, 1)."""


def reward_for(config: TrainingConfig, reward_net: RewardNet) -> RewardOf:
    """The reward that a training asks for.

    Args:
        config: Its reward, and discount gamma: what an absorbing state gives at every step is worth r / (1 - gamma).
        reward_net: Asked at the moment of sampling, for reward="learned".

    Returns:
        A function that the replay buffer calls.
    """
    for_ever = 1.0 / (1.0 - config.gamma)

    def learned(next_state: Tensor, ended: Tensor, own: Tensor) -> Tensor:
        with torch.no_grad():
            reward = reward_net(next_state)[:, None]
        return torch.where(ended > 0.0, reward * for_ever, reward)

    def constant(next_state: Tensor, ended: Tensor, own: Tensor) -> Tensor:
        at_goal, collided = next_state[:, GOAL_FLAG, None], next_state[:, COLLISION_FLAG, None]
        absorbed = (config.goal_reward * at_goal + config.collision_reward * collided) * for_ever
        return torch.where(ended > 0.0, absorbed, config.step_reward)

    def task(next_state: Tensor, ended: Tensor, own: Tensor) -> Tensor:
        return own

    return {"learned": learned, "constant": constant, "task": task}[config.reward]
