"""Trained weights as safetensors with a JSON card."""

import hashlib
import json
from pathlib import Path
from typing import Any

from safetensors.torch import save
from stable_baselines3.sac.policies import Actor
from torch import Tensor, nn

from socialnav_mj.files import write_json, write_whole
from socialnav_mj.learning.replay_irl import ReplayIRL


def save_policy(model: ReplayIRL, path: Path, card: dict[str, Any]) -> None:
    """Write what `socialnav_mj.controllers.replay_irl` reads.

    Args:
        model: The learner.
        path: Of the .safetensors file; the card is written beside it.
        card: JSON values; the weights' sha256 is added.
    """
    actor = model.average
    assert isinstance(actor, Actor)
    tensors = _linear_layers("actor", [*actor.latent_pi, actor.mu])
    tensors |= _linear_layers("reward", list(model.reward_net.layers))
    content = save(tensors)
    write_whole(path, content)
    write_json(path.with_suffix(".json"), {**card, "sha256": hashlib.sha256(content).hexdigest()})


def copy_policy(path: Path, target: Path, facts: dict[str, Any]) -> None:
    """Copy weights with their card.

    Args:
        path: Of the .safetensors file.
        target: The copy.
        facts: JSON values that its card has besides.
    """
    card = json.loads(path.with_suffix(".json").read_text())
    write_whole(target, path.read_bytes())
    write_json(target.with_suffix(".json"), {**card, **facts})


def _linear_layers(network: str, modules: list[nn.Module]) -> dict[str, Tensor]:
    linear = [module for module in modules if isinstance(module, nn.Linear)]
    return {
        f"{network}.{i}.{name}": getattr(layer, name).detach().clone()
        for i, layer in enumerate(linear)
        for name in ("weight", "bias")
    }
