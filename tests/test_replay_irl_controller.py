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
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.replay_irl import DEFAULT_POLICY, ReplayIRL, load_policy, shipped_policies
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
        ("replay_irl(policy='students003_continuous_seed0')", "replay_irl(policy='students003_continuous_seed0')"),
        ("hybrid(near='go_straight')", "hybrid(near='go_straight')"),
        ("potential_field(attraction_limit=2.0)", "potential_field(attraction_limit=2.0)"),
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
        "sources": {path: hashlib.sha256(Path(path).read_bytes()).hexdigest()},
    }
    assert make_controller(f"replay_irl(policy={path!r})").policy == path


# Files


def test_missing_policy_is_named_with_what_there_is(tmp_path):
    for name in ("no_such_policy", str(tmp_path / "p.safetensors")):
        with pytest.raises(PolicyError) as caught:
            ReplayIRL(policy=name)
        assert repr(name) in str(caught.value) and all(n in str(caught.value) for n in shipped_policies())


def with_tensors(**changes):
    """Random tensors of which some are others, or missing where None is given."""
    tensors = {**random_tensors(), **{name.replace("__", "."): value for name, value in changes.items()}}
    return {name: value for name, value in tensors.items() if value is not None}


def first(value, dtype=np.float32):
    """The actor's first weight with one entry that is another."""
    weight = random_tensors()["actor.0.weight"].astype(dtype)
    weight[0, 0] = value
    return weight


@pytest.mark.parametrize(
    ("tensors", "message"),
    [
        (with_tensors(actor__1__weight=None), "it lacks actor.1.weight"),
        (with_tensors(actor__1__bias=None), "it lacks actor.1.bias"),
        (with_tensors(actor__2__weight=None, actor__2__bias=None), "the actor maps 56 to 8 numbers; expected 56 to 2"),
        ({n: v for n, v in random_tensors().items() if n.startswith("actor")}, "it lacks reward.0.weight"),
        (with_tensors(critic__0__weight=np.zeros(3)), "it has unknown tensors critic.0.weight"),
        (with_tensors(actor__4__bias=np.zeros(3)), "it has unknown tensors actor.4.bias"),
        (
            with_tensors(actor__1__weight=np.zeros((8, 5), np.float32)),
            "actor.1 has weight (8, 5) and bias (8,); expected (n, 8) and (n,)",
        ),
        (with_tensors(reward__0__bias=np.zeros(3, np.float32)), "reward.0 has weight (8, 56) and bias (3,)"),
        (with_tensors(actor__0__weight=np.zeros(8, np.float32)), "actor.0 has weight (8,)"),
        (
            with_tensors(actor__2__weight=np.zeros((3, 8), np.float32), actor__2__bias=np.zeros(3, np.float32)),
            "the actor maps 56 to 3 numbers; expected 56 to 2",
        ),
        (with_tensors(actor__0__weight=first(np.nan)), "actor.0.weight holds values that are not finite"),
        (with_tensors(actor__0__weight=first(-np.inf)), "actor.0.weight holds values that are not finite"),
        (with_tensors(actor__0__weight=first(1e300, float)), "actor.0.weight holds values that are not finite, or too"),
        (with_tensors(actor__0__weight=np.ones((8, 56), np.int64)), "actor.0.weight holds int64; expected floating"),
    ],
)
def test_weights_that_are_no_networks_are_refused_and_the_file_and_the_tensor_named(tensors, message, tmp_path):
    name = write_policy(tmp_path / "p.safetensors", tensors=tensors)
    with pytest.raises(PolicyError) as caught:
        load_policy(name)
    assert f"{name}: {message}" in str(caught.value)


NESTED = "[" * 100_000 + "]" * 100_000
GIVEN = {
    "seed": 0,
    "datasets": ["made"],
    "turn_limit": "per_step",
    "train_window": [0.0, 0.6],
    "validation_window": [0.6, 0.7],
}


@pytest.mark.parametrize(
    ("card", "message"),
    [
        (None, "p.json: there is no such card"),
        ("{", "p.json is no readable JSON"),
        (b"\xff\xfe\xff", "p.json is no readable JSON"),
        (NESTED, "p.json is no readable JSON"),
        (f'{{"sha256": {NESTED}}}', "p.json is no readable JSON"),
        ('{"sha256": ' + "1" * 5000 + "}", "p.json is no readable JSON"),
        ("[1, 2]", "p.json holds [1, 2]; expected an object"),
        ({"sha256": None}, "p.json: it lacks sha256"),
        ({"sha256": 5}, "p.json: sha256 = 5; expected 64 hexadecimal digits"),
        ({"sha256": "0" * 64}, f"but its card p.json says {'0' * 64}"),
        ({"config": None}, "p.json: it lacks config"),
        ({"config": [1]}, "p.json: config = [1]; expected an object"),
        ({"config": GIVEN}, "p.json: it lacks config.features"),
        ({"config": {**GIVEN, "features": ["risk"]}}, "p.json: config.features = ['risk']; expected a string"),
        ({"config": {**GIVEN, "features": "lidar"}}, "p.json: config.features: unknown feature set 'lidar'"),
        ({"config": {**GIVEN, "features": "risk"}}, "expected (n, 82)"),
        ({"config": {**GIVEN, "features": "risk", "seed": True}}, "config.seed = True; expected an integer >= 0"),
        ({"config": {**GIVEN, "features": "risk", "datasets": []}}, "config.datasets = []; expected a list of one"),
        ({"config": {**GIVEN, "features": "risk", "train_window": [0, 2]}}, "config.train_window = [0, 2]; expected a"),
    ],
)
def test_damaged_card_is_refused_and_the_file_and_the_key_named(card, message, tmp_path):
    path = tmp_path / "p.json"
    name = write_policy(tmp_path / "p.safetensors")
    if isinstance(card, dict):
        changed = {**json.loads(path.read_text()), **card}
        card = json.dumps({key: value for key, value in changed.items() if value is not None})
    if card is None:
        path.unlink()
    else:
        path.write_bytes(card if isinstance(card, bytes) else card.encode())
    with pytest.raises(PolicyError) as caught:
        load_policy(name)
    assert message in str(caught.value) and str(tmp_path / "p") in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_weights_with_any_bit_flipped_or_cut_anywhere_are_refused(tmp_path):
    path = Path(write_policy(tmp_path / "p.safetensors"))
    whole, random = path.read_bytes(), np.random.default_rng(0)
    damaged = [whole[:length] for length in (0, 7, 8, 100, len(whole) - 1)] + [whole + b"\0"]
    for bit in random.integers(8 * len(whole), size=200):
        content = bytearray(whole)
        content[bit // 8] ^= 1 << (bit % 8)
        damaged.append(bytes(content))
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(PolicyError, match=r"p\.safetensors has sha256 [0-9a-f]{64}, but its card p\.json says"):
            load_policy(str(path))


@pytest.mark.parametrize("content", [b"", b"\0" * 7, b"\xff" * 64, b"\x02" + b"\0" * 7 + b"{}"])
def test_weights_that_are_no_safetensors_are_refused_whatever_the_card_says(content, tmp_path):
    path = Path(write_policy(tmp_path / "p.safetensors"))
    path.write_bytes(content)
    card = json.loads(path.with_suffix(".json").read_text())
    path.with_suffix(".json").write_text(json.dumps({**card, "sha256": hashlib.sha256(content).hexdigest()}))
    with pytest.raises(PolicyError, match=r"p\.safetensors"):
        load_policy(str(path))


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
