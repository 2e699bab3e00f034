"""Controllers by name: the built-in ones, those of installed packages, and any class by its path."""

import ast
import re
from collections.abc import Callable
from dataclasses import Field, fields, is_dataclass
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from importlib.metadata import entry_points
from operator import attrgetter
from typing import Any

from socialnav_mj.controllers.attention import Attention
from socialnav_mj.controllers.base import IS_CONTROLLER, Controller
from socialnav_mj.controllers.dynamic_window import DynamicWindow
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.hybrid import Hybrid
from socialnav_mj.controllers.identity import json_value, parameters_of
from socialnav_mj.controllers.irl_mpc import IRLMPC
from socialnav_mj.controllers.learned_selector import LearnedSelector
from socialnav_mj.controllers.medirl_sam import MEDIRLSAM
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.mpdm import MPDM
from socialnav_mj.controllers.mppi import MPPI
from socialnav_mj.controllers.orca import ORCA
from socialnav_mj.controllers.potential_field import PotentialField, PotentialFieldCapped
from socialnav_mj.controllers.replay_irl import ReplayIRL
from socialnav_mj.controllers.sb3 import PREFIX, SB3Policy
from socialnav_mj.controllers.selector import Selector
from socialnav_mj.controllers.social_force import SocialForce
from socialnav_mj.controllers.stand_still import StandStill

ENTRY_POINT_GROUP = "socialnav_mj.controllers"

BUILT_IN: dict[str, Callable[..., Controller]] = {
    "potential_field": PotentialField,
    "potential_field_capped": PotentialFieldCapped,
    "replay_irl": ReplayIRL,
    "hybrid": Hybrid,
    "go_straight": GoStraight,
    "social_force": SocialForce,
    "orca": ORCA,
    "dynamic_window": DynamicWindow,
    "mpdm": MPDM,
    "selector": Selector,
    "stand_still": StandStill,
    "mpc": MPC,
    "mppi": MPPI,
    "irl_mpc": IRLMPC,
    "learned_selector": LearnedSelector,
    "attention": Attention,
    "medirl_sam": MEDIRLSAM,
}


def available() -> tuple[str, ...]:
    """Names that `make_controller` knows without a path.

    Returns:
        Built-in controllers first, then those that installed packages offer.
    """
    offered = sorted(entry.name for entry in entry_points(group=ENTRY_POINT_GROUP))
    return (*BUILT_IN, *(name for name in offered if name not in BUILT_IN))


def make_controller(spec: str) -> Controller:
    """Make the controller that a name, with settings in brackets if need be, stands for.

    Args:
        spec: A built-in name, an entry point of the group `socialnav_mj.controllers`, "package.module:Class", or
            "sb3:policy.zip" for a policy of stable-baselines3 (see `socialnav_mj.controllers.sb3`); keyword arguments
            of literals may follow, as in "potential_field(repulsion_gain=3.0)". With them a controller is named by the
            whole spec, so that two configurations can stand in one table; "fast=orca" and "fast=orca(margin=0.1)" name
            it "fast".

    Returns:
        A new controller, not yet reset.

    Raises:
        ValueError: If there is no such controller, or it does not take the configuration, or does not keep it where
            an episode could say it.
    """
    label, plain = split_label(spec)
    name, config = parse(plain)
    factory = factory_of(name)
    allowed = parameters_of(factory)
    if unknown := [key for key in config if allowed is not None and key not in {*allowed, "name"}]:
        known = ", ".join(key for key in allowed or () if key != "name")
        raise ValueError(f"controller {name!r} has no setting {unknown[0]!r}; its settings: {known or 'none'}")
    if label is not None:
        config["name"] = label
    elif config:
        config.setdefault("name", spec)
    try:
        controller = made(factory, config)
    except TypeError as error:
        raise ValueError(f"controller {name!r} cannot be made with {config or 'no arguments'}: {error}") from error
    if lacking := lacks(controller):
        raise ValueError(f"controller {name!r} is a {type(controller).__name__}, which lacks {lacking}")
    for key in config if not (is_dataclass(controller) or hasattr(controller, "config")) else ():
        if not hasattr(controller, key) or json_value(getattr(controller, key)) != json_value(config[key]):
            raise ValueError(
                f"controller {name!r} was given {key} = {config[key]!r} but does not keep it, so that no episode could "
                f"say what was run; expected an attribute {key!r} of that value, or a method config that returns the "
                "keyword arguments that make it"
            )
    return controller


def lacks(controller: object) -> str:
    """What an object lacks to be a controller.

    Args:
        controller: Anything.

    Returns:
        Names of the missing members, such as "reset and act"; empty for a controller.
    """
    return " and ".join(name for name in ("name", "reset", "act") if not hasattr(controller, name))


