"""`attention`: numpy equals torch, people are a set, and a training is resumed to the same end."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from scenes import TINY  # noqa: E402

from socialnav_mj import cli  # noqa: E402
from socialnav_mj.controllers.attention import Attention, attention_folder, load_attention  # noqa: E402
from socialnav_mj.controllers.policy_card import PolicyError  # noqa: E402
from socialnav_mj.envs.guided import CrowdSettings  # noqa: E402
from socialnav_mj.envs.sb3 import CrowdVecEnv  # noqa: E402
from socialnav_mj.features import SIGHT, People, running_state  # noqa: E402
from socialnav_mj.learning.attention import AgentsOnly, AttentionPPO, Engineered, discomfort  # noqa: E402
from socialnav_mj.learning.attention_config import AttentionConfig  # noqa: E402
from socialnav_mj.learning.attention_training import save_attention, train_attention  # noqa: E402
from socialnav_mj.learning.shipping import ship  # noqa: E402
from socialnav_mj.recordings import load_recording  # noqa: E402

SMALL = AttentionConfig(
    datasets=(str(TINY),),
    train_window=(0.0, 1.0),
    validation_window=(0.0, 1.0),
    test_window=(0.0, 1.0),
    scene_steps=96,
    shares=(1.0,),
    n_slots=4,
    guide="go_straight",
    demonstration_steps=40,
    imitation_epochs=2,
    width=8,
    rollout_steps=16,
    batch_size=16,
    epochs=2,
    checkpoint_every=48,
    validation_shares=(0.7,),
)


def crowd_of(config: AttentionConfig) -> CrowdVecEnv:
    settings = CrowdSettings(
        recordings=[load_recording(TINY)],
        features=People(),
        shares=config.shares,
        n_slots=config.n_slots,
        robot_radius=config.robot_radius,
        pedestrian_radius=config.pedestrian_radius,
        guide=config.guide,
    )
    return CrowdVecEnv(settings, seed=config.seed)


def states(seed: int, n: int = 40) -> np.ndarray:
    """Made-up states of nobody, of some and of ten people."""
    random = np.random.default_rng(seed)
    result = random.uniform(-1.0, 1.0, (n, People.size + 2))
    there = np.arange(10) < random.integers(0, 11, (n, 1))
    blocks = result[:, 6 : People.size].reshape(n, 7, 10)
    blocks *= there[:, None]
    blocks[:, 0] = there
    result[:, People.size :] = 0.0
    return result.astype(np.float32)


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    """A learner with weights as they are made, and its file."""
    torch.manual_seed(0)
    model = AttentionPPO(crowd_of(SMALL), SMALL)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter += 0.3 * torch.randn_like(parameter)
    path = tmp_path_factory.mktemp("attention") / "made.safetensors"
    save_attention(model, path, {"method": "attention", "config": SMALL.as_dict()})
    return model, str(path)


# The network


def test_numpy_gives_what_torch_gives(policy):
    model, path = policy
    seen = states(0)
    with torch.no_grad():
        mean = model.policy.get_distribution(torch.as_tensor(seen)).mode().clamp(-1.0, 1.0).numpy()
    found = load_attention(path).action(seen.astype(float))
    assert 0.1 < np.abs(mean).mean() < 1.0
    np.testing.assert_allclose(found, mean, atol=1e-6)


def test_shares_of_attention_are_of_those_who_are_there(policy):
    share, pooled = load_attention(policy[1]).attention(seen := states(1).astype(float))
    there = seen[:, 6:16] > 0.5
    assert (share[~there] == 0.0).all() and (share >= 0.0).all()
    np.testing.assert_allclose(share.sum(axis=1), there.any(axis=1), atol=1e-9)
    assert not pooled[~there.any(axis=1)].any() and share.max() - share[there].min() > 0.1


def test_order_of_people_and_who_is_beyond_the_mask_do_not_matter(policy):
    trained, seen = load_attention(policy[1]), states(2).astype(float)
    blocks = seen[:, 6 : People.size].reshape(-1, 7, 10)
    order = np.random.default_rng(0).permutation(10)
    shuffled = seen.copy()
    shuffled[:, 6 : People.size] = blocks[:, :, order].reshape(len(seen), -1)
    np.testing.assert_allclose(trained.action(shuffled), trained.action(seen), atol=1e-9)
    strangers = seen.copy()
    strangers[:, 16 : People.size] += np.tile(blocks[:, 0] < 0.5, 6) * 0.7
    np.testing.assert_allclose(trained.action(strangers), trained.action(seen), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda tensors: tensors.pop("head.0.bias"), "lacks head.0.bias"),
        (lambda tensors: tensors.update(other=np.zeros(1)), "unknown tensors other"),
        (lambda tensors: tensors.update({"score.0.weight": np.zeros((8, 3))}), "expected"),
    ],
)
def test_files_that_contradict_themselves_are_refused(policy, tmp_path, change, message):
    import hashlib

    from safetensors.numpy import load_file, save_file

    tensors = dict(load_file(policy[1]))
    change(tensors)
    path = tmp_path / "bad.safetensors"
    save_file(tensors, path)
    card = json.loads(Path(policy[1]).with_suffix(".json").read_text())
    card["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    path.with_suffix(".json").write_text(json.dumps(card))
    with pytest.raises(PolicyError, match=message):
        load_attention(str(path))
    with pytest.raises(PolicyError, match="there is no attention policy 'nobody'; available: "):
        Attention(policy="nobody")


# The learner


def test_discomfort_is_how_far_inside_the_nearest_is():
    seen = np.zeros((3, People.size + 2), dtype=np.float32)
    seen[:2, 6] = 1.0
    seen[:2, 16] = [0.6 / SIGHT, 3.0 / SIGHT]
    np.testing.assert_allclose(discomfort(seen, SMALL), [0.5, 0.0, 0.0], atol=1e-6)


def test_engineered_reward_is_the_tasks_less_its_penalties():
    plain, env = crowd_of(SMALL), Engineered(crowd_of(SMALL), SMALL)
    plain.reset()
    env.reset()
    action = np.tile([1.0, 0.1], (4, 1)).astype(np.float32)
    n_collided = 0
    for _ in range(60):
        states_, own, _, infos = plain.step(action)
        found = env.step(action)[1]
        active = np.array([info["active"] for info in infos])
        collided = np.array([info.get("outcome") == 2 for info in infos])
        n_collided += collided.sum()
        expected = own - active * (0.02 + 0.05 * discomfort(states_, SMALL)) - 10.0 * collided
        np.testing.assert_allclose(found, 0.1 * expected, atol=1e-6)
        assert not found[~active].any()


def test_the_buffer_gives_out_agents_transitions_alone_and_each_once():
    env = crowd_of(SMALL)
    buffer = AgentsOnly(6, env.observation_space, env.action_space, device="cpu", n_envs=4)
    buffer.random = np.random.default_rng(0)
    random, kept = np.random.default_rng(1), []
    for step in range(6):
        seen = running_state(random.uniform(0.1, 1.0, (4, People.size)))
        seen[random.random(4) < 0.5] = 0.0
        seen[:, 1] *= 1.0
        value = torch.as_tensor([10.0 * step + slot for slot in range(4)])
        kept += [10.0 * step + slot for slot in np.flatnonzero(seen.any(axis=1))]
        buffer.add(seen, np.zeros((4, 2)), np.zeros(4), np.zeros(4), value, torch.zeros(4))
    buffer.compute_returns_and_advantage(torch.zeros(4), np.zeros(4))
    got = [float(value) for sample in buffer.get(len(kept)) for value in sample.old_values]
    assert sorted(got) == kept
    assert all(sample.observations.any(dim=1).all() for sample in buffer.get(2))


def test_imitation_learns_what_the_guide_does():
    config = AttentionConfig(**{**SMALL.as_dict(), "demonstration_steps": 150, "imitation_epochs": 60, "width": 32})
    torch.set_num_threads(1)
    model = AttentionPPO(crowd_of(config), config)
    assert model.imitate() < 0.1


def test_a_training_that_was_stopped_goes_on_to_the_same_end(tmp_path, capsys):
    """Stopped after the first checkpoint; the weights and the card's history are those of a training in one piece."""

    class StopError(Exception):
        pass

    def stop(step) -> None:
        if step.scene_steps == 64:
            raise StopError

    one = train_attention(SMALL, tmp_path / "one")
    with pytest.raises(StopError):
        train_attention(SMALL, tmp_path / "two", progress=stop)
    steps = []
    two = train_attention(SMALL, tmp_path / "two", progress=lambda step: steps.append(step.scene_steps))
    assert steps[0] == 48 and steps[-1] == 96
    assert one.read_bytes() == two.read_bytes()
    assert (tmp_path / "one" / "latest.safetensors").read_bytes() == (
        tmp_path / "two" / "latest.safetensors"
    ).read_bytes()
    cards = [json.loads(path.with_suffix(".json").read_text()) for path in (one, two)]
    for card in cards:
        assert set(card["metrics"]) == {"in_sample", "validation", "held_out"} and card["method"] == "attention"
        for entry in card["history"]:
            entry.pop("cpu_seconds")
    assert cards[0]["history"] == cards[1]["history"] and len(cards[0]["history"]) == 2
    with pytest.raises(ValueError, match=r"has width = 8, but 16 is asked for"):
        train_attention(AttentionConfig(**{**SMALL.as_dict(), "width": 16}), tmp_path / "one")
    shipped = ship([tmp_path / "one"], tmp_path / "policies")
    assert shipped == [tmp_path / "policies" / "attention" / "tiny_people_seed0.safetensors"]
    assert load_attention(str(shipped[0])).card["seed_spread"]["held_out"]["success"]["n"] == 1
    shutil.rmtree(tmp_path / "one")


def test_command_trains_and_says_how_to_use_it(tmp_path, capsys):
    small = "--scene-steps 16 --demonstration-steps 20 --imitation-epochs 1 --rollout-steps 16 --checkpoint-every 16"
    small += " --n-slots 4 --shares 1.0 --width 8 --batch-size 16 --epochs 1 --guide go_straight"
    windows = "--train-window 0 1 --validation-window 0 1 --test-window 0 1 --validation-shares 0.7"
    out = tmp_path / "out"
    cli.main(["train", "attention", "--dataset", str(TINY), "--out", str(out), *small.split(), *windows.split()])
    assert f"attention(policy='{out / 'best.safetensors'}')" in "".join(capsys.readouterr().out.splitlines())
    assert Attention(policy=str(out / "best.safetensors")).name == "attention"


# What is shipped


def test_shipped_policies_have_complete_cards():
    names = sorted(path.stem for path in attention_folder().glob("*.safetensors"))
    assert names == [f"students003_people_seed{seed}" for seed in range(len(names))] and names
    for name in names:
        card = load_attention(name).card
        assert set(card["metrics"]) == {"in_sample", "validation", "held_out"} and card["history"]
        assert card["seed_spread"]["held_out"]["success"]["n"] == len(names)
