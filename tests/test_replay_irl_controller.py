"""The learned policy without torch: its forward pass, its files, and an installation that cannot train."""

import hashlib
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from policies import random_tensors, write_policy
from scenes import TINY

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits, controller_config, make_controller, with_policy_of
from socialnav_mj.controllers.replay_irl import DEFAULT_POLICY, PolicyError, ReplayIRL, load_policy, shipped_policies
from socialnav_mj.environment import make_environment
from socialnav_mj.features import FEATURE_SETS, running_state, view_of
from socialnav_mj.rollout import rollout

LIMITS = Limits.of(Scenario())
SIZE = 56
BOTH = pytest.mark.parametrize("features", FEATURE_SETS)


def first_observation(**kwargs):
    environment = make_environment(share=0.7, dataset=TINY, **kwargs)
    observation = environment.reset().observation
    for _ in range(10):
        observation = environment.step(np.zeros(environment.action_spec().shape)).observation
    return observation


def by_hand(tensors, network, state):
    """One neuron after the other."""
    n_layers = sum(name.startswith(network) for name in tensors) // 2
    values = [float(x) for x in state]
    for i in range(n_layers):
        weight, bias = (tensors[f"{network}.{i}.{name}"].tolist() for name in ("weight", "bias"))
        sums = [sum(w * v for w, v in zip(row, values, strict=True)) for row in weight]
        values = [s + b for s, b in zip(sums, bias, strict=True)]
        if i < n_layers - 1:
            values = [max(v, 0.0) for v in values]
    return np.tanh(values)


# Which policy


OWN = "replay_irl(policy='students003_continuous_seed0')"


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("replay_irl", OWN),
        ("hybrid", f"hybrid(near={OWN!r})"),
        ("hybrid(switch_distance=1.0)", f"hybrid(switch_distance=1.0, near={OWN!r})"),
        ("hybrid(near='go_straight', far='replay_irl')", f"hybrid(near='go_straight', far={OWN!r})"),
        ("replay_irl(policy='students003_risk_seed0')", "replay_irl(policy='students003_risk_seed0')"),
        ("hybrid(near='go_straight')", "hybrid(near='go_straight')"),
        ("potential_field(attraction_limit=None)", "potential_field(attraction_limit=None)"),
    ],
)
def test_learned_controllers_act_with_the_policy_of_the_recording(spec, expected):
    found = with_policy_of(spec, "students003")
    assert found == expected
    assert make_controller(found).name == make_controller(expected).name


@pytest.mark.parametrize("dataset", ["plaza", "zara01", "some/where/annotation.vsp"])
def test_recordings_without_a_policy_of_their_own_get_the_default_one(dataset):
    assert with_policy_of("hybrid", dataset) == "hybrid"
    assert with_policy_of("replay_irl", dataset) == "replay_irl"


# Forward pass


@BOTH
def test_action_and_reward_are_relu_layers_and_a_tanh(features, tmp_path):
    tensors = random_tensors(features)
    policy = load_policy(write_policy(tmp_path / "p.safetensors", features=features))
    state = np.random.default_rng(1).normal(size=(5, FEATURE_SETS[features].size + 2))
    np.testing.assert_allclose(policy.action(state), [by_hand(tensors, "actor", s) for s in state], atol=1e-12)
    np.testing.assert_allclose(policy.reward_of(state), [by_hand(tensors, "reward", s)[0] for s in state], atol=1e-12)


def constant_policy(path: Path, speed: float, turn: float) -> str:
    """An actor that always gives these two numbers."""
    tensors = {name: np.zeros_like(value) for name, value in random_tensors().items()}
    tensors["actor.2.bias"] = np.arctanh(np.array([speed, turn], dtype=np.float32))
    return write_policy(path, tensors=tensors)


