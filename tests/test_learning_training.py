"""ReplayIRL as a whole on the smallest crowd: what is stored, learned, saved, resumed and refused."""

import json
import math
from concurrent.futures import Future

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from scenes import TINY  # noqa: E402
from scipy.stats import norm  # noqa: E402
from stable_baselines3.common.callbacks import BaseCallback  # noqa: E402

from socialnav_mj.config import Scenario  # noqa: E402
from socialnav_mj.controllers.replay_irl import load_policy  # noqa: E402
from socialnav_mj.envs.guided import CrowdSettings  # noqa: E402
from socialnav_mj.envs.sb3 import CrowdVecEnv  # noqa: E402
from socialnav_mj.features import feature_set  # noqa: E402
from socialnav_mj.learning.config import TrainingConfig  # noqa: E402
from socialnav_mj.learning.experts import Demonstrations, ExpertSampler, demonstrate  # noqa: E402
from socialnav_mj.learning.policy_file import save_policy  # noqa: E402
from socialnav_mj.learning.replay_irl import ReplayIRL  # noqa: E402
from socialnav_mj.learning.training import train  # noqa: E402
from socialnav_mj.learning.validation import is_kept  # noqa: E402
from socialnav_mj.recordings import load_recording  # noqa: E402

SMALL = TrainingConfig(
    datasets=(str(TINY),),
    train_window=(0.0, 1.0),
    validation_window=(0.0, 1.0),
    test_window=(0.0, 1.0),
    scene_steps=500,
    shares=(0.4, 1.0),
    n_slots=3,
    hidden=(16,),
    batch_size=32,
    updates_per_scene_step=1,
    guided_scene_steps=100,
    buffer_size=2000,
    checkpoint_every=200,
    validation_shares=(0.7,),
)


def small(**changes) -> TrainingConfig:
    return TrainingConfig(**{**{n: getattr(SMALL, n) for n in SMALL.__dataclass_fields__}, **changes})


def model_of(config: TrainingConfig) -> ReplayIRL:
    """A fresh learner on the smallest crowd."""
    recording, features = load_recording(config.datasets[0]), feature_set(config.features)
    settings = CrowdSettings(
        recordings=[recording],
        features=features,
        shares=config.shares,
        n_slots=config.n_slots,
        robot_radius=config.robot_radius,
        pedestrian_radius=config.pedestrian_radius,
        turn_limit=config.turn_limit,
        guide=config.guide,
    )
    env = CrowdVecEnv(settings, seed=config.seed)
    experts = demonstrate(
        recording, features, Scenario(share=1.0), minimum_displacement=2.0, contact_distance=0.25, clearance=0.0
    )
    torch.set_num_threads(1)
    return ReplayIRL(env, experts, features, config)


def learned(config: TrainingConfig, scene_steps: int, callback=None) -> ReplayIRL:
    model = model_of(config)
    return model.learn(scene_steps * config.n_slots, callback=callback, log_interval=None)


def assert_same(one, other, path="", ignored=()):
    """Equal values in nested dictionaries and lists, but for keys that are ignored."""
    if isinstance(one, dict):
        assert one.keys() == other.keys(), path
        for key in one:
            if key not in ignored:
                assert_same(one[key], other[key], f"{path}/{key}", ignored)
    elif isinstance(one, list | tuple):
        assert len(one) == len(other), path
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            assert_same(a, b, f"{path}/{i}", ignored)
    elif isinstance(one, torch.Tensor | np.ndarray):
        assert np.array_equal(np.asarray(one), np.asarray(other)), path
    else:
        assert one == other, path


# What is stored


