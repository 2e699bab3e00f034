"""Everything that can be set of a scenario or of a training, as options of a command."""

import ast
import inspect
from dataclasses import MISSING, field, fields, make_dataclass
from typing import Annotated, Any, get_type_hints

import tyro

from socialnav_mj.config import SETTINGS, Robot, Scenario
from socialnav_mj.learning.attention_config import AttentionConfig
from socialnav_mj.learning.config import TrainingConfig

_OF_THE_COMMAND = ("share", "seed")
"""What `--scenarios` and `--seed` say."""


def _descriptions(kind: type) -> dict[str, str]:
    """Field: the string below it, which tyro finds only in the class that it makes options of."""
    try:
        (definition,) = ast.parse(inspect.getsource(kind)).body
    except OSError:  # installed without its source: the options are there, without a word about them
        return {}
    assert isinstance(definition, ast.ClassDef)
    return {
        name.target.id: inspect.cleandoc(text.value.value)
        for name, text in zip(definition.body, definition.body[1:], strict=False)
        if isinstance(name, ast.AnnAssign)
        and isinstance(name.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }


def _options(kind: type, prefix: str = "") -> dict[str, tuple[Any, Any]]:
    """Setting: its annotation and its dataclass field."""
    hints, descriptions = get_type_hints(kind), _descriptions(kind)
    return {
        f"{prefix}{own.name}": (
            Annotated[hints[own.name], tyro.conf.arg(help=descriptions.get(own.name, ""))],
            field(default=own.default),
        )
        for own in fields(kind)
        if own.default is not MISSING
    }


TrainingSettings, AttentionSettings = (
    make_dataclass(
        name,
        [(setting, *option) for setting, option in _options(kind).items() if setting not in hidden],
        frozen=True,
        kw_only=True,
    )
    for name, kind, hidden in (
        ("TrainingSettings", TrainingConfig, ("datasets",)),
        ("AttentionSettings", AttentionConfig, ("datasets", "features")),
    )
)

_ALL = {**_options(Scenario), **_options(Robot, "robot_")}
Settings = make_dataclass(
    "Settings",
    [(name, *_ALL[name]) for name in SETTINGS if name not in _OF_THE_COMMAND],
    frozen=True,
    kw_only=True,
)


def changes(settings: object) -> dict[str, Any]:
    """What differs from the default.

    Args:
        settings: A `Settings`, as the command line made it.

    Returns:
        Setting: value, as keyword arguments of `Scenario.changed`.
    """
    default = vars(Settings())
    return {name: value for name, value in vars(settings).items() if value != default[name]}
