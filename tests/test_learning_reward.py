"""The maximum-entropy loss on a Markov chain small enough to enumerate every trajectory."""

import itertools

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from socialnav_mj.learning.reward import (  # noqa: E402
    RewardNet,
    gradient_penalty,
    irl_loss,
    log_partition_fused,
    log_partition_importance,
)

N_STATES, LENGTH = 4, 3
BEHAVIOUR = torch.tensor([0.5, 0.25, 0.25], dtype=torch.float64)
"""Of moving on, staying and moving back on the ring: multiples of 1/4, so that counts can be exact."""


def chain():
    """All 27 trajectories of 3 moves on a ring of 4 states that begin in state 0.

    Returns:
        How often each visits each state (27, 4), and its probability under the behaviour policy (27,).
    """
    visits, density = [], []
    for moves in itertools.product(range(3), repeat=LENGTH):
        states = np.cumsum([(1, 0, -1)[move] for move in moves]) % N_STATES
        visits.append(np.bincount(states, minlength=N_STATES))
        density.append(float(torch.prod(BEHAVIOUR[list(moves)])))
    return torch.tensor(np.array(visits), dtype=torch.float64), torch.tensor(density, dtype=torch.float64)


def behaviour_samples():
    """Rows of `chain` as often as a perfect sample of 64 holds them."""
    _, density = chain()
    return torch.repeat_interleave(torch.arange(27), (64 * density).round().long())


TRUE = torch.tensor([-0.5, 0.2, 1.0, 0.6], dtype=torch.float64)


def expert_visits(reward):
    """Expected visits of p(trajectory) proportional to exp(sum of rewards), by enumeration."""
    visits, _ = chain()
    return torch.softmax(visits @ reward, dim=0) @ visits


def segment_loss(reward):
    """Paper eqs 1-2 with the behaviour's samples; the expert's mean is exact."""
    visits, density = chain()
    rows = behaviour_samples()
    log_partition, _ = log_partition_importance(visits[rows] @ reward, torch.log(density[rows]))
    return irl_loss((expert_visits(TRUE) @ reward)[None], log_partition)