@pytest.mark.parametrize(("speed", "turn"), [(0.0, 0.0), (0.5, -0.25), (-0.9, 0.9)])
def test_speed_is_scaled_from_0_and_turn_to_both_sides(speed, turn, tmp_path):
    """Speed (a + 1) / 2 of 1 m/s, yaw rate a of 2.618 rad/s; inactive slots stand still."""
    controller = ReplayIRL(policy=constant_policy(tmp_path / "p.safetensors", speed, turn))
    controller.reset(LIMITS)
    observation = first_observation()
    active = observation["active"]
    assert active.any() and not active.all()
    twist = controller.twist(observation)
    np.testing.assert_allclose(
        twist[active], [[0.5 * (speed + 1.0), turn * np.pi / 0.6 / 2.0]] * active.sum(), rtol=1e-6
    )
    assert not twist[~active].any()


@BOTH
def test_twist_is_the_actors_of_the_features_of_each_agent(features, tmp_path):
    """All at once is one at a time, and finite."""
    path = write_policy(tmp_path / "p.safetensors", features=features, seed=3)
    controller = ReplayIRL(policy=path)
    controller.reset(LIMITS)
    observation = first_observation()
    twist = controller.twist(observation)
    for row in np.flatnonzero(observation["active"]):
        state = running_state(FEATURE_SETS[features](view_of(observation, np.array([row]))))
        action = load_policy(path).action(state)[0]
        np.testing.assert_allclose(twist[row, 0], 0.5 * (action[0] + 1.0) * LIMITS.max_speed, rtol=1e-12)
        np.testing.assert_allclose(twist[row, 1], action[1] * LIMITS.max_yaw_rate, rtol=1e-12)
    nobody = {**observation, "active": np.zeros_like(observation["active"])}
    assert not controller.twist(nobody).any()


def test_policy_is_part_of_the_configuration(tmp_path):
    path = write_policy(tmp_path / "p.safetensors")
    config = controller_config(ReplayIRL(policy=path))
    assert config == {
        "class": "socialnav_mj.controllers.replay_irl:ReplayIRL",
        "policy": path,
        "checksum": hashlib.sha256(Path(path).read_bytes()).hexdigest(),
        "name": "replay_irl",
    }
    assert make_controller(f"replay_irl(policy={path!r})").policy == path


# Files


def test_missing_policy_is_named_with_what_there_is(tmp_path):
    for name in ("no_such_policy", str(tmp_path / "p.safetensors")):
        with pytest.raises(PolicyError) as caught:
            ReplayIRL(policy=name)
        assert repr(name) in str(caught.value) and all(n in str(caught.value) for n in shipped_policies())


def damaged(path: Path, how: str) -> str:
    """A policy of which something is wrong."""
    tensors = random_tensors()
    card = path.with_suffix(".json")
    if how == "a layer is missing":
        del tensors["actor.1.weight"]
    elif how == "a network is missing":
        tensors = {name: value for name, value in tensors.items() if not name.startswith("reward")}
    elif how == "hidden widths disagree":
        tensors["actor.1.weight"] = np.zeros((8, 5), dtype=np.float32)
    elif how == "a bias has another length":
        tensors["reward.0.bias"] = np.zeros(3, dtype=np.float32)
    elif how == "a weight is no matrix":
        tensors["actor.0.weight"] = np.zeros(8, dtype=np.float32)
    elif how == "three outputs":
        tensors |= {"actor.2.weight": np.zeros((3, 8), np.float32), "actor.2.bias": np.zeros(3, np.float32)}
    elif how == "a weight is not finite":
        tensors["actor.0.weight"][0, 0] = np.nan
    name = write_policy(path, tensors=tensors)
    if how == "truncated weights":
        path.write_bytes(path.read_bytes()[:-100])
    elif how == "empty weights":
        path.write_bytes(b"")
    elif how == "no card":
        card.unlink()
    elif how == "card is no JSON":
        card.write_text("{")
    elif how == "card is no dictionary":
        card.write_text("[1, 2]")
    elif how == "card is no text":
        card.write_bytes(b"\xff\xfe\xff")
    elif how == "unknown features":
        card.write_text(json.dumps({"config": {"features": "lidar"}}))
    elif how == "features of another size":
        card.write_text(json.dumps({"config": {"features": "risk"}}))
    return name


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("a layer is missing", "actor."),
        ("a network is missing", "reward.0.weight"),
        ("hidden widths disagree", "actor.1 has weight (8, 5) and bias (8,); expected (n, 8) and (n,)"),
        ("a bias has another length", "reward.0 has weight (8, 56) and bias (3,)"),
        ("a weight is no matrix", "actor.0 has weight (8,)"),
        ("three outputs", "the actor maps 56 to 3 numbers; expected 56 to 2"),
        ("a weight is not finite", "actor.0 holds values that are not finite"),
        ("truncated weights", "p.safetensors"),
        ("empty weights", "p.safetensors"),
        ("no card", "p.json"),
        ("card is no JSON", "p.json"),
        ("card is no dictionary", "p.json"),
        ("card is no text", "p.json"),
        ("unknown features", "unknown feature set 'lidar'"),
        ("features of another size", "expected (n, 82)"),
    ],
)
def test_damaged_policy_is_refused_and_the_file_named(how, message, tmp_path):
    name = damaged(tmp_path / "p.safetensors", how)
    with pytest.raises(PolicyError) as caught:
        load_policy(name)
    assert message in str(caught.value) and str(tmp_path / "p") in str(caught.value)