def made(kind: Callable[..., Controller], settings: dict[str, Any]) -> Controller:
    """Make a controller; first the controllers that it is made of.

    Args:
        kind: Class or function that makes it.
        settings: Keyword arguments; where a field holds a controller, its spec; where it holds several, theirs. A name
            that the class does not take is set afterwards.

    Returns:
        A new controller, not yet reset.

    Raises:
        TypeError: If the class does not take the settings.
        ValueError: If a value is not allowed, or the name cannot be set.
    """
    parts = {name: _part(settings[name]) for name in parts_of(kind) if name in settings}
    arguments = settings | parts
    taken = parameters_of(kind)
    if "name" not in arguments or taken is None or "name" in taken:
        return kind(**arguments)
    name = arguments.pop("name")
    controller = kind(**arguments)
    try:
        controller.name = name
    except AttributeError as error:
        raise ValueError(f"controller {controller.name!r} cannot be named {name!r}: {error}") from error
    return controller


def _part(spec: str | list[str] | tuple[str, ...]) -> Controller | tuple[Controller, ...]:
    return tuple(make_controller(one) for one in spec) if isinstance(spec, list | tuple) else make_controller(spec)


def split_label(spec: str) -> tuple[str | None, str]:
    """The name that a spec gives its controller, and the rest of the spec.

    Args:
        spec: As `make_controller` takes it.

    Returns:
        "fast", "orca(margin=0.1)" of "fast=orca(margin=0.1)"; None and the spec if it gives no name.
    """
    found = re.fullmatch(r"([^=(:]+)=(.+)", spec, re.DOTALL) if isinstance(spec, str) else None
    return (found[1].strip(), found[2].strip()) if found else (None, spec)


def parse(spec: str) -> tuple[str, dict[str, Any]]:
    """Read a spec; nothing of it is run.

    Args:
        spec: As `make_controller` takes it.

    Returns:
        Name and settings; the settings are literals.

    Raises:
        ValueError: If it is no name with literal keyword arguments.
    """
    if not isinstance(spec, str):
        raise ValueError(f"controller {spec!r} cannot be read; expected a string, as make_controller takes it")
    name, bracket, rest = spec.partition("(")
    if not bracket:
        return spec, {}
    try:
        call = ast.parse(f"f({rest}", mode="eval").body
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and not call.args:
            return name, {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
    except (SyntaxError, ValueError):
        pass
    raise ValueError(
        f"controller {spec!r} cannot be read; expected name or name(key=value, ...), with numbers, quoted strings, "
        "True, False, None or lists of these as values"
    )


def factory_of(name: str) -> Callable[..., Controller]:
    """The class or function behind a controller's name; imports it if it is not built in.

    Args:
        name: A built-in name, an entry point, "package.module:Class", or "sb3:policy.zip".

    Returns:
        Called with the settings, it returns a controller.

    Raises:
        ValueError: If nothing has that name, or it cannot be imported.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    if name.startswith(PREFIX):
        return partial(SB3Policy, path=name.removeprefix(PREFIX))
    if ":" in name:
        return load(name, name)
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        if entry.name == name:
            return load(name, entry.value)
    module, dot, attribute = name.rpartition(".")
    close = get_close_matches(name, available(), n=1)
    meant = f"; did you mean {f'{module}:{attribute}' if dot else close[0]}?" if dot or close else ""
    raise ValueError(
        f"unknown controller {name!r}{meant}; available: {', '.join(available())}, or package.module:Class"
    )


def load(name: str, path: str) -> Callable[..., Controller]:
    """Import what makes a controller; this runs its code.

    Args:
        name: What the user wrote, for the error message.
        path: "package.module:Class".

    Returns:
        Called with the settings, it returns a controller.

    Raises:
        ValueError: If it cannot be imported or called.
    """
    module_name, _, attribute = path.partition(":")
    try:
        factory: Callable[..., Controller] = attrgetter(attribute)(import_module(module_name))
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ValueError(
            f"controller {name!r} cannot be imported from {path!r}: {error}; expected package.module:Class"
        ) from error
    if not callable(factory):
        raise ValueError(f"controller {name!r} is a {type(factory).__name__}; expected a class, or a function")
    return factory


def class_path(kind: type) -> str:
    """How a class is named in files and on the command line.

    Args:
        kind: Any class.

    Returns:
        "package.module:Class".
    """
    return f"{kind.__module__}:{kind.__qualname__}"


def settings_of(kind: Callable[..., Controller]) -> list[Field[Any]]:
    """Fields of a controller's class that can be set in a spec.

    Args:
        kind: What `factory_of` returns.

    Returns:
        Those that the dataclass takes when it is called; none if it is no dataclass.
    """
    kind = kind.func if isinstance(kind, partial) else kind
    return [field for field in fields(kind) if field.init] if is_dataclass(kind) else []


def parts_of(kind: Callable[..., Controller]) -> tuple[str, ...]:
    """Settings that are controllers themselves, and written as specs.

    Args:
        kind: What `factory_of` returns.

    Returns:
        Names of the fields that are marked with `IS_CONTROLLER`.
    """
    return tuple(field.name for field in settings_of(kind) if field.metadata.get(IS_CONTROLLER))