def minimum_of(loss, size=N_STATES):
    """Reward table that minimises a loss."""
    reward = torch.zeros(size, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.LBFGS(
        [reward], max_iter=500, tolerance_grad=1e-10, tolerance_change=0.0, line_search_fn="strong_wolfe"
    )

    def closure():
        optimizer.zero_grad()
        value = loss(reward)
        value.backward()
        return value

    optimizer.step(closure)
    return reward.detach()


def centred(values):
    return (values - values.mean()).numpy()


# The partition function


def test_segment_partition_is_the_sum_over_all_trajectories():
    """E_q[exp(R) / q] is Z: 64 samples in exact proportion give log sum exp(R) of the 27 trajectories."""
    visits, density = chain()
    rows = behaviour_samples()
    assert len(rows) == 64
    found, _ = log_partition_importance(visits[rows] @ TRUE, torch.log(density[rows]))
    torch.testing.assert_close(found, torch.logsumexp(visits @ TRUE, dim=0), rtol=1e-8, atol=0.0)


def test_importance_partition_is_the_sum_over_all_states():
    """The same a state at a time: q = 1/2, 1/4, 1/8, 1/8."""
    rows = torch.repeat_interleave(torch.arange(4), torch.tensor([4, 2, 1, 1]))
    log_prob = torch.log(torch.tensor([0.5, 0.25, 0.125, 0.125], dtype=torch.float64))
    found, _ = log_partition_importance(TRUE[rows], log_prob[rows])
    torch.testing.assert_close(found, torch.logsumexp(TRUE, dim=0), rtol=1e-8, atol=0.0)


def test_fused_partition_is_the_mean_over_both_sets():
    """log((e^0 + e^1 + e^2) / 3); two of the policy's, one of the expert's."""
    found, _ = log_partition_fused(torch.tensor([0.0, 1.0]), torch.tensor([2.0]))
    assert float(found) == pytest.approx(np.log((1.0 + np.e + np.e**2) / 3.0), rel=1e-6)


def test_partition_does_not_overflow():
    for found, effective in (
        log_partition_fused(torch.tensor([1000.0, 1000.0]), torch.tensor([-1000.0])),
        log_partition_importance(torch.tensor([900.0, 900.0, -1e4]), torch.tensor([-100.0, -100.0, 0.0])),
    ):
        assert float(found) == pytest.approx(1000.0 + np.log(2.0 / 3.0))
        assert float(effective) == pytest.approx(2.0)


def test_effective_sample_size_is_the_formula():
    """Weights 1, 2, 3: 36 / 14; equal weights: their number; one that outweighs all: 1; no gradient flows through."""
    weight = torch.tensor([1.0, 2.0, 3.0], requires_grad=True)
    _, effective = log_partition_importance(torch.zeros(3), -torch.log(weight))
    assert float(effective.detach()) == pytest.approx(36.0 / 14.0) and not effective.requires_grad
    assert float(log_partition_fused(torch.full((5,), 0.3), torch.full((7,), 0.3))[1]) == pytest.approx(12.0)
    assert float(log_partition_importance(torch.tensor([50.0, 0.0, 0.0]), torch.zeros(3))[1]) == pytest.approx(1.0)


# The gradient


def test_gradient_is_the_models_visits_less_the_experts():
    """The slope along r is E under exp(R) / Z - E under the expert, both by enumeration; 0 at the true reward."""
    for values in (torch.zeros(N_STATES, dtype=torch.float64), torch.tensor([0.3, -1.0, 0.5, 2.0]).double(), TRUE):
        reward = values.clone().requires_grad_(True)
        segment_loss(reward).backward()
        torch.testing.assert_close(reward.grad, expert_visits(values) - expert_visits(TRUE), rtol=0.0, atol=1e-12)


def test_gradient_of_the_whole_loss_is_that_of_finite_differences():
    """Through the network, with every estimate and the gradient penalty, in double precision."""
    torch.manual_seed(0)
    net = RewardNet(N_STATES, (5,)).double()
    expert, policy = torch.randn(6, N_STATES).double(), torch.randn(9, N_STATES).double()
    log_prob, mix = torch.randn(9).double(), torch.rand(6, 1).double()
    names = [name for name, _ in net.named_parameters()]

    def loss(*parameters):
        def reward(states):
            return torch.func.functional_call(net, dict(zip(names, parameters, strict=True)), states)

        expert_reward, policy_reward = reward(expert), reward(policy)
        between = (mix * expert + (1.0 - mix) * policy[:6]).requires_grad_(True)
        (slope,) = torch.autograd.grad(reward(between).sum(), between, create_graph=True)
        return (
            irl_loss(expert_reward, log_partition_fused(policy_reward, expert_reward)[0])
            + irl_loss(expert_reward, log_partition_importance(policy_reward, log_prob)[0])
            + (slope**2).sum(dim=-1).mean()
        )

    parameters = tuple(p.detach().clone().requires_grad_(True) for p in net.parameters())
    assert torch.autograd.gradcheck(loss, parameters, atol=1e-7)


@pytest.mark.parametrize("spectral", [False, True])
@pytest.mark.parametrize("hidden", [(), (5,), (6, 5)], ids=str)
def test_written_gradient_is_that_of_automatic_differentiation(hidden, spectral):
    """By the state, and the penalty's by the weights."""
    torch.manual_seed(1)
    net = RewardNet(N_STATES, hidden, spectral=spectral).double().eval()  # spectral norms stand still in evaluation
    expert, policy, mix = (
        torch.randn(9, N_STATES).double(),
        torch.randn(9, N_STATES).double(),
        torch.rand(9, 1).double(),
    )
    between = (mix * expert + (1.0 - mix) * policy).requires_grad_(True)
    (expected,) = torch.autograd.grad(net(between).sum(), between, create_graph=True)
    torch.testing.assert_close(net.gradient(between), expected)
    penalty = gradient_penalty(net, expert, policy, mix)
    torch.testing.assert_close(penalty, (expected**2).sum(dim=-1).mean())
    weights = [p for p in net.parameters() if p.dim() > 1]
    found = torch.autograd.grad(penalty, weights)
    for one, other in zip(found, torch.autograd.grad((expected**2).sum(dim=-1).mean(), weights), strict=True):
        torch.testing.assert_close(one, other)
        assert (one != 0.0).any()


def test_gradient_penalty_looks_between_expert_and_policy():
    """Of r = tanh(x) the slope at 0.25 * 4 + 0.75 * 0 is 1 - tanh(1)^2."""
    net = RewardNet(1, ())
    with torch.no_grad():
        net.layers[0].weight.fill_(1.0)
        net.layers[0].bias.zero_()
    penalty = gradient_penalty(net, torch.tensor([[4.0]]), torch.tensor([[0.0]]), torch.tensor([[0.25]]))
    assert float(penalty.detach()) == pytest.approx((1.0 - np.tanh(1.0) ** 2) ** 2)


# What the loss learns


def test_minimum_of_the_segment_loss_is_the_true_reward():
    """Up to a constant, which no trajectory of fixed length can tell."""
    found = minimum_of(segment_loss)
    np.testing.assert_allclose(centred(found), centred(TRUE), atol=1e-5)
    assert found.argsort().tolist() == TRUE.argsort().tolist()


def test_minimum_of_the_importance_loss_is_the_log_density_of_the_expert():
    """Per state p = exp(r) / Z, whatever the behaviour."""
    density = torch.softmax(TRUE, dim=0)
    rows = torch.repeat_interleave(torch.arange(4), torch.tensor([1, 2, 4, 1]))
    log_prob = torch.log(torch.tensor([0.125, 0.25, 0.5, 0.125], dtype=torch.float64))
    found = minimum_of(lambda r: irl_loss((density @ r)[None], log_partition_importance(r[rows], log_prob[rows])[0]))
    np.testing.assert_allclose(centred(found), centred(TRUE), atol=1e-5)


def test_minimum_of_the_fused_loss_is_the_log_ratio_to_the_mixture():
    """Expert e, behaviour b: r = log e - log (e + b) / 2 + c. Bounded where b = 0, ranked as e where b is even."""
    expert_rows = torch.tensor([0, 1, 1, 2, 2, 2, 2, 3])
    for policy_rows in (torch.tensor([0, 1, 2, 3, 0, 1, 2, 3]), torch.tensor([0, 0, 0, 1, 1, 1, 3, 3])):

        def loss(r, policy_rows=policy_rows):
            return irl_loss(r[expert_rows], log_partition_fused(r[policy_rows], r[expert_rows])[0])

        expert, policy = (torch.bincount(rows, minlength=4).double() / 8.0 for rows in (expert_rows, policy_rows))
        expected = torch.log(expert) - torch.log(0.5 * (expert + policy))
        np.testing.assert_allclose(centred(minimum_of(loss)), centred(expected), atol=1e-5)
    assert float(expected[2]) == pytest.approx(np.log(2.0))  # a state that the behaviour never visits


def test_a_network_recovers_the_ranking_from_samples():
    """As in training: the network, 400 expert trajectories, sampled behaviour; the truth is enumerated."""
    torch.manual_seed(0)
    visits, density = chain()
    expert = visits[torch.multinomial(torch.softmax(3.0 * visits @ TRUE, dim=0), 400, replacement=True)].float()
    rows = torch.multinomial(density, 400, replacement=True)
    net = RewardNet(N_STATES, (16,))
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-2)
    for _ in range(200):
        reward = net(torch.eye(N_STATES))
        log_partition, _ = log_partition_importance(visits[rows].float() @ reward, torch.log(density[rows]).float())
        loss = irl_loss(expert @ reward, log_partition)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert reward.argsort().tolist() == TRUE.argsort().tolist()


def test_reward_is_bounded_and_keeps_leading_shapes():
    net = RewardNet(5, (8, 8))
    reward = net(100.0 * torch.randn(3, 4, 5))
    assert reward.shape == (3, 4) and float(reward.detach().abs().max()) <= 1.0
    assert net(torch.zeros(5)).shape == ()
