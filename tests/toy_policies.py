"""Policies simple enough to be known by heart: one layer, in the files that trained ones come in."""

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from safetensors.numpy import save_file

from socialnav_mj.features import N_FLAGS, feature_set
from socialnav_mj.geometry import Array


def write_toy(
    folder: Path,
    name: str,
    *,
    seed: int,
    reward: Callable[[Array], None] | None = None,
    datasets: Sequence[str] = ("tiny",),
    train_end: float = 0.6,
    turn_limit: str = "per_step",
) -> str:
    """A policy that turns to its goal at speed, a little differently for each seed.

    Args:
        folder: Gets NAME.safetensors and NAME.json.
        name: Of the policy.
        seed: Training seed in its card.
        reward: Fills the reward network's weights, shape (1, size + 2), in place; zeros by default.
        datasets: In its card.
        train_end: End of the part that it learned from, in its card; a tenth for validation follows.
        turn_limit: In its card.

    Returns:
        Path of the policy.
    """
    size = feature_set("continuous").size + N_FLAGS
    actor, weights = np.zeros((2, size)), np.zeros((1, size))
    actor[1, 1] = 2.0 + 0.2 * seed  # turns with the sine of the goal's bearing
    if reward is not None:
        reward(weights)
    tensors = {
        "actor.0.weight": actor,
        "actor.0.bias": np.array([1.5, 0.0]),
        "reward.0.weight": weights,
        "reward.0.bias": np.zeros(1),
    }
    path = folder / f"{name}.safetensors"
    save_file(tensors, path)
    config = {
        "features": "continuous",
        "seed": seed,
        "datasets": list(datasets),
        "turn_limit": turn_limit,
        "train_window": [0.0, train_end],
        "validation_window": [train_end, train_end + 0.1],
        "intrusion_weight": 0.5,
    }
    seconds = {"sac": 3.0, "reward": 1.0, "all": 10.0}
    entry = {"scene_steps": 7, "success": 0.5, "intrusion_share": 0.25, "training_collided": 0.5, "seconds": seconds}
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    card = {"sha256": sha256, "config": config, "scene_steps": 7, "transitions": 70, "history": [entry]}
    path.with_suffix(".json").write_text(json.dumps(card))
    return str(path)