def test_transitions_follow_each_other_and_end_in_absorbing_states():
    """Over several scenes: a run's next state is its following transition's state; flags are raised only at the end."""
    model = learned(small(guided_scene_steps=1000), 400)
    buffer = model.replay_buffer
    size = buffer.size()
    previous = buffer.previous[:size]
    inner = np.flatnonzero(previous >= 0)
    assert len(inner) > 0.8 * size
    np.testing.assert_array_equal(buffer.observations[inner], buffer.next_observations[previous[inner]])
    assert (buffer.runs[inner] == buffer.runs[previous[inner]]).all()
    assert not buffer.dones[previous[inner]].any()
    done, late = buffer.dones[:size, 0] == 1.0, buffer.timeouts[:size, 0] == 1.0
    flags = buffer.next_observations[:size, 0, -2:].sum(axis=1)
    np.testing.assert_array_equal(flags, (done & ~late).astype(float))
    assert done.sum() >= 3 and not (late & ~done).any()
    assert not buffer.observations[:size, 0, -2:].any()
    assert (np.abs(buffer.observations[:size, 0]).sum(axis=1) > 0.0).all()  # no empty slot


class RecordGuide(BaseCallback):
    """Keeps the guide's action of every step."""

    def _on_rollout_start(self) -> None:
        self.guided = self.model.crowd.guide_action()

    def _on_step(self) -> bool:
        self.seen = [*getattr(self, "seen", []), (self.guided, [i["active"] for i in self.locals["infos"]])]
        return True


def test_log_density_of_the_guides_actions_is_the_noises():
    """Normal around the guide's own action, wherever the limits did not clip it."""
    config, callback = small(guided_scene_steps=1000), RecordGuide()
    buffer = learned(config, 60, callback).replay_buffer
    guided = np.concatenate([action[active] for action, active in callback.seen])
    # The callback of a step sees it before it is stored: all but nothing is there, in the same order.
    size = buffer.size()
    assert len(guided) == size
    action = buffer.actions[:size, 0]
    inside = (np.abs(action) < 1.0).all(axis=1)
    assert 0.2 < inside.mean() < 1.0
    expected = norm.logpdf(action, guided, config.guide_noise).sum(axis=1)
    np.testing.assert_allclose(buffer.log_probs[:size][inside], expected[inside], atol=1e-3)


def test_log_density_of_the_actors_actions_is_its_squashed_normals(monkeypatch):
    """Against the closed form: normal density of atanh(a) over 1 - a^2; the actor stays as it is."""
    monkeypatch.setattr(ReplayIRL, "train", lambda *args, **kwargs: None)
    model = learned(small(guided_scene_steps=1), 60)
    buffer = model.replay_buffer
    rows = slice(3, buffer.size())  # the guide's step stored at most 3
    state, action = torch.as_tensor(buffer.observations[rows, 0]), buffer.actions[rows, 0].astype(float)
    with torch.no_grad():
        mean, log_std, _ = model.actor.get_action_dist_params(state)
    inside = (np.abs(action) < 0.99).all(axis=1)
    assert inside.sum() > 20
    density = norm.logpdf(np.arctanh(action[inside]), mean.numpy()[inside], np.exp(log_std.numpy()[inside]))
    expected = (density - np.log1p(-(action[inside] ** 2))).sum(axis=1)
    np.testing.assert_allclose(buffer.log_probs[rows][inside], expected, atol=2e-3)


# What is learned


@pytest.mark.parametrize(
    "changes",
    [
        {"partition": "fused"},
        {"partition": "importance"},
        {"partition": "segment"},
        {"matching": "density"},
        {"spectral_norm": True},
    ],
    ids=str,
)
def test_reward_steps_prefer_the_experts_states_to_the_buffers(changes):
    """The experts stand near their goals, the buffer far from them; no step of the environment is needed."""
    config = small(absorbing_share=0.0, segment_length=3, **changes)
    model = model_of(config)
    model.set_logger(quiet())
    size = model.features.size + 2
    near, far = np.zeros((2, size), dtype=np.float32)
    near[3], far[2] = 1.0, 1.0
    experts = Demonstrations(running=np.tile(near, (20, 1)), absorbed=np.zeros((1, size)))
    model.experts = ExpertSampler(experts, model.features)
    infos = [{"active": True}] * 3
    for _ in range(50):
        states = np.tile(far, (3, 1))
        model.replay_buffer.store(
            states, states, np.zeros((3, 2)), np.zeros(3, dtype=bool), infos, np.zeros(3), np.zeros(3)
        )
    steps, before = model.num_timesteps, difference(model, near, far)
    for _ in range(100):
        model.reward_step()
    assert difference(model, near, far) > max(before, 0.0) + 0.2
    assert model.num_timesteps == steps
    values = model.logger.name_to_value
    assert 1.0 <= values["reward/effective_sample_size"] <= 2 * config.batch_size
    assert values["reward/expert"] > values["reward/policy"]


