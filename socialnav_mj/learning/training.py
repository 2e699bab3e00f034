"""A training from its configuration to its best policy: checkpoints, validation, resume."""

import json
from collections.abc import Callable
from concurrent.futures import Future
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
from socialnav_mj.learning.policy_file import copy_policy, save_policy
from socialnav_mj.learning.replay_irl import ReplayIRL
from socialnav_mj.learning.shipping import BEST
from socialnav_mj.learning.validation import is_kept, validate
from socialnav_mj.processes import Beside
from socialnav_mj.provenance import package_versions, recording_metadata
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.recordings.window import window

LATEST = "latest.safetensors"


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
    with closing(Beside()) as beside, closing(ScenesVecEnv(settings, n_scenes=1, seed=config.seed)) as env:
        model = ReplayIRL(env, experts, features, config)
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        if stored is not None:
            model.restore(stored["model"])
        if progress is not None:
            progress(Progress(scene_steps=model.scene_steps, transitions=model.replay_buffer.size(), validation=None))
        left = config.scene_steps - model.scene_steps
        if left > 0:
            asked = None if stored is None else stored["asked"]
            callback = _Checkpoints(config, folder, recordings, history, asked, beside, progress)
            model.learn(left * env.num_envs, callback=callback, reset_num_timesteps=False, log_interval=1)
        complete_card(folder / BEST, config, recordings, history, beside)
    return folder / BEST


class _Checkpoints(BaseCallback):
    """Every so many scene steps: validate in another process, and write a checkpoint before the next step.

    The learner goes on meanwhile. What a validation says of a policy is written down, and the policy kept if it is the
    best, when it ends; at the latest before the next one, which hence finds the policy's files as they were.
    """

    def __init__(
        self,
        config: TrainingConfig,
        folder: Path,
        recordings: list[Recording],
        history: list[dict[str, Any]],
        asked: dict[str, Any] | None,
        beside: Beside,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        super().__init__()
        self._config, self._folder, self._recordings = config, folder, recordings
        self._history, self._beside, self._report = history, beside, progress
        self._asked = asked
        """What is known already of the checkpoint that is being validated; an entry of the history."""
        self._found: Future[tuple[dict[str, float], float]] | None = None
        self._begin = perf_counter()
        self._outcomes: list[int] = []
        self._is_due = False

    def _on_training_start(self) -> None:
        """A training that was stopped in a validation begins with it."""
        if self._asked is not None:
            self._ask(self._asked)

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
        is_last = scene_steps == self._config.scene_steps
        is_checkpoint = scene_steps % self._config.checkpoint_every == 0 or is_last
        entry = self._entry() if is_checkpoint or (self._found is not None and self._found.done()) else None
        if is_checkpoint:
            if entry is not None:
                self._tell(model, entry)
            counts = np.bincount(self._outcomes, minlength=3) / max(len(self._outcomes), 1)
            names = ("training_arrived", "training_timed_out", "training_collided")
            seconds = {**model.seconds, "all": perf_counter() - self._begin}
            shares = dict(zip(names, counts.tolist(), strict=True))
            self._ask({"scene_steps": scene_steps, **shares, "seconds": seconds})
            self._outcomes, self._is_due = [], True
            entry = self._entry() if is_last else None
        self._tell(model, entry)
        return True

    def _tell(self, model: ReplayIRL, entry: dict[str, Any] | None) -> None:
        if self._report is not None:
            self._report(
                Progress(scene_steps=model.scene_steps, transitions=model.replay_buffer.size(), validation=entry)
            )

    def _ask(self, entry: dict[str, Any]) -> None:
        """Have the policy as it is validated."""
        config, model = self._config, self.model
        assert isinstance(model, ReplayIRL)
        card = {
            "config": config.as_dict(),
            "scene_steps": entry["scene_steps"],
            "transitions": model.replay_buffer.size(),
            "updates": model.updates,
            "recordings": [recording_metadata(recording) for recording in self._recordings],
            "versions": package_versions(PACKAGES),
        }
        latest = self._folder / LATEST
        save_policy(model, latest, card)
        self._asked = entry
        self._found = self._beside.ask(validate, latest, self._recordings, config, config.validation_window)

    def _entry(self) -> dict[str, Any] | None:
        """Wait for the validation under way, if there is one, write it down, and keep the policy if it is the best."""
        if self._found is None or self._asked is None:
            return None
        (validation, seconds), asked, config = self._found.result(), self._asked, self._config
        score = validation["success"] - config.intrusion_weight * validation["intrusion_share"]
        entry = {**asked, "score": score, **validation, "seconds": {**asked["seconds"], "validation": seconds}}
        self._asked = self._found = None
        if is_kept(entry, self._history, config):
            copy_policy(self._folder / LATEST, self._folder / BEST, {"score": score})
        for name in ("success", "intrusion_share", "time_under_way"):
            self.logger.record(f"validation/{name}", validation[name])
        for name in ("training_arrived", "training_timed_out", "training_collided"):
            self.logger.record(f"training/{name}", entry[name])
        self.logger.dump(entry["scene_steps"] * self.model.n_envs)
        self._history.append(entry)
        write_whole(self._folder / HISTORY, (json.dumps(self._history, indent=1) + "\n").encode())
        return entry

    def _write_due_checkpoint(self) -> None:
        if not self._is_due:
            return
        self._is_due = False
        begin, model = perf_counter(), self.model
        assert isinstance(model, ReplayIRL)
        with written_whole(self._folder / CHECKPOINT) as part:
            torch.save({"model": model.checkpoint(), "history": self._history, "asked": self._asked}, part)
        self._begin += perf_counter() - begin
