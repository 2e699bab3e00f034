"""Finished trainings become shipped policies whose cards state the spread over their seeds."""

import json

import numpy as np
import pytest
from policies import write_policy

from socialnav_mj.cli import main
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.replay_irl import load_policy, shipped_policies
from socialnav_mj.learning.shipping import seed_spread, ship


def finished(folder, seed, success, *, features="continuous", metrics=True, **config):
    """Folder of a training."""
    folder.mkdir()
    card = {"config": {"datasets": ["some", "data/other.txt"], "features": features, "seed": seed, **config}}
    if metrics:
        values = {"success": success, "intrusion_share": 0.5, "time_under_way": 10.0}
        card["metrics"] = dict.fromkeys(("in_sample", "held_out"), values)
    write_policy(folder / "best.safetensors", features=features, seed=seed, card=card)
    return folder


def test_policies_are_named_by_what_made_them_and_keep_their_weights(tmp_path):
    folders = [finished(tmp_path / "a", 0, 0.5), finished(tmp_path / "b", 1, 0.5, features="risk")]
    paths = ship(folders, tmp_path / "policies")
    assert [path.name for path in paths] == [
        "some_other_continuous_seed0.safetensors",
        "some_other_risk_seed1.safetensors",
    ]
    for folder, path in zip(folders, paths, strict=True):
        assert load_policy(str(path)).checksum == load_policy(str(folder / "best.safetensors")).checksum


def test_cards_state_the_spread_over_all_seeds_also_of_those_shipped_before(tmp_path):
    target = tmp_path / "policies"
    ship([finished(tmp_path / "a", 0, 0.6)], target)
    alone = load_policy(str(target / "some_other_continuous_seed0.safetensors")).card["seed_spread"]
    assert alone["held_out"]["success"] == {"n": 1, "mean": 0.6, "sd": None, "least": 0.6, "greatest": 0.6}
    main(["ship", str(finished(tmp_path / "b", 1, 0.7)), str(finished(tmp_path / "c", 4, 0.95)), "--out", str(target)])
    for seed in (0, 1, 4):
        spread = json.loads((target / f"some_other_continuous_seed{seed}.json").read_text())["seed_spread"]
        assert spread["held_out"]["success"] == pytest.approx(
            {"n": 3, "mean": 0.75, "sd": 0.0325**0.5, "least": 0.6, "greatest": 0.95}
        )
        assert spread["in_sample"]["intrusion_share"]["sd"] == 0.0


def test_unfinished_trainings_and_mixed_families_are_refused_and_nothing_is_written(tmp_path):
    target = tmp_path / "policies"
    with pytest.raises(PolicyError, match="a: the training is not finished"):
        ship([finished(tmp_path / "a", 0, 0.6, metrics=False)], target)
    ship([finished(tmp_path / "b", 0, 0.6, gamma=0.9)], target)
    before = {path.name: path.read_bytes() for path in target.iterdir()}
    with pytest.raises(
        PolicyError, match=r"seed0 was trained with gamma = 0\.9, some_other_continuous_seed1 with 0\.95"
    ):
        ship([finished(tmp_path / "c", 1, 0.6, gamma=0.95), finished(tmp_path / "d", 0, 0.6, features="risk")], target)
    assert {path.name: path.read_bytes() for path in target.iterdir()} == before


def test_shipped_cards_are_of_one_configuration_a_family_and_state_its_spread():
    families: dict[str, list] = {}
    for name in shipped_policies():
        families.setdefault(name.rpartition("_seed")[0], []).append(load_policy(name).card)
    for name, cards in families.items():
        configs = [{k: v for k, v in card["config"].items() if k != "seed"} for card in cards]
        assert all(config == configs[0] for config in configs), name
        expected = seed_spread([card["metrics"] for card in cards])
        for card in cards:
            for part, measures in expected.items():
                for measure, values in measures.items():
                    stated = card["seed_spread"][part][measure]
                    np.testing.assert_allclose(
                        [stated[k] or 0.0 for k in values], [v or 0.0 for v in values.values()], err_msg=name
                    )
