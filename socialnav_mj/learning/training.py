"""A training from its configuration to its best policy: checkpoints, validation, resume."""

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from threadpoolctl import threadpool_limits

from socialnav_mj.config import Scenario
from socialnav_mj.envs.guided import CrowdSettings
from socialnav_mj.envs.scenes import ScenesVecEnv
from socialnav_mj.features import feature_set
from socialnav_mj.files import write_whole, written_whole
from socialnav_mj.learning.config import TrainingConfig
from socialnav_mj.learning.experts import Demonstrations, demonstrate
from socialnav_mj.learning.folder import CHECKPOINT, HISTORY, PACKAGES, Progress, claim, complete_card
from socialnav_mj.learning.policy_file import save_policy
from socialnav_mj.learning.replay_irl import ReplayIRL
from socialnav_mj.learning.shipping import BEST
from socialnav_mj.learning.validation import is_kept, validate
from socialnav_mj.provenance import package_versions, recording_metadata
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.recordings.window import window


def train(
    config: TrainingConfig,
    folder: str | Path,
    *,
    data_dir: str | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Path:
    """Train ReplayIRL, or go on with a training that was stopped, from its last checkpoint and to the same end.

    Args:
        config: Must equal the folder's, if it holds a training.
        folder: Gets config.json, checkpoint.pt, history.json, best.safetensors, best.json and tensorboard/.
        data_dir: Where recordings are looked for first.
        progress: Called at the start, then after every scene step.

    Returns:
        Path of the best policy's weights.

    Raises:
        ValueError: If the folder holds a training with another configuration.
        FileNotFoundError: If a recording is not there.
    """
    folder = Path(folder)
    claim(folder, config.as_dict())
    torch.set_num_threads(1)
    threadpool_limits(1)  # of numpy's products
    recordings = [load_recording(name, data_dir=data_dir) for name in config.datasets]
    features = feature_set(config.features)
    training = [window(recording, *config.train_window) for recording in recordings]
    experts = Demonstrations.joined(
        [
            demonstrate(
                recording,
                features,
                Scenario(share=1.0, turn_limit=config.turn_limit),
                minimum_displacement=config.expert_displacement,
                contact_distance=config.expert_contact_distance,
                clearance=config.expert_clearance,
                companions_seen=config.companions_seen,
            )
            for recording in training
        ]
    )
    stored = torch.load(folder / CHECKPOINT, weights_only=True) if (folder / CHECKPOINT).exists() else None
    history: list[dict[str, Any]] = [] if stored is None else stored["history"]
    settings = CrowdSettings(
        recordings=training,
        features=features,
        shares=config.shares,
        n_slots=config.n_slots,
        robot_radius=config.robot_radius,
        pedestrian_radius=config.pedestrian_radius,
        turn_limit=config.turn_limit,
        guide=config.guide,
    )
    with closing(ScenesVecEnv(settings, n_scenes=1, seed=config.seed)) as env:
        model = ReplayIRL(env, experts, features, config)
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        if stored is not None:
            model.restore(stored["model"])
        if progress is not None:
            progress(Progress(scene_steps=model.scene_steps, transitions=model.replay_buffer.size(), validation=None))
        left = config.scene_steps - model.scene_steps
        if left > 0:
            callback = _Checkpoints(config, folder, recordings, history, progress)
            model.learn(left * env.num_envs, callback=callback, reset_num_timesteps=False, log_interval=1)
    complete_card(folder / BEST, config, recordings, history)
    return folder / BEST


class _Checkpoints(BaseCallback):
    """Every so many scene steps: validate, keep the best policy, and write a checkpoint before the next step."""

    def __init__(
        self,
        config: TrainingConfig,
        folder: Path,
        recordings: list[Recording],
        history: list[dict[str, Any]],
        progress: Callable[[Progress], None] | None,
    ) -> None:
        super().__init__()
        self._config, self._folder, self._recordings = config, folder, recordings
        self._history, self._report = history, progress
        self._begin = perf_counter()
        self._outcomes: list[int] = []
        self._is_due = False

    def _on_rollout_start(self) -> None:
        """Between two steps of the scene all can be brought back."""
        self._write_due_checkpoint()

    def _on_training_end(self) -> None:
        self._write_due_checkpoint()

    def _on_step(self) -> bool:
        """After every step of the scene, before its updates.

        Returns:
            True: go on.
        """
        model = self.model
        assert isinstance(model, ReplayIRL)
        scene_steps = model.scene_steps
        self._outcomes += [info["outcome"] for info in self.locals["infos"] if "outcome" in info]
        validation = None
        if scene_steps % self._config.checkpoint_every == 0 or scene_steps == self._config.scene_steps:
            validation = self._validate(model, scene_steps)
        if self._report is not None:
            self._report(
                Progress(scene_steps=scene_steps, transitions=model.replay_buffer.size(), validation=validation)
            )
        return True

    def _validate(self, model: ReplayIRL, scene_steps: int) -> dict[str, float]:
        config, folder = self._config, self._folder
        elapsed = perf_counter() - self._begin
        latest = folder / "latest.safetensors"
        card = {
            "config": config.as_dict(),
            "scene_steps": scene_steps,
            "transitions": model.replay_buffer.size(),
            "updates": model.updates,
            "recordings": [recording_metadata(recording) for recording in self._recordings],
            "versions": package_versions(PACKAGES),
        }
        save_policy(model, latest, card)
        begin = perf_counter()
        validation = validate(
            latest,
            self._recordings,
            part=config.validation_window,
            shares=config.validation_shares,
            turn_limit=config.turn_limit,
        )
        validation_seconds = perf_counter() - begin
        score = validation["success"] - config.intrusion_weight * validation["intrusion_share"]
        counts = np.bincount(self._outcomes, minlength=3) / max(len(self._outcomes), 1)
        entry = {
            "scene_steps": scene_steps,
            "score": score,
            **validation,
            "training_arrived": float(counts[0]),
            "training_timed_out": float(counts[1]),
            "training_collided": float(counts[2]),
            "seconds": {**model.seconds, "all": elapsed, "validation": validation_seconds},
        }
        self._outcomes = []
        if is_kept(entry, self._history, config):
            save_policy(model, folder / BEST, {**card, "score": score})
        for name in ("success", "intrusion_share", "time_under_way"):
            model.logger.record(f"validation/{name}", validation[name])
        for name in ("training_arrived", "training_timed_out", "training_collided"):
            model.logger.record(f"training/{name}", entry[name])
        model.logger.dump(model.num_timesteps)
        self._history.append(entry)
        self._is_due = True
        self._begin += perf_counter() - begin
        return validation

    def _write_due_checkpoint(self) -> None:
        if not self._is_due:
            return
        self._is_due = False
        begin, model = perf_counter(), self.model
        assert isinstance(model, ReplayIRL)
        with written_whole(self._folder / CHECKPOINT) as part:
            torch.save({"model": model.checkpoint(), "history": self._history}, part)
        write_whole(self._folder / HISTORY, (json.dumps(self._history, indent=1) + "\n").encode())
        self._begin += perf_counter() - begin