def difference(model, one, other):
    with torch.no_grad():
        reward = model.reward_net(torch.as_tensor(np.stack([one, other])))
    return float(reward[0] - reward[1])


def quiet():
    from stable_baselines3.common.logger import Logger

    return Logger(folder=None, output_formats=[])


def test_reward_steps_come_every_so_many_updates():
    config = small(guided_scene_steps=10, updates_per_scene_step=2, updates_per_reward_step=4)
    calls = []
    model = model_of(config)
    model.reward_step = lambda: calls.append(model.updates)
    model.learn(21 * config.n_slots, log_interval=None)
    assert model.updates == 20  # 10 steps after the guide's, 2 updates each while the next one is made
    assert calls == [4, 8, 12, 16, 20]


@pytest.mark.parametrize("reward", ["constant", "task"])
def test_plain_rewards_leave_the_reward_network_alone(reward):
    config = small(guided_scene_steps=10, reward=reward)
    model = model_of(config)
    before = {name: value.clone() for name, value in model.reward_net.state_dict().items()}
    model.learn(20 * config.n_slots, log_interval=None)
    assert model.updates > 0
    assert all(torch.equal(before[name], value) for name, value in model.reward_net.state_dict().items())


def test_reward_of_spectral_norm_is_the_networks_in_numpy_too(tmp_path):
    config = small(spectral_norm=True, guided_scene_steps=10)
    model = learned(config, 20)
    save_policy(model, tmp_path / "p.safetensors", {"config": config.as_dict()})
    state = np.random.default_rng(0).normal(size=(50, model.features.size + 2))
    model.reward_net.eval()
    with torch.no_grad():
        expected = model.reward_net(torch.as_tensor(state, dtype=torch.float32)).numpy()
    np.testing.assert_allclose(load_policy(str(tmp_path / "p.safetensors")).reward_of(state), expected, atol=1e-5)
    for layer in (module for module in model.reward_net.layers if isinstance(module, torch.nn.Linear)):
        assert float(torch.linalg.matrix_norm(layer.weight.detach(), 2)) < 1.2


def test_crowd_turns_as_fast_as_the_turn_limit_says():
    for turn_limit, rate in (("per_step", np.pi / 6.0 / 0.2), ("per_second", np.pi / 6.0)):
        assert model_of(small(turn_limit=turn_limit)).crowd._crowd.limits.max_yaw_rate == pytest.approx(rate)


def test_average_weighs_each_updates_actor_by_its_number():
    """Power 1: the actor after update t counts as t."""
    config = small(guided_scene_steps=10, averaging_power=1.0)
    model = model_of(config)
    seen = []
    keep = model._average_actor
    model._average_actor = lambda: (seen.append(model.actor.mu.bias.detach().clone()), keep())
    model.learn(16 * config.n_slots, log_interval=None)
    expected = sum(number * bias for number, bias in enumerate(seen, start=1)) / sum(range(1, len(seen) + 1))
    assert len(seen) == 5 and not torch.equal(seen[0], seen[-1])
    torch.testing.assert_close(model.average.mu.bias, expected)


# Saving


