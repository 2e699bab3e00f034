"""Policy files made by hand."""

import hashlib
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save_file

from socialnav_mj.features import N_FLAGS, feature_set


def random_tensors(features: str = "continuous", hidden: tuple[int, ...] = (8, 8), seed: int = 0):
    """Weights of an actor and a reward network, by name."""
    random = np.random.default_rng(seed)
    tensors: dict[str, NDArray[np.float32]] = {}
    for network, outputs in (("actor", 2), ("reward", 1)):
        widths = (feature_set(features).size + N_FLAGS, *hidden, outputs)
        for i, (before, after) in enumerate(pairwise(widths)):
            weight = random.normal(scale=before**-0.5, size=(after, before))
            tensors[f"{network}.{i}.weight"] = weight.astype(np.float32)
            tensors[f"{network}.{i}.bias"] = random.normal(scale=0.1, size=after).astype(np.float32)
    return tensors


def write_policy(path: Path, *, tensors=None, features: str = "continuous", seed: int = 0, card=None) -> str:
    """Write NAME.safetensors and its card.

    Args:
        path: Of the .safetensors file.
        tensors: By name; random ones if not given.
        features: Name of the feature set.
        seed: Seed of the random weights.
        card: Of it, `config` is completed and `sha256` is added.

    Returns:
        The path, as `load_policy` takes it.
    """
    save_file(random_tensors(features, seed=seed) if tensors is None else tensors, path)
    card = card or {}
    config = {
        "features": features,
        "seed": seed,
        "datasets": ["made"],
        "turn_limit": "per_step",
        "train_window": [0.0, 0.6],
        "validation_window": [0.6, 0.7],
    }
    config |= card.get("config", {})
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    path.with_suffix(".json").write_text(json.dumps({**card, "config": config, "sha256": sha256}))
    return str(path)
