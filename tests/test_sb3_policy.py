"""Policies that stable-baselines3 saved, as controllers: what they see and do, and who has to trust them."""

import runpy

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from scenes import TINY
from stable_baselines3 import A2C, PPO, SAC
from test_architecture import ROOT

from socialnav_mj import cli
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits, controller_config, controller_of, make_controller
from socialnav_mj.controllers.check import check_controller
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.sb3 import checksum_of
from socialnav_mj.controllers.specs import with_trust
from socialnav_mj.envs.single import CrowdEnv

ALGORITHMS = {"ppo": PPO, "a2c": A2C, "sac": SAC}


def saved(folder, algorithm="ppo", **settings) -> tuple[str, CrowdEnv, object]:
    """An untrained policy in a file, its environment, and the learner that it is of."""
    env = CrowdEnv(dataset=TINY, **settings)
    policy = "MultiInputPolicy" if settings.get("observation") == "dict" else "MlpPolicy"
    model = ALGORITHMS[algorithm](policy, env, seed=1, device="cpu", policy_kwargs={"net_arch": [8]})
    path = folder / f"{algorithm}.zip"
    model.save(path)
    return str(path), env, model


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize(
    "settings", [{}, {"observation": "dict", "people": 4, "action": "wheels"}], ids=["flat", "dict"]
)
def test_drives_as_it_would_in_the_environment_that_it_was_trained_in(tmp_path, algorithm, settings):
    path, env, model = saved(tmp_path, algorithm, **settings)
    action = settings.get("action", "twist")
    controller = make_controller(f"sb3:{path}(checksum='{checksum_of(path)}', action='{action}')")
    check_controller(controller)
    seen, _ = env.reset(seed=0)
    controller.reset(limits := Limits.of(Scenario()))
    task, physics = env._environment.task, env._environment.physics
    wanted, _ = model.predict(seen, deterministic=True)
    found = controller.act(task.get_observation(physics))[env._slot]
    np.testing.assert_allclose(found, limits.wheel_speed_of_action(wanted[None], action)[0], atol=1e-5)


def test_a_file_is_read_only_if_it_is_trusted_and_as_it_was(tmp_path):
    path, _, _ = saved(tmp_path)
    with pytest.raises(PolicyError, match=r"runs the code in it\. If you trust it, add --trust sb3:"):
        make_controller(f"sb3:{path}")
    spec = with_trust(f"sb3:{path}", [f"sb3:{path}"])
    assert make_controller(spec).name == f"sb3:{path}"
    assert with_trust(f"sb3:{path}", ["sb3:other.zip"]) == f"sb3:{path}"
    assert make_controller(with_trust(f"sb3:{path}(name='mine')", [f"sb3:{path}"])).name == "mine"
    (tmp_path / "ppo.zip").write_bytes((tmp_path / "ppo.zip").read_bytes() + b" ")
    with pytest.raises(PolicyError, match=r"has sha256 .*, but .* is trusted"):
        make_controller(spec)


def test_an_episode_that_names_a_file_has_it_read_only_if_it_is_trusted(tmp_path):
    path, _, _ = saved(tmp_path)
    config = controller_config(make_controller(with_trust(f"sb3:{path}", [f"sb3:{path}"])))
    with pytest.raises(ValueError, match=r"If you trust that code, add --trust sb3:"):
        controller_of(config)
    with pytest.raises(ValueError, match=r"add --trust sb3:"):
        controller_of(config, trusted=["socialnav_mj.controllers.sb3:SB3Policy"])
    assert controller_config(controller_of(config, trusted=[f"sb3:{path}"])) == config


def test_what_is_no_policy_of_ours_is_refused(tmp_path):
    (tmp_path / "no.zip").write_bytes(b"no zip")
    with pytest.raises(PolicyError, match="is no policy that stable-baselines3 saved"):
        make_controller(with_trust(f"sb3:{tmp_path / 'no.zip'}", [f"sb3:{tmp_path / 'no.zip'}"]))
    with pytest.raises(PolicyError, match="cannot be read: No such file"):
        make_controller(f"sb3:{tmp_path / 'none.zip'}")
    model = PPO("MlpPolicy", "Pendulum-v1", device="cpu", n_steps=8, batch_size=8)
    model.save(tmp_path / "other.zip")
    with pytest.raises(PolicyError, match="expected two numbers"):
        make_controller(with_trust(f"sb3:{tmp_path / 'other.zip'}", [f"sb3:{tmp_path / 'other.zip'}"]))


def test_command_evaluates_a_policy_and_verifies_what_it_did(tmp_path, monkeypatch, capsys):
    saved(tmp_path)
    monkeypatch.chdir(tmp_path)
    run = ["evaluate", "--dataset", str(TINY), "--scenarios", "1", "--draws", "1", "--jobs", "1", "--out", "out"]
    with pytest.raises(SystemExit) as refused:
        cli.main([*run, "--controllers", "sb3:ppo.zip"])
    assert refused.value.code == 2 and "add --trust sb3:ppo.zip" in " ".join(capsys.readouterr().err.split())
    cli.main([*run, "--controllers", "sb3:ppo.zip", "--trust", "sb3:ppo.zip"])
    assert "sb3:ppo.zip" in capsys.readouterr().out
    cli.main(["verify", "out", "--dataset", str(TINY), "--jobs", "1", "--trust", "sb3:ppo.zip"])


def test_the_example_trains_and_evaluates_beside_the_others(tmp_path, monkeypatch):
    """The code of examples/train_ppo.py, for a few seconds on three people."""
    monkeypatch.chdir(tmp_path)
    example = runpy.run_path(str(ROOT / "examples" / "train_ppo.py"))
    arguments = ["--dataset", str(TINY), "--minutes", "0.02", "--controllers", "go_straight", "--draws", "1"]
    monkeypatch.setattr("sys.argv", ["train_ppo.py", *arguments, "--out", "ppo"])
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    example["main"]()
    names = {path.name for path in (tmp_path / "ppo" / "evaluation" / "episodes").glob("*.npz")}
    assert len(names) == 3 and any("sb3-ppo" in name for name in names)