@pytest.mark.parametrize("features", ["continuous", "risk"])
def test_saved_policy_acts_as_the_average_actor(features, tmp_path):
    """Numpy equals torch within 1e-6, and a policy that was saved and loaded twice acts the same to the bit."""
    config = small(features=features, hidden=(16, 16), guided_scene_steps=10)
    model = learned(config, 20)
    policies = []
    for name in ("a.safetensors", "b.safetensors"):
        save_policy(model, tmp_path / name, {"config": config.as_dict()})
        policies.append(load_policy(str(tmp_path / name)))
    state = np.random.default_rng(0).normal(size=(200, feature_set(features).size + 2))
    action = policies[0].action(state)
    np.testing.assert_array_equal(action, policies[1].action(state))
    latest, _ = model.predict(state.astype(np.float32), deterministic=True)
    assert np.abs(action - latest).max() > 1e-4
    model.actor.load_state_dict(model.average.state_dict())
    expected, _ = model.predict(state.astype(np.float32), deterministic=True)
    np.testing.assert_allclose(action, expected, atol=1e-6)
    with torch.no_grad():
        reward = model.reward_net(torch.as_tensor(state, dtype=torch.float32)).numpy()
    np.testing.assert_allclose(policies[0].reward_of(state), reward, atol=1e-6)
    assert policies[0].card["config"]["features"] == features


def test_checkpoint_restores_everything(tmp_path):
    """What follows is what would have followed: through a file that runs no code, in the middle of a scene."""
    config = small(guided_scene_steps=10)
    model, other = learned(config, 30), model_of(config)
    torch.save(model.checkpoint(), tmp_path / "c.pt")
    other.restore(torch.load(tmp_path / "c.pt", weights_only=True))
    assert model.updates > 0 and other.updates == model.updates and model.crowd.state()["actions"].size
    assert_same(other.checkpoint(), model.checkpoint(), ignored=("seconds",))
    random = torch.get_rng_state()  # all learners of a process share it
    for learner in (model, other):
        torch.set_rng_state(random)
        learner.learn(40 * config.n_slots, log_interval=None, reset_num_timesteps=False)
    assert model.updates == 59  # that of the last step is due
    assert_same(other.checkpoint(), model.checkpoint(), ignored=("seconds",))


@pytest.mark.parametrize(("steps", "is_first"), [(0, True), (10, True), (300, False)])
def test_crowd_is_brought_back_to_the_bit_while_it_is_guided(steps, is_first):
    """In the first, and in a later scene; the draws that follow are the same too."""
    crowds = [model_of(SMALL).crowd for _ in range(2)]
    random, crowd = np.random.default_rng(0), crowds[0]
    seen = crowd.reset()
    for step in range(steps):
        action = crowd.guide_action() if step % 3 else random.uniform(-1.0, 1.0, size=(3, 2)).astype(np.float32)
        crowd.step_async(action)
        seen, *_ = crowd.step_wait()
    assert (crowd.state()["scenes"] == 0) == is_first
    np.testing.assert_array_equal(crowds[1].restore(crowd.state()), seen)
    for _ in range(200):
        action = random.uniform(-1.0, 1.0, size=(3, 2))
        found = []
        for each in crowds:
            each.step_async(action)
            found.append(each.step_wait())
        np.testing.assert_array_equal(found[0][0], found[1][0])
        np.testing.assert_array_equal(found[0][2], found[1][2])


# The whole training


class KilledError(Exception):
    """Stands for a kill."""


@pytest.fixture(scope="module")
def killed_and_resumed(tmp_path_factory):
    """A training killed at step 330 after the checkpoint of 200, and resumed to its 500 steps.

    Returns:
        Folder, scene steps reported by the first and by the second process, and the files after the kill.
    """
    folder = tmp_path_factory.mktemp("training")
    first, second = [], []

    def kill(progress):
        first.append(progress.scene_steps)
        if progress.scene_steps == 330:
            raise KilledError

    with pytest.raises(KilledError):
        train(SMALL, folder, progress=kill)
    after_kill = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert train(SMALL, folder, progress=lambda p: second.append(p.scene_steps)) == folder / "best.safetensors"
    return folder, first, second, after_kill


