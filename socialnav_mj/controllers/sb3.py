"""`sb3:policy.zip`: a policy that stable-baselines3 saved, as a controller."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np

from socialnav_mj.controllers.base import ActionKind, Observation, TwistController
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.features import FEATURE_SETS, N_FLAGS
from socialnav_mj.features.seen import Flat, Nearest, Observer
from socialnav_mj.geometry import Array, twist_of_wheel_speed
from socialnav_mj.resources import install_hint

PREFIX = "sb3:"
"""Of the specs of such controllers; the path follows."""


@dataclass(kw_only=True)
class SB3Policy(TwistController):
    """Drives the deterministic action of a policy that was trained on `socialnav_mj.envs` and saved with `model.save`.

    It sees what it was trained on: a flat observation is known by its length, a dictionary by its keys. Reading such a
    file runs code that it holds, so the file has to be trusted: its sha256 is asked for. Torch computes it, whose last
    bits depend on the processor; these episodes are repeatable on the same machine.
    """

    path: str
    """Of the .zip file."""
    checksum: str | None = None
    """sha256 of the file that is trusted; without it the file is not read."""
    action: ActionKind = "twist"
    """What the policy's two numbers are, as in its training."""
    name: str = ""
    """sb3: and the path, by default."""
    _policy: Any = field(init=False, repr=False)
    _observer: Observer = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.name = self.name or f"{PREFIX}{self.path}"
        if self.action not in get_args(ActionKind):
            raise ValueError(f"action = {self.action!r} is not allowed; allowed: {', '.join(get_args(ActionKind))}")
        found = checksum_of(self.path)
        if self.checksum is None:
            raise PolicyError(
                f"reading {self.path} runs the code in it. If you trust it, add --trust {PREFIX}{self.path}, or name "
                f"what you trust: {PREFIX}{self.path}(checksum='{found}')"
            )
        if self.checksum != found:
            raise PolicyError(f"{self.path} has sha256 {found}, but {self.checksum} is trusted")
        self._policy = _load(self.path)
        self._observer = _observer_for(self.path, self._policy.observation_space)

    def twist(self, observation: Observation) -> Array:
        """What the policy would do, without noise.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        result = np.zeros((len(observation["active"]), 2))
        if rows.size:
            seen = self._observer(observation, rows)
            action, _ = self._policy.predict(seen.get("", seen), deterministic=True)
            limits = self.limits
            wheel_speed = limits.wheel_speed_of_action(np.asarray(action, dtype=float), self.action)
            result[rows] = twist_of_wheel_speed(wheel_speed, wheel_radius=limits.wheel_radius, track=limits.track)
        return result


def checksum_of(path: str) -> str:
    """sha256 of a policy's file.

    Args:
        path: Of the .zip file.

    Returns:
        64 hexadecimal digits.

    Raises:
        PolicyError: If it cannot be read.
    """
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise PolicyError(f"{path} cannot be read: {error.strerror}; expected a .zip that model.save wrote") from error


def _load(path: str) -> Any:
    """The policy of any of stable-baselines3's algorithms; runs what the file holds."""
    try:
        from stable_baselines3.common.save_util import load_from_zip_file
    except ImportError as error:
        raise PolicyError(f"{path} needs the extra 'train' ({install_hint('train')}): {error}") from error
    try:
        data, parameters, _ = load_from_zip_file(path, device="cpu")
        assert data is not None
        kwargs = dict(data["policy_kwargs"])
        if data.get("use_sde"):
            kwargs.setdefault("use_sde", True)
        policy = data["policy_class"](data["observation_space"], data["action_space"], lambda _: 0.0, **kwargs)
        policy.load_state_dict(parameters["policy"])
    except Exception as error:
        # A file that is none of stable-baselines3's can fail in any way.
        raise PolicyError(f"{path} is no policy that stable-baselines3 saved: {error!r}") from error
    policy.set_training_mode(False)
    if getattr(data["action_space"], "shape", None) != (2,):
        raise PolicyError(f"{path}: its actions are {data['action_space']}; expected two numbers in [-1, 1]")
    return policy


def _observer_for(path: str, space: Any) -> Observer:
    """What a policy with this observation space was shown in its training."""
    keys = getattr(space, "spaces", None)
    if keys is not None:
        nearest = Nearest(max(1, int(np.prod(keys["people_mask"].shape)))) if "people_mask" in keys else None
        if nearest is not None and {key: box.shape for key, box in keys.items()} == {
            key: (size,) for key, (_, _, size) in nearest.bounds.items()
        }:
            return nearest
    else:
        for features in FEATURE_SETS.values():
            if space.shape == (features.size + N_FLAGS,):
                return Flat(features)
    raise PolicyError(f"{path}: it observes {space}; expected an observation of socialnav_mj.envs")
