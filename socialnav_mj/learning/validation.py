"""What a policy does on a part of a recording, and which checkpoint of a training is kept."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from socialnav_mj import metrics
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Controller
from socialnav_mj.controllers.replay_irl import ReplayIRL as Policy
from socialnav_mj.environment import build_environment
from socialnav_mj.learning.attention_config import AttentionConfig
from socialnav_mj.learning.config import TrainingConfig
from socialnav_mj.recordings import Recording
from socialnav_mj.recordings.window import window
from socialnav_mj.rollout import rollout


def validate(
    policy_path: Path,
    recordings: list[Recording],
    config: TrainingConfig | AttentionConfig,
    part: tuple[float, float],
    controller: Callable[..., Controller] = Policy,
) -> tuple[dict[str, float], float]:
    """Success and intrusions of a training's policy in a part of recordings, on one thread of whatever process.

    Args:
        policy_path: Of the weights.
        recordings: Whole recordings.
        config: Of the training: shares of replaced people, whose scenes have draws 0, 1, 2, ..., and turn limit.
        part: Window, as shares of the recordings' duration.
        controller: Drives the policy, a path, that it is given as `policy`.

    Returns:
        success, intrusion_share, time_under_way [s], n_agents; and the time that it took [s].
    """
    threadpool_limits(1)  # of numpy's products
    begin = perf_counter()
    success: list[float] = []
    time: list[float] = []
    intrusions = steps = 0.0
    for recording in recordings:
        for draw, share in enumerate(config.validation_shares):
            environment = build_environment(
                window(recording, *part), Scenario(share=share, seed=draw, turn_limit=config.turn_limit)
            )
            values = metrics.per_agent(rollout(environment, controller(policy=str(policy_path))))
            success += values["success"].astype(float).tolist()
            time += values["time_under_way"].tolist()
            intrusions += float(np.nansum(values["intimate_intrusions"]))
            steps += float(np.nansum(values["active_steps"]))
    found = {
        "success": float(np.mean(success)),
        "intrusion_share": intrusions / max(steps, 1.0),
        "time_under_way": float(np.nanmean(time)),
        "n_agents": float(len(success)),
    }
    return found, perf_counter() - begin


def is_kept(entry: Mapping[str, Any], history: Sequence[Mapping[str, Any]], config: TrainingConfig) -> bool:
    """Whether a checkpoint is to be kept instead of an earlier one.

    Args:
        entry: Its scene_steps, score, success and n_agents.
        history: Of all earlier checkpoints.
        config: Of the training.

    Returns:
        Whether its score is at most one standard error below the best; once a checkpoint is late, of the late ones.
    """
    late = config.kept_from * config.scene_steps
    rivals = [e for e in history if (e["scene_steps"] >= late) == (entry["scene_steps"] >= late)]
    best = max((*rivals, entry), key=lambda e: e["score"])
    error = math.sqrt(best["success"] * (1.0 - best["success"]) / best["n_agents"])
    return bool(entry["score"] >= best["score"] - error)