def test_training_of_500_steps_writes_a_policy_that_acts(killed_and_resumed):
    folder = killed_and_resumed[0]
    policy = load_policy(str(folder / "best.safetensors"))
    assert np.isfinite(policy.action(np.zeros((1, 56)))).all()
    assert TrainingConfig.from_dict(policy.card["config"]) == SMALL
    assert policy.card["recordings"][0]["name"] == "tiny" and policy.card["versions"]["torch"] == torch.__version__
    history = json.loads((folder / "history.json").read_text())
    assert [entry["scene_steps"] for entry in history] == [200, 400, 500]
    for entry in history:
        expected = entry["success"] - SMALL.intrusion_weight * entry["intrusion_share"]
        assert entry["score"] == pytest.approx(expected) and 0.0 <= entry["success"] <= 1.0
        assert {"sac", "reward", "all", "validation"} <= entry["seconds"].keys()
    kept = [entry for k, entry in enumerate(history) if is_kept(entry, history[:k], SMALL)]
    assert policy.card["score"] == kept[-1]["score"] and policy.card["scene_steps"] == kept[-1]["scene_steps"]
    assert any((folder / "tensorboard").iterdir())
    assert not list(folder.glob("*.part*"))


def test_kill_loses_at_most_one_checkpoint(killed_and_resumed):
    """130 steps are lost, the 200 before are not."""
    _, first, second, _ = killed_and_resumed
    # Of a step in which a validation ends that was waited for there are two reports.
    assert list(dict.fromkeys(first)) == list(range(331)) and list(dict.fromkeys(second)) == list(range(200, 501))


def test_what_a_kill_leaves_is_the_checkpoint_as_it_was(killed_and_resumed, tmp_path):
    """A learner built anew from the files has the counters of step 200 and the transitions of its buffer."""
    _, _, _, after_kill = killed_and_resumed
    (tmp_path / "checkpoint.pt").write_bytes(after_kill["checkpoint.pt"])
    model = model_of(SMALL)
    state = torch.load(tmp_path / "checkpoint.pt", weights_only=True)["model"]
    (state["crowd"],) = state["crowd"]["scenes"]
    model.restore(state)
    assert model.num_timesteps == 200 * SMALL.n_slots and model.updates == state["updates"] == 99
    assert model.replay_buffer.size() > 100


def test_resumed_training_is_the_undisturbed_one_to_the_bit(killed_and_resumed, tmp_path):
    """Weights, history, metrics and the last checkpoint; times aside."""
    resumed = killed_and_resumed[0]
    train(SMALL, tmp_path)
    for name in ("best.safetensors", "latest.safetensors"):
        assert (resumed / name).read_bytes() == (tmp_path / name).read_bytes(), name
    for name in ("best.json", "latest.json", "history.json", "config.json"):
        found = [json.loads((folder / name).read_text()) for folder in (resumed, tmp_path)]
        assert_same(*found, name, ignored=("seconds",))
    found = [torch.load(folder / "checkpoint.pt", weights_only=True) for folder in (resumed, tmp_path)]
    assert_same(*found, "checkpoint.pt", ignored=("seconds",))


def test_finished_training_does_nothing_more(killed_and_resumed):
    folder = killed_and_resumed[0]
    before = (folder / "checkpoint.pt").read_bytes()
    steps = []
    assert train(SMALL, folder, progress=lambda p: steps.append(p.scene_steps)) == folder / "best.safetensors"
    assert steps == [500] and (folder / "checkpoint.pt").read_bytes() == before


