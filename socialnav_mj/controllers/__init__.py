"""Controllers by name: the built-in ones, those of installed packages, and any class by its path."""

import ast
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from socialnav_mj.controllers.base import Controller, Limits, Observation, TwistController
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.potential_field import PotentialField

ENTRY_POINT_GROUP = "socialnav_mj.controllers"

BUILT_IN: dict[str, Callable[..., Controller]] = {
    "potential_field": PotentialField,
    "go_straight": GoStraight,
}


def available() -> tuple[str, ...]:
    """Names that `make_controller` knows without a path.

    Returns:
        Built-in controllers first, then those that installed packages offer.
    """
    offered = sorted(entry.name for entry in entry_points(group=ENTRY_POINT_GROUP))
    return (*BUILT_IN, *(name for name in offered if name not in BUILT_IN))


def make_controller(spec: str) -> Controller:
    """A controller by name, with its configuration if need be.

    Args:
        spec: A built-in name, an entry point of the group `socialnav_mj.controllers`, or "package.module:Class";
            keyword arguments of literals may follow, as in "potential_field(attraction_limit=None)". With them a
            dataclass with a field `name` is named by the whole spec, so that two configurations can stand in one
            table.

    Returns:
        The controller.

    Raises:
        ValueError: If there is no such controller, or it does not take the configuration.
    """
    name, config = _parse(spec)
    factory = _factory(name)
    if config and is_dataclass(factory) and "name" in {field.name for field in fields(factory)}:
        config.setdefault("name", spec)
    try:
        controller = factory(**config)
    except TypeError as error:
        raise ValueError(f"controller {name!r} cannot be made with {config or 'no arguments'}: {error}") from error
    if not isinstance(controller, Controller):
        raise ValueError(f"controller {name!r} is a {type(controller).__name__}, which lacks name, reset or act")
    return controller


def controller_config(controller: Controller) -> dict[str, Any]:
    """Configuration of a controller as it travels in every episode.

    Args:
        controller: A dataclass, or anything.

    Returns:
        The fields of a dataclass, and the class; for others the class alone.
    """
    kind = type(controller)
    result: dict[str, Any] = {"class": f"{kind.__module__}:{kind.__qualname__}"}
    if is_dataclass(controller):
        result |= {field.name: getattr(controller, field.name) for field in fields(controller)}
    return result


def _parse(spec: str) -> tuple[str, dict[str, Any]]:
    name, bracket, rest = spec.partition("(")
    if not bracket:
        return spec, {}
    try:
        call = ast.parse(f"f({rest}", mode="eval").body
        if not isinstance(call, ast.Call) or call.args:
            raise ValueError("only keyword arguments are allowed")
        return name, {keyword.arg: ast.literal_eval(keyword.value) for keyword in call.keywords if keyword.arg}
    except (SyntaxError, ValueError) as error:
        raise ValueError(
            f"controller {spec!r} cannot be read: {error}; expected name or name(key=literal, ...)"
        ) from None


def _factory(name: str) -> Callable[..., Controller]:
    if name in BUILT_IN:
        return BUILT_IN[name]
    if ":" in name:
        module_name, _, attribute = name.partition(":")
        try:
            factory: Callable[..., Controller] = getattr(import_module(module_name), attribute)
        except (ImportError, AttributeError) as error:
            raise ValueError(f"controller {name!r} cannot be imported: {error}") from error
        return factory
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        if entry.name == name:
            offered: Callable[..., Controller] = entry.load()
            return offered
    raise ValueError(f"unknown controller {name!r}; available: {', '.join(available())}, or package.module:Class")


__all__ = [
    "BUILT_IN",
    "Controller",
    "Limits",
    "Observation",
    "TwistController",
    "available",
    "controller_config",
    "make_controller",
]
