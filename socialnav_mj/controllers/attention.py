"""`attention`: a policy that weighs the people around it, trained here by reinforcement learning; numpy, no torch."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.controllers.base import Observation, TwistController
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.replay_irl import policies_folder
from socialnav_mj.controllers.weights import Layers, checked_checksum, forward, networks_of, read_weights
from socialnav_mj.elementary import exp
from socialnav_mj.features import People, view_of
from socialnav_mj.geometry import Array

DEFAULT_ATTENTION = "students003_people_seed0"
_PEOPLE = People()


@dataclass(frozen=True, kw_only=True)
class AttentionPolicy:
    """Weights and card. The network is SARL's (Chen et al. 2019, doi 10.1109/ICRA.2019.8794134) with a policy on top.

    e_i = ReLU(embed(own, person_i)); score_i = score(e_i, mean of e); a = softmax of the scores over those who are
    there; the mean action is head(own, sum of a_i value(e_i)), cut to [-1, 1].
    """

    card: dict[str, Any]
    """Of the training, see `policy_card.read_card`."""
    checksum: str
    """sha256 of the weights' file."""
    embed: Layers
    """(own, person): 13 inputs, w outputs, ReLU after the last."""
    score: Layers
    """(e_i, mean e): 2 w inputs, 1 output."""
    value: Layers
    """e_i: w inputs, w outputs."""
    head: Layers
    """(own, pooled): 6 + w inputs, 2 outputs."""

    def attention(self, features: Array) -> tuple[Array, Array]:
        """How much each person counts.

        Args:
            features: Of `features.People`, shape (n, >= 76).

        Returns:
            Shares, shape (n, 10), 0 for nobody, and the people's mean value weighed by them, shape (n, w).
        """
        own, each = _PEOPLE.split(features)
        n, count = each.shape[:2]
        there = each[..., 0] > 0.5
        joint = np.concatenate([np.repeat(own[:, None], count, axis=1), each], axis=2).reshape(n * count, -1)
        embedded = np.maximum(forward(self.embed, joint), 0.0)
        width = embedded.shape[1]
        shown = embedded.reshape(n, count, width) * there[..., None]
        mean = shown.sum(axis=1) / np.maximum(there.sum(axis=1), 1)[:, None]
        pairs = np.concatenate([embedded, np.repeat(mean, count, axis=0)], axis=1)
        score = np.where(there, forward(self.score, pairs).reshape(n, count), -np.inf)
        highest = np.where(there.any(axis=1), score.max(axis=1), 0.0)
        share = exp(np.where(there, score - highest[:, None], -700.0)) * there
        share /= np.maximum(share.sum(axis=1), 1e-12)[:, None]
        values = forward(self.value, embedded).reshape(n, count, width)
        return share, np.einsum("nk,nkw->nw", share, values)

    def action(self, features: Array) -> Array:
        """Mean action.

        Args:
            features: Of `features.People`, shape (n, >= 76).

        Returns:
            (speed, turn) in [-1, 1], shape (n, 2).
        """
        own, _ = _PEOPLE.split(features)
        _, pooled = self.attention(features)
        return np.clip(forward(self.head, np.concatenate([own, pooled], axis=1)), -1.0, 1.0)


def attention_folder() -> Path:
    """Folder of the shipped policies of this kind.

    Returns:
        `attention` in the folder of policies.
    """
    return policies_folder() / "attention"


def load_attention(name_or_path: str) -> AttentionPolicy:
    """Read a policy; never runs code from its files.

    Args:
        name_or_path: Name of a shipped policy, or path of a .safetensors file with its card beside it.

    Returns:
        Weights that fit together and the card that they have the sha256 of.

    Raises:
        PolicyError: If there is none, or its files are damaged or contradict each other.
    """
    is_path = name_or_path.endswith(".safetensors")
    path = Path(name_or_path) if is_path else attention_folder() / f"{name_or_path}.safetensors"
    if not path.is_file():
        known = ", ".join(sorted(own.stem for own in attention_folder().glob("*.safetensors")))
        raise PolicyError(
            f"there is no attention policy {name_or_path!r}; available: {known}, or the path of a .safetensors file"
        )
    card_path = path.with_suffix(".json")
    return _read(path, path.stat().st_mtime_ns, card_path.stat().st_mtime_ns if card_path.exists() else 0)


@lru_cache(maxsize=8)
def _read(path: Path, *_modified: int) -> AttentionPolicy:
    """Read a policy once for each state of its files."""
    card, checksum, tensors = read_weights(path)
    if card["config"]["features"] != _PEOPLE.name:
        raise PolicyError(f"{path}: config.features = {card['config']['features']!r}; expected {_PEOPLE.name!r}")
    width = len(tensors.get("value.0.bias", ()))
    shapes = {
        "embed": (_PEOPLE.n_own + _PEOPLE.n_each, width),
        "score": (2 * width, 1),
        "value": (width, width),
        "head": (_PEOPLE.n_own + width, 2),
    }
    return AttentionPolicy(card=card, checksum=checksum, **networks_of(path, tensors, shapes))


@dataclass(kw_only=True)
class Attention(TwistController):
    """Drives the mean action of a trained `AttentionPolicy`, as `replay_irl` drives its actor's."""

    policy: str = DEFAULT_ATTENTION
    """Name of a shipped policy, or path of a .safetensors file."""
    checksum: str | None = None
    """sha256 that the weights must have; None takes them as they are. It travels in every episode."""
    name: str = "attention"
    _trained: AttentionPolicy = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._trained = load_attention(self.policy)
        self.checksum = checked_checksum(self.policy, self._trained.checksum, self.checksum)

    def twist(self, observation: Observation) -> Array:
        """The mean action, scaled to the limits.

        Args:
            observation: Keys as in `socialnav_mj.observation`; uses active and what `features.view.view_of` uses.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        rows = np.flatnonzero(observation["active"])
        result = np.zeros((len(observation["active"]), 2))
        if rows.size:
            features = _PEOPLE(view_of(observation, rows))
            result[rows] = self.limits.twist_of_action(self._trained.action(features))
        return result
