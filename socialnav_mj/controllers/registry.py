"""Controllers by name: the built-in ones, those of installed packages, and any class by its path."""

import ast
from collections.abc import Callable
from dataclasses import Field, fields, is_dataclass
from importlib import import_module
from importlib.metadata import entry_points
from operator import attrgetter
from typing import Any

from socialnav_mj.controllers.base import IS_CONTROLLER, Controller
from socialnav_mj.controllers.dynamic_window import DynamicWindow
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.hybrid import Hybrid
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.mpdm import MPDM
from socialnav_mj.controllers.orca import ORCA
from socialnav_mj.controllers.potential_field import PotentialField, PotentialFieldCapped
from socialnav_mj.controllers.replay_irl import ReplayIRL
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
        spec: A built-in name, an entry point of the group `socialnav_mj.controllers`, or "package.module:Class";
            keyword arguments of literals may follow, as in "potential_field(repulsion_gain=3.0)". With them a
            dataclass with a field `name` is named by the whole spec, so that two configurations can stand in one
            table.

    Returns:
        A new controller, not yet reset.

    Raises:
        ValueError: If there is no such controller, or it does not take the configuration.
    """
    name, config = parse(spec)
    factory = factory_of(name)
    if config and "name" in {field.name for field in settings_of(factory)}:
        config.setdefault("name", spec)
    try:
        controller = made(factory, config)
    except TypeError as error:
        raise ValueError(f"controller {name!r} cannot be made with {config or 'no arguments'}: {error}") from error
    if not isinstance(controller, Controller):
        raise ValueError(f"controller {name!r} is a {type(controller).__name__}, which lacks name, reset or act")
    return controller


def made(kind: Callable[..., Controller], settings: dict[str, Any]) -> Controller:
    """Make a controller; first the controllers that it is made of.

    Args:
        kind: Class or function that makes it.
        settings: Keyword arguments; where a field holds a controller, its spec; where it holds several, theirs.

    Returns:
        A new controller, not yet reset.

    Raises:
        TypeError: If the class does not take the settings.
        ValueError: If a value is not allowed.
    """
    parts = {name: _part(settings[name]) for name in parts_of(kind) if name in settings}
    return kind(**settings | parts)


def _part(spec: str | list[str] | tuple[str, ...]) -> Controller | tuple[Controller, ...]:
    return tuple(make_controller(one) for one in spec) if isinstance(spec, list | tuple) else make_controller(spec)


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
        name: A built-in name, an entry point, or "package.module:Class".

    Returns:
        Called with the settings, it returns a controller.

    Raises:
        ValueError: If nothing has that name, or it cannot be imported.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    if ":" in name:
        return load(name, name)
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        if entry.name == name:
            return load(name, entry.value)
    raise ValueError(f"unknown controller {name!r}; available: {', '.join(available())}, or package.module:Class")


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
    return [field for field in fields(kind) if field.init] if is_dataclass(kind) else []


def parts_of(kind: Callable[..., Controller]) -> tuple[str, ...]:
    """Settings that are controllers themselves, and written as specs.

    Args:
        kind: What `factory_of` returns.

    Returns:
        Names of the fields that are marked with `IS_CONTROLLER`.
    """
    return tuple(field.name for field in settings_of(kind) if field.metadata.get(IS_CONTROLLER))
