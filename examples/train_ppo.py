"""Train PPO for ten minutes in scenario 1 of a recording, then evaluate it beside the shipped controllers.

python examples/train_ppo.py --dataset plaza --minutes 10 --out runs/ppo
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from socialnav_mj.envs.guided import CrowdSettings
from socialnav_mj.envs.sb3 import CrowdVecEnv
from socialnav_mj.features import feature_set
from socialnav_mj.recordings import load_recording


class Deadline(BaseCallback):
    """Stops the training after a time."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._end = time.monotonic() + seconds

    def _on_step(self) -> bool:
        return time.monotonic() < self._end


def train(dataset: str, seconds: float, path: Path, *, n_slots: int = 24, n_steps: int = 128) -> None:
    """Learn from the task's own reward; every slot of the crowd is one of PPO's environments."""
    torch.set_num_threads(1)
    settings = CrowdSettings(
        recordings=[load_recording(dataset)], features=feature_set("continuous"), shares=[0.1], n_slots=n_slots
    )
    crowd = CrowdVecEnv(settings, seed=0)
    # Empty slots give zeros, which say nothing and cost little; a learner of one's own would leave them out.
    model = PPO(
        "MlpPolicy", crowd, n_steps=n_steps, batch_size=n_slots * n_steps // 8, gamma=0.97, seed=0, device="cpu"
    )
    model.learn(10**9, callback=Deadline(seconds))
    model.save(path)


def main() -> None:
    """Train, then evaluate on draws that nothing was chosen on."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", default="plaza")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--out", type=Path, default=Path("runs/ppo"))
    parser.add_argument("--controllers", nargs="+", default=["potential_field", "replay_irl"])
    parser.add_argument("--draws", default="3")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "ppo.zip"
    train(options.dataset, 60.0 * options.minutes, path)
    spec = f"sb3:{path}"
    command = [sys.executable, "-m", "socialnav_mj", "evaluate", "--dataset", options.dataset, "--scenarios", "1"]
    command += ["--controllers", *options.controllers, spec, "--trust", spec, "--draws", options.draws, "--seed", "100"]
    subprocess.run([*command, "--out", str(options.out / "evaluation")], check=True)


if __name__ == "__main__":
    main()
