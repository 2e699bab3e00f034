"""The learned policy (paper section III-A): a trained SAC actor in numpy, without torch."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.config import Scenario, TurnLimit
from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.weights import Layers, checked_checksum, forward, networks_of, read_weights
from socialnav_mj.elementary import tanh
from socialnav_mj.features import N_FLAGS, FeatureSet, feature_set, running_state, view_of
from socialnav_mj.geometry import Array
from socialnav_mj.resources import assets_folder

DEFAULT_POLICY = "plaza_continuous_seed0"


@dataclass(frozen=True, kw_only=True)
class TrainedPolicy:
    """Weights and card of a trained policy."""

    card: dict[str, Any]
    """What `policy_card.read_card` returns: data, seed, configuration and metrics."""
    checksum: str
    """sha256 of the weights' file."""
    features: FeatureSet
    """Makes the networks' input of what agents see."""
    actor: Layers
    """(weight (out, in), bias (out,)) of each layer of the actor, size + 2 inputs, 2 outputs."""
    reward: Layers
    """The same of the reward network, size + 2 inputs, 1 output."""

    @property
    def training_seed(self) -> int:
        """Seed that the card says the training had."""
        return int(self.card["config"]["seed"])

    @property
    def turn_limit(self) -> str:
        """Reading of the turn limit that the card says the training had."""
        return str(self.card["config"]["turn_limit"])

    def action(self, state: Array) -> Array:
        """Deterministic action of the actor: tanh of the mean.

        Args:
            state: Features and flags, see `socialnav_mj.features.states`, shape (n, size + 2).

        Returns:
            (speed, turn) in [-1, 1], shape (n, 2).
        """
        return tanh(forward(self.actor, state))

    def reward_of(self, state: Array) -> Array:
        """What the reward network gives to states: tanh of its output.

        Args:
            state: Features and flags, shape (n, size + 2).

        Returns:
            Shape (n,), in (-1, 1).
        """
        reward: Array = tanh(forward(self.reward, state))[:, 0]
        return reward


def policies_folder() -> Path:
    """Folder of the shipped policies: weights as .safetensors, each with its card.

    Returns:
        `policies` in the assets folder.
    """
    return assets_folder() / "policies"


def shipped_policies() -> tuple[str, ...]:
    """Names of the policies that come with the package.

    Returns:
        Names of files in `policies_folder` without .safetensors, in alphabetical order.
    """
    return tuple(sorted(path.stem for path in policies_folder().glob("*.safetensors")))


def policy_of(dataset: str, turn_limit: TurnLimit = Scenario.turn_limit) -> str:
    """The shipped policy that learned from a recording alone; of several training seeds the first.

    Args:
        dataset: Name of the recording.
        turn_limit: Under which it is to drive.

    Returns:
        Its name; that of one trained under the default limit if none was under this one, and `DEFAULT_POLICY` if none
        learned from the recording.
    """
    limit = "" if turn_limit == Scenario.turn_limit else f"_{turn_limit}"
    names = (f"{dataset}_continuous{limit}_seed0", f"{dataset}_continuous_seed0")
    return next((name for name in names if name in shipped_policies()), DEFAULT_POLICY)


def policy_path(name_or_path: str) -> Path:
    """Where a policy's weights are.

    Args:
        name_or_path: Name of a shipped policy, or path of a .safetensors file.

    Returns:
        The .safetensors file; its card is beside it.

    Raises:
        PolicyError: If there is none.
    """
    if name_or_path.endswith(".safetensors"):
        path = Path(name_or_path)
    else:
        path = policies_folder() / f"{name_or_path}.safetensors"
    if not path.is_file():
        raise PolicyError(
            f"there is no policy {name_or_path!r}; available: {', '.join(shipped_policies())}, or the path of a "
            ".safetensors file"
        )
    return path


def load_policy(name_or_path: str) -> TrainedPolicy:
    """Read a policy: NAME.safetensors and NAME.json; never runs code from them.

    Args:
        name_or_path: Name of a shipped policy, or path of a .safetensors file with its card beside it.

    Returns:
        Weights that fit together and the card that they have the sha256 of; read once as long as the files stay.

    Raises:
        PolicyError: If there is none, or its files are damaged or contradict each other.
    """
    path = policy_path(name_or_path)
    card_path = path.with_suffix(".json")
    return _read(path, path.stat().st_mtime_ns, card_path.stat().st_mtime_ns if card_path.exists() else 0)


@lru_cache(maxsize=32)
def _read(path: Path, *_modified: int) -> TrainedPolicy:
    """Read a policy once for each state of its files."""
    card, checksum, tensors = read_weights(path)
    try:
        features = feature_set(card["config"]["features"])
    except ValueError as error:
        raise PolicyError(f"{path.with_suffix('.json')}: config.features: {error}") from error
    inputs = features.size + N_FLAGS
    networks = networks_of(path, tensors, {"actor": (inputs, 2), "reward": (inputs, 1)})
    return TrainedPolicy(card=card, checksum=checksum, features=features, **networks)


@dataclass(kw_only=True)
class ReplayIRL(TwistController):
    """Acts as the trained actor's mean: speed (a_0 + 1) / 2 of the limit, yaw rate a_1 of the limit."""

    policy: str = DEFAULT_POLICY
    """Name of a shipped policy, or path of a .safetensors file."""
    checksum: str | None = None
    """sha256 that the weights must have; None takes them as they are. It travels in every episode."""
    name: str = "replay_irl"
    _trained: TrainedPolicy = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._trained = load_policy(self.policy)
        self.checksum = checked_checksum(self.policy, self._trained.checksum, self.checksum)

    def twist(self, observation: Observation) -> Array:
        """The actor's mean action, scaled to the limits.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses active and what `features.view.view_of` uses.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        result = np.zeros((len(observation["active"]), 2))
        if rows.size:
            state = running_state(self._trained.features(view_of(observation, rows)))
            result[rows] = self.limits.twist_of_action(self._trained.action(state))
        return result
