"""The update of SAC that is written out, beside stable-baselines3's own."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import gymnasium  # noqa: E402
from stable_baselines3 import SAC  # noqa: E402
from stable_baselines3.common.logger import configure  # noqa: E402
from stable_baselines3.common.type_aliases import ReplayBufferSamples  # noqa: E402

from socialnav_mj.learning.sac_update import SacUpdate  # noqa: E402

SIZE, COUNT = 7, 32


class Anything(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (SIZE,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)


def learner(*, log_std: float = -0.5, **changes) -> SAC:
    kwargs = {"policy_kwargs": {"net_arch": [8, 8]}, "target_entropy": -0.5, "gamma": 0.9, "tau": 0.1, **changes}
    model = SAC("MlpPolicy", Anything(), buffer_size=1, seed=0, device="cpu", learning_rate=0.01, **kwargs)
    model.set_logger(configure(None, []))
    if not model.use_sde:
        torch.nn.init.constant_(model.actor.log_std.bias, log_std)
    return model


def batches(count: int) -> list[ReplayBufferSamples]:
    random = torch.Generator().manual_seed(1)
    return [
        ReplayBufferSamples(
            torch.randn(COUNT, SIZE, generator=random),
            2.0 * torch.rand(COUNT, 2, generator=random) - 1.0,
            torch.randn(COUNT, SIZE, generator=random),
            (torch.rand(COUNT, 1, generator=random) < 0.2).float(),
            torch.randn(COUNT, 1, generator=random),
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize("log_std", [-0.5, 2.0], ids=["usual", "at the clamp"])
def test_gradients_are_those_of_automatic_differentiation(log_std, monkeypatch):
    """Forty updates from the same start, on the same samples and random numbers."""
    theirs, ours = learner(log_std=log_std), learner(log_std=log_std)
    samples = iter(batches(40))
    monkeypatch.setattr(theirs.replay_buffer, "sample", lambda *_args, **_kwargs: next(samples))
    before = [value.clone() for value in ours.policy.state_dict().values()]
    torch.manual_seed(2)
    theirs.train(40, COUNT)
    torch.manual_seed(2)
    update = SacUpdate(ours)
    for batch in batches(40):
        update(batch, 0.01)
    expected, found = theirs.policy.state_dict(), ours.policy.state_dict()
    assert all((a != b).any() for a, b in zip(before, found.values(), strict=True) if a.dim() > 1)
    for name in expected:
        torch.testing.assert_close(found[name], expected[name], atol=2e-5, rtol=1e-4, msg=name)
    torch.testing.assert_close(ours.log_ent_coef, theirs.log_ent_coef)


def test_losses_are_the_librarys(monkeypatch):
    theirs, ours = learner(), learner()
    (batch,) = batches(1)
    monkeypatch.setattr(theirs.replay_buffer, "sample", lambda *_args, **_kwargs: batch)
    torch.manual_seed(2)
    theirs.train(1, COUNT)
    torch.manual_seed(2)
    losses = SacUpdate(ours)(batch, 0.01)
    logged = theirs.logger.name_to_value
    assert losses.actor == pytest.approx(logged["train/actor_loss"], rel=1e-5)
    assert losses.critic == pytest.approx(logged["train/critic_loss"], rel=1e-5)
    assert losses.entropy == pytest.approx(logged["train/ent_coef_loss"], abs=1e-6)
    assert losses.entropy_coefficient == pytest.approx(logged["train/ent_coef"], rel=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {"ent_coef": 0.1},
        {"use_sde": True},
        {"policy_kwargs": {"net_arch": [8], "activation_fn": torch.nn.Tanh}},
        {"policy_kwargs": {"net_arch": [8], "n_critics": 3}},
    ],
    ids=str,
)
def test_learners_of_another_kind_are_refused(changes):
    with pytest.raises(TypeError):
        SacUpdate(learner(**changes))