class Payload:
    """Runs a command when it is unpickled."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return os.mkdir, (str(self.marker),)


def test_policy_file_runs_no_code(tmp_path):
    """A pickle under the name of a policy is refused, and what it would have done is not done."""
    path, marker = Path(write_policy(tmp_path / "p.safetensors")), tmp_path / "was_here"
    payload = pickle.dumps(Payload(marker))
    pickle.loads(payload)
    assert marker.is_dir()  # the payload works
    marker.rmdir()
    path.write_bytes(payload)
    with pytest.raises(PolicyError):
        load_policy(str(path))
    assert not marker.exists()


def test_shipped_policies_can_all_be_loaded():
    for name in shipped_policies():
        policy = load_policy(name)
        assert np.isfinite(policy.action(np.zeros((1, policy.features.size + 2)))).all()


# Episodes


def test_same_policy_gives_the_same_episode(tmp_path):
    path = write_policy(tmp_path / "p.safetensors", seed=5)
    episodes = [rollout(make_environment(share=0.7, dataset=TINY), ReplayIRL(policy=path)) for _ in range(2)]
    assert episodes[0].metadata["state_hash"] == episodes[1].metadata["state_hash"]
    assert episodes[0].policies == ("replay_irl",)


def test_plain_installation_runs_both_learned_controllers(tmp_path):
    """A Python that cannot import torch, stable-baselines3, gymnasium or tensorboard runs them, and names the first."""
    path = write_policy(tmp_path / "p.safetensors", seed=5)
    specs = [f"replay_irl(policy={path!r})", f'hybrid(near="replay_irl(policy={path!r})")']
    if DEFAULT_POLICY in shipped_policies():
        specs += ["replay_irl", "hybrid"]
    code = f"""
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {{"torch", "stable_baselines3", "gymnasium", "tensorboard"}}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Refuse())
from socialnav_mj.controllers import make_controller
from socialnav_mj.environment import make_environment
from socialnav_mj.rollout import rollout

for spec in {specs!r}:
    episode = rollout(make_environment(share=0.7, dataset={str(TINY)!r}), make_controller(spec))
    print(len(episode.policies), int((episode.agent_outcome >= 0).sum()))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert [line.split()[0] for line in result.stdout.splitlines()] == ["1", "2"] * (len(specs) // 2)


def test_controllers_and_features_bring_in_no_training_library():
    code = (
        "import sys, socialnav_mj.controllers, socialnav_mj.features, socialnav_mj.recordings.window; "
        "print(*[n for n in ('torch', 'stable_baselines3', 'gymnasium', 'mujoco', 'dm_control') if n in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.split() == []
