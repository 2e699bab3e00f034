"""The folder of a training, whatever is trained: its configuration, its card, and what is told of it."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from socialnav_mj.controllers import Controller
from socialnav_mj.controllers.replay_irl import ReplayIRL
from socialnav_mj.files import write_json, write_whole
from socialnav_mj.learning.attention_config import AttentionConfig
from socialnav_mj.learning.config import TrainingConfig
from socialnav_mj.learning.validation import validate
from socialnav_mj.processes import Beside
from socialnav_mj.recordings import Recording

PACKAGES = ("socialnav-mj", "mujoco", "dm-control", "numpy", "torch", "stable-baselines3")
CHECKPOINT, HISTORY, CONFIG = "checkpoint.pt", "history.json", "config.json"


@dataclass(frozen=True, kw_only=True)
class Progress:
    """What is told of a training under way."""

    scene_steps: int
    """Done so far."""
    transitions: int
    """In the shared buffer, or seen."""
    validation: Mapping[str, Any] | None
    """Entry of the history that a validation which has just ended gave, if one has."""


def claim(folder: Path, config: Mapping[str, Any]) -> None:
    """Write the configuration, or compare it with what is there.

    Args:
        folder: Of the training.
        config: JSON values.

    Raises:
        ValueError: If the folder holds a training with another configuration.
    """
    wanted = json.loads(json.dumps(config))
    path = folder / CONFIG
    if not path.exists():
        write_whole(path, (json.dumps(wanted, indent=1) + "\n").encode())
        return
    found = json.loads(path.read_text())
    for key in sorted({*wanted, *found}):
        if wanted.get(key) != found.get(key):
            raise ValueError(
                f"{path}: the training there has {key} = {found.get(key)!r}, but {wanted.get(key)!r} is asked for; "
                "choose another output folder"
            )


def complete_card(
    path: Path,
    config: TrainingConfig | AttentionConfig,
    recordings: list[Recording],
    history: Sequence[Mapping[str, Any]],
    beside: Beside,
    *,
    controller: Callable[..., Controller] = ReplayIRL,
) -> None:
    """Add what the best policy does on the parts it was trained on, chosen on, and has never seen.

    Args:
        path: Of the weights; the card is beside it, and is left alone if it is complete.
        config: Of the training.
        recordings: Whole recordings.
        history: Of the checkpoints.
        beside: Another process, which takes the part that was trained on, while this one takes the others.
        controller: Drives the policy.
    """
    card_path = path.with_suffix(".json")
    card = json.loads(card_path.read_text())
    if "metrics" in card:
        return
    parts = {"in_sample": config.train_window, "validation": config.validation_window, "held_out": config.test_window}
    asked = beside.ask(validate, path, recordings, config, parts["in_sample"], controller)
    found = {
        name: validate(path, recordings, config, parts[name], controller)[0] for name in ("validation", "held_out")
    }
    found["in_sample"] = asked.result()[0]
    card["metrics"] = {name: {"window": part, **found[name]} for name, part in parts.items()}
    card["history"] = history
    write_json(card_path, card)
