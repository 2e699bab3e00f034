"""A training of `attention` from its configuration to its best policy: imitation, PPO, checkpoints, resume."""

import hashlib
import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from time import process_time
from typing import Any

import torch
from safetensors.torch import save
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from torch import nn

from socialnav_mj.controllers.attention import Attention
from socialnav_mj.envs.guided import CrowdSettings
from socialnav_mj.envs.sb3 import CrowdVecEnv
from socialnav_mj.features import feature_set
from socialnav_mj.files import write_json, write_whole, written_whole
from socialnav_mj.learning.attention import AttentionExtractor, AttentionPPO
from socialnav_mj.learning.attention_config import AttentionConfig
from socialnav_mj.learning.folder import CHECKPOINT, HISTORY, PACKAGES, Progress, claim, complete_card
from socialnav_mj.learning.shipping import ATTENTION, BEST
from socialnav_mj.learning.validation import validate
from socialnav_mj.processes import Beside
from socialnav_mj.provenance import package_versions, recording_metadata
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.recordings.window import window


def train_attention(
    config: AttentionConfig,
    folder: str | Path,
    *,
    data_dir: str | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Path:
    """Train a policy, or go on with a training that was stopped, from its last checkpoint and to the same end.

    Args:
        config: Must equal the folder's, if it holds a training.
        folder: Gets config.json, checkpoint.pt, history.json, best.safetensors, best.json and tensorboard/.
        data_dir: Where recordings are looked for first.
        progress: Called at the start, then after every rollout.

    Returns:
        Path of the best policy's weights.

    Raises:
        ValueError: If the folder holds a training with another configuration.
        FileNotFoundError: If a recording is not there.
    """
    folder = Path(folder)
    claim(folder, {"method": ATTENTION, **config.as_dict()})
    torch.set_num_threads(1)
    recordings = [load_recording(name, data_dir=data_dir) for name in config.datasets]
    settings = CrowdSettings(
        recordings=[window(recording, *config.train_window) for recording in recordings],
        features=feature_set(config.features),
        shares=config.shares,
        n_slots=config.n_slots,
        robot_radius=config.robot_radius,
        pedestrian_radius=config.pedestrian_radius,
        turn_limit=config.turn_limit,
        guide=config.guide,
    )
    model = AttentionPPO(CrowdVecEnv(settings, seed=config.seed), config)
    model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
    stored = torch.load(folder / CHECKPOINT, weights_only=True) if (folder / CHECKPOINT).exists() else None
    run = _Run(config, folder, recordings, progress)
    if stored is None:
        run.imitation_error = model.imitate()
    else:
        model.restore(stored["model"])
        run.history, run.transitions = stored["history"], stored["transitions"]
        run.imitation_error, run.seconds = stored["imitation_error"], stored["seconds"]
    run.tell(model, None)
    left = config.scene_steps - model.scene_steps
    if left > 0:
        model.learn(left * model.n_envs, callback=run, reset_num_timesteps=False, log_interval=1)
    with closing(Beside()) as beside:
        complete_card(folder / BEST, config, recordings, run.history, beside, controller=Attention)
    return folder / BEST


def save_attention(model: AttentionPPO, path: Path, card: dict[str, Any]) -> None:
    """Write what `socialnav_mj.controllers.attention` reads.

    Args:
        model: The learner.
        path: Of the .safetensors file; the card is written beside it.
        card: JSON values; the weights' sha256 is added.
    """
    extractor, policy = model.policy.features_extractor, model.policy
    assert isinstance(extractor, AttentionExtractor) and isinstance(policy.action_net, nn.Linear)
    networks: dict[str, list[nn.Module]] = {
        "embed": list(extractor.embed),
        "score": list(extractor.score),
        "value": list(extractor.value),
        "head": [*policy.mlp_extractor.policy_net, policy.action_net],
    }
    tensors = {
        f"{name}.{number}.{kind}": getattr(layer, kind).detach().clone()
        for name, modules in networks.items()
        for number, layer in enumerate(module for module in modules if isinstance(module, nn.Linear))
        for kind in ("weight", "bias")
    }
    content = save(tensors)
    write_whole(path, content)
    write_json(path.with_suffix(".json"), {**card, "sha256": hashlib.sha256(content).hexdigest()})


class _Run(BaseCallback):
    """Between rollouts, when the updates of the last one are done: validate, keep the best, write a checkpoint."""

    def __init__(
        self,
        config: AttentionConfig,
        folder: Path,
        recordings: list[Recording],
        progress: Callable[[Progress], None] | None,
    ) -> None:
        super().__init__()
        self._config, self._folder, self._recordings, self._report = config, folder, recordings, progress
        self.history: list[dict[str, Any]] = []
        self.transitions, self.imitation_error, self.seconds = 0, 0.0, 0.0
        self._begin = process_time()

    def tell(self, model: AttentionPPO, validation: dict[str, Any] | None) -> None:
        if self._report is not None:
            steps = Progress(scene_steps=model.scene_steps, transitions=self.transitions, validation=validation)
            self._report(steps)

    def _on_step(self) -> bool:
        self.transitions += sum(info["active"] for info in self.locals["infos"])
        return True

    def _on_rollout_start(self) -> None:
        self._between_rollouts()

    def _on_training_end(self) -> None:
        self._between_rollouts()

    def _between_rollouts(self) -> None:
        model, config = self.model, self._config
        assert isinstance(model, AttentionPPO)
        done = model.scene_steps
        is_due = (done % config.checkpoint_every == 0 or done == config.scene_steps) and done > 0
        if not is_due or (self.history and self.history[-1]["scene_steps"] == done):
            self.tell(model, None)
            return
        self.seconds += process_time() - self._begin
        self.tell(model, self._validate(model))
        with written_whole(self._folder / CHECKPOINT) as part:
            torch.save(
                {
                    "model": model.checkpoint(),
                    "history": self.history,
                    "transitions": self.transitions,
                    "imitation_error": self.imitation_error,
                    "seconds": self.seconds,
                },
                part,
            )
        write_whole(self._folder / HISTORY, (json.dumps(self.history, indent=1) + "\n").encode())
        self._begin = process_time()

    def _validate(self, model: AttentionPPO) -> dict[str, Any]:
        config = self._config
        latest = self._folder / "latest.safetensors"
        card = {
            "method": ATTENTION,
            "config": config.as_dict(),
            "scene_steps": model.scene_steps,
            "transitions": self.transitions,
            "imitation_error": self.imitation_error,
            "cpu_seconds": self.seconds,
            "recordings": [recording_metadata(recording) for recording in self._recordings],
            "versions": package_versions(PACKAGES),
        }
        save_attention(model, latest, card)
        found, _ = validate(latest, self._recordings, config, config.validation_window, Attention)
        score = found["success"] - config.intrusion_weight * found["intrusion_share"]
        if score >= max((entry["score"] for entry in self.history), default=score):
            save_attention(model, self._folder / BEST, {**card, "score": score})
        entry = {"scene_steps": model.scene_steps, "score": score, "cpu_seconds": self.seconds, **found}
        self.history.append(entry)
        return entry
