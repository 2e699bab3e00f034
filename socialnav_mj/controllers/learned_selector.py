"""`learned_selector`: of several policies the one that is expected to cost least, as learned from trials of each."""

import hashlib
import json
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load

from socialnav_mj.controllers.base import IS_CONTROLLER, Limits, Observation, TwistController
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.potential_field import PotentialFieldCapped
from socialnav_mj.controllers.replay_irl import ReplayIRL
from socialnav_mj.controllers.situation import NAMES, situation
from socialnav_mj.controllers.switching import SwitchingController, check_candidates
from socialnav_mj.controllers.weights import Layers, forward, networks_of
from socialnav_mj.features import view_of
from socialnav_mj.geometry import Array
from socialnav_mj.resources import assets_folder

DEFAULT_WEIGHTS = "students003"


@dataclass(frozen=True, kw_only=True)
class Outcomes:
    """What each of c policies is expected to cost in a situation."""

    card: dict[str, Any]
    """Of the training; `candidates` are names of the policies."""
    checksum: str
    """sha256 of the weights' file."""
    layers: Layers
    """A network from 15 numbers to c costs; a linear one has one layer."""

    def __call__(self, numbers: Array) -> Array:
        """Expected costs.

        Args:
            numbers: Of `situation.situation`, (n, 15).

        Returns:
            (n, c) [s].
        """
        return forward(self.layers, numbers)


def selectors_folder() -> Path:
    """Folder of the shipped weights, each with its card.

    Returns:
        `selectors` in the assets folder.
    """
    return assets_folder() / "selectors"


def load_outcomes(name_or_path: str) -> Outcomes:
    """Read what a training has learned; never runs code from it.

    Args:
        name_or_path: Name of shipped weights, or path of a .safetensors file with its card beside it.

    Returns:
        Weights that fit the card, which has their sha256.

    Raises:
        PolicyError: If there are none, or the files are damaged or contradict each other.
    """
    path = Path(name_or_path)
    if path.suffix != ".safetensors":
        path = selectors_folder() / f"{name_or_path}.safetensors"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in selectors_folder().glob("*.safetensors")))
        raise PolicyError(f"there are no weights {name_or_path!r}; available: {known}, or a path of .safetensors")
    card = path.with_suffix(".json")
    return _read(path, path.stat().st_mtime_ns, card.stat().st_mtime_ns if card.exists() else 0)


@lru_cache(maxsize=8)
def _read(path: Path, *_modified: int) -> Outcomes:
    content, card_path = path.read_bytes(), path.with_suffix(".json")
    checksum = hashlib.sha256(content).hexdigest()
    try:
        card = json.loads(card_path.read_text(encoding="utf-8"))
        names, stated, features = card["candidates"], card["sha256"], card["features"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise PolicyError(f"{card_path} is no card of a learned selector: {error!r}") from error
    if stated != checksum:
        raise PolicyError(f"{path} has sha256 {checksum}, but its card says {stated}")
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)) or features != list(NAMES):
        raise PolicyError(f"{card_path}: candidates have to be names, and features {list(NAMES)}")
    try:
        tensors = load(content)
    except Exception as error:
        # Which exceptions a file that was made to do harm can provoke here is the library's matter.
        raise PolicyError(f"{path} is no readable safetensors file: {error!r}") from error
    networks = networks_of(path, tensors, {"outcomes": (len(NAMES), len(names))})
    return Outcomes(card=card, checksum=checksum, layers=networks["outcomes"])


def default_candidates() -> tuple[TwistController, ...]:
    """Both planners of `selector`, and two policies that do not plan.

    Returns:
        New ones, each with its spec as its name.
    """
    calm, free = (MPC(preset=preset, name=f"mpc(preset={preset!r})") for preset in ("calm", "free"))
    return calm, free, PotentialFieldCapped(), ReplayIRL()


@dataclass(kw_only=True)
class LearnedSelector(SwitchingController):
    """Lets the policy act that is expected to cost least if it acts for the next 2.4 s.

    What each costs was learned from trials: in real episodes a policy drawn at random acted for 2.4 s, again and again,
    and what came of it was regressed on the situation (`socialnav_mj.learning.trials`).
    """

    candidates: tuple[TwistController, ...] = field(default_factory=default_candidates, metadata={IS_CONTROLLER: True})
    """Policies to choose from, those of the weights in their order."""
    weights: str = DEFAULT_WEIGHTS
    """Name of shipped weights, or path of a .safetensors file of `train learned-selector`."""
    checksum: str | None = None
    """sha256 that the weights must have; None takes them as they are. It travels in every episode."""
    bonus: float = 0.05
    """By which whoever drove last is cheaper, >= 0, so that equals do not alternate [s]."""
    name: str = "learned_selector"
    _outcomes: Outcomes = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (isinstance(self.bonus, (int, float)) and 0.0 <= self.bonus < np.inf):
            raise ValueError(f"bonus = {self.bonus!r} is not allowed; allowed: numbers >= 0")
        self.candidates = tuple(self.candidates)
        check_candidates(self.candidates)
        self._outcomes = load_outcomes(self.weights)
        if self.checksum not in (None, self._outcomes.checksum):
            raise PolicyError(
                f"weights {self.weights!r} have checksum {self._outcomes.checksum}, but {self.checksum} is asked for"
            )
        self.checksum = self._outcomes.checksum
        learned = self._outcomes.card["candidates"]
        if [kind_of(name) for name in self.policies] != [kind_of(name) for name in learned]:
            raise ValueError(f"candidates = {self.policies} is not allowed; {self.weights!r} was learned for {learned}")

    @property
    def members(self) -> tuple[TwistController, ...]:
        """The candidates."""
        return self.candidates

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Reset all candidates for the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Given to all.
        """
        super().reset(limits, seed=seed)
        self._person = np.zeros(0, dtype=np.int64)

    def choose(self, observation: Observation) -> NDArray[np.int64]:
        """Expect a cost of each candidate; whoever acted at the step before is cheaper by the bonus.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            The candidate of least cost, shape (n_agents,).
        """
        active = observation["active"]
        rows = np.flatnonzero(active)
        costs = np.full((len(active), len(self.candidates)), np.nan)
        if rows.size:
            costs[rows] = self._outcomes(situation(view_of(observation, rows)))
        person = np.where(active, observation["person"], -1)
        if len(self._person) == len(person):
            again = np.flatnonzero(active & (self._person == person))
            costs[again, self._acting[again]] -= self.bonus
        self._person = person
        return self.cheapest(costs)


def kind_of(name: str) -> str:
    """A policy's name without the weights that it acts with: those may be other ones than in the training.

    Args:
        name: As `policies` gives it.

    Returns:
        "replay_irl" for any name that begins so, else the name.
    """
    return "replay_irl" if name.startswith("replay_irl") else name