def test_last_late_checkpoint_within_a_standard_error_of_the_best_is_kept(tmp_path, monkeypatch):
    """Of 100 agents 0.9 +- 0.03 arrive at best; 0.88 is within that, 0.86 is not, and 0.99 came early."""
    success = iter([0.99, 0.3, 0.9, 0.88, 0.86])

    class Here:
        """In the place of another process."""

        def ask(self, function, path, *others):
            value = next(success) if path.name == "latest.safetensors" else 0.0
            found = Future()
            found.set_result(
                ({"success": value, "intrusion_share": 0.2, "time_under_way": 5.0, "n_agents": 100.0}, 0.0)
            )
            return found

        def close(self):
            pass

    monkeypatch.setattr("socialnav_mj.learning.training.Beside", Here)
    card = load_policy(str(train(small(scene_steps=50, checkpoint_every=10, kept_from=0.6), tmp_path))).card
    assert card["scene_steps"] == 40 and card["score"] == pytest.approx(0.78)
    assert [entry["success"] for entry in card["history"]] == [0.99, 0.3, 0.9, 0.88, 0.86]


def test_another_configuration_in_the_same_folder_is_refused(killed_and_resumed):
    folder = killed_and_resumed[0]
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    with pytest.raises(ValueError, match=r"config\.json: the training there has gamma = 0\.95, but 0\.9 is asked for"):
        train(small(gamma=0.9), folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_training_is_repeatable(tmp_path):
    """The same configuration twice: the same weights to the bit."""
    config = small(guided_scene_steps=20)
    one, other = learned(config, 60), learned(config, 60)
    assert one.updates == 39  # that of the last step is due
    assert_same(one.checkpoint(), other.checkpoint(), ignored=("seconds",))
    assert_same(one.replay_buffer.state(), other.replay_buffer.state())
    different = learned(small(guided_scene_steps=20, seed=1), 60)
    assert not np.array_equal(different.checkpoint()["reward_net"]["layers.0.weight"], one.reward_net.layers[0].weight)


# Configuration


def test_configuration_goes_through_json():
    config = small(partition="segment", hidden=(3, 4))
    assert TrainingConfig.from_dict(json.loads(json.dumps(config.as_dict()))) == config


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"partition": "exact"}, "partition = 'exact' is not allowed; allowed: fused, importance, segment"),
        ({"reward": "mine"}, "reward = 'mine' is not allowed; allowed: learned, constant, task"),
        ({"turn_limit": "never"}, "turn_limit = 'never' is not allowed; allowed: per_step, per_second"),
        ({"matching": "density", "features": "risk"}, "matching = 'density' is not allowed with features = 'risk'"),
        ({"scene_steps": 0}, "scene_steps = 0 is not allowed"),
        ({"n_slots": -1}, "n_slots = -1 is not allowed"),
        ({"kept_from": 1.0}, "kept_from = 1.0 is not allowed; allowed: numbers in [0, 1)"),
        ({"gamma": 1.0}, "gamma = 1.0 is not allowed; allowed: numbers in [0, 1)"),
        ({"averaging_power": -1.0}, "averaging_power = -1.0 is not allowed; allowed: numbers >= 0"),
        ({"expert_clearance": -0.1}, "expert_clearance = -0.1 is not allowed; allowed: numbers >= 0"),
        ({"expert_contact_distance": float("nan")}, "expert_contact_distance = nan is not allowed"),
        ({"datasets": ()}, "datasets and shares must not be empty"),
    ],
)
def test_configuration_refuses_what_cannot_be(changes, message):
    with pytest.raises(ValueError) as caught:
        small(**changes)
    assert message in str(caught.value)


def test_learning_rate_falls_to_a_tenth():
    """Of SAC and reward alike, over the whole training."""
    model = model_of(SMALL)
    assert [model.lr_schedule(left) for left in (1.0, 0.5, 0.0)] == pytest.approx([1e-3, 5.5e-4, 1e-4])
    assert math.isclose(model.target_entropy, SMALL.target_entropy)
