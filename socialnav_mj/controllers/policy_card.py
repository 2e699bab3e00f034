"""The card of a trained policy: JSON beside its weights, checked before anything of it is used."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from reprlib import repr as short
from typing import Any, get_args

from socialnav_mj.config import TurnLimit


class PolicyError(ValueError):
    """A policy's files are missing, damaged or contradict each other."""


def _is_share_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(type(v) in (int, float) and 0 <= v <= 1 for v in value)


def _is_names(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, str) for v in value)


_REQUIRED: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "sha256": ("64 hexadecimal digits", lambda v: isinstance(v, str) and bool(re.fullmatch("[0-9a-f]{64}", v))),
    "config": ("an object", lambda v: isinstance(v, dict)),
    "config.features": ("a string", lambda v: isinstance(v, str)),
    "config.seed": ("an integer >= 0", lambda v: type(v) is int and v >= 0),
    "config.datasets": ("a list of one or more strings", _is_names),
    "config.turn_limit": ("per_step or per_second", lambda v: v in get_args(TurnLimit)),
    "config.train_window": ("a list of two shares in [0, 1]", _is_share_pair),
    "config.validation_window": ("a list of two shares in [0, 1]", _is_share_pair),
}
"""Key, as a path: what it has to be. Everything else in a card is for people and tables of its training."""


def read_card(path: Path) -> dict[str, Any]:
    """Read and check what a policy's card says of its weights and its training.

    Args:
        path: JSON file beside the weights.

    Returns:
        sha256 (of the weights' file), config (of the training), and what else the training wrote.

    Raises:
        PolicyError: If it is not there, is no JSON object, or lacks a key or has another type there; the file and the
            key are named.
    """
    try:
        card = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise PolicyError(f"{path}: there is no such card") from error
    except (OSError, ValueError, RecursionError) as error:
        raise PolicyError(f"{path} is no readable JSON: {short(str(error) or error)}") from error
    if not isinstance(card, dict):
        raise PolicyError(f"{path} holds {short(card)}; expected an object")
    for key, (expected, is_right) in _REQUIRED.items():
        value: Any = card
        for name in key.split("."):
            if name not in value:
                raise PolicyError(f"{path}: it lacks {key}; expected {expected}")
            value = value[name]
        if not is_right(value):
            raise PolicyError(f"{path}: {key} = {short(value)}; expected {expected}")
    return card
