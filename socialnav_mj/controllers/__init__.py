"""Controllers by name: the built-in ones, those of installed packages, and any class by its path."""

import ast
import json
from collections.abc import Callable, Collection
from dataclasses import Field, fields, is_dataclass
from importlib import import_module
from importlib.metadata import entry_points
from operator import attrgetter
from typing import Any, get_type_hints

from typeguard import TypeCheckError, check_type

from socialnav_mj.controllers.base import NAMES_CONTROLLER, Controller, Limits, Observation, TwistController
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.hybrid import Hybrid
from socialnav_mj.controllers.potential_field import PotentialField
from socialnav_mj.controllers.replay_irl import DEFAULT_POLICY, ReplayIRL, policy_of

ENTRY_POINT_GROUP = "socialnav_mj.controllers"

BUILT_IN: dict[str, Callable[..., Controller]] = {
    "potential_field": PotentialField,
    "replay_irl": ReplayIRL,
    "hybrid": Hybrid,
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
    if config and "name" in {field.name for field in _fields(factory)}:
        config.setdefault("name", spec)
    try:
        controller = factory(**config)
    except TypeError as error:
        raise ValueError(f"controller {name!r} cannot be made with {config or 'no arguments'}: {error}") from error
    if not isinstance(controller, Controller):
        raise ValueError(f"controller {name!r} is a {type(controller).__name__}, which lacks name, reset or act")
    return controller


def with_policy_of(spec: str, dataset: str) -> str:
    """Let a learned controller act with the policy that learned from the recording it is to be judged on.

    Args:
        spec: As `make_controller` takes it.
        dataset: Name of the recording.

    Returns:
        The spec with the recording's shipped policy wherever "replay_irl" stands without one; unchanged if it names its
        policies, learns nothing, or no shipped policy learned from this recording alone.

    Raises:
        ValueError: If the spec cannot be read.
    """
    policy = policy_of(dataset)
    name, config = _parse(spec)
    found: dict[str, str] = {}
    if name == "replay_irl" and "policy" not in config and policy != DEFAULT_POLICY:
        found = {"policy": policy}
    elif name == "hybrid":
        parts = {part: config.get(part, getattr(Hybrid, part)) for part in ("near", "far")}
        found = {part: own for part, old in parts.items() if (own := with_policy_of(old, dataset)) != old}
    if not found:
        return spec
    return f"{name}({', '.join(f'{key}={value!r}' for key, value in (config | found).items())})"


def class_path(kind: type) -> str:
    """How a class is named in files and on the command line.

    Args:
        kind: Any class.

    Returns:
        "package.module:Class".
    """
    return f"{kind.__module__}:{kind.__qualname__}"


def controller_config(controller: Controller) -> dict[str, Any]:
    """Configuration of a controller as it travels in every episode.

    Args:
        controller: A dataclass, or anything.

    Returns:
        The fields of a dataclass, and the class; for others the class alone. JSON values, as they are read back.

    Raises:
        ValueError: If a field is no JSON value.
    """
    kind = type(controller)
    result: dict[str, Any] = {"class": class_path(kind)}
    for name in (field.name for field in _fields(kind)):
        value = getattr(controller, name)
        try:
            result[name] = json.loads(json.dumps(value, allow_nan=False))
        except (TypeError, ValueError) as error:
            raise ValueError(f"{result['class']}.{name} = {value!r} is not allowed; allowed: JSON values") from error
    return result


def controller_of(config: dict[str, Any], *, trusted: Collection[str] = ()) -> Controller:
    """Inverse of `controller_config`, for configurations that come from a file.

    Nothing that it names is imported or called unless it is built in, offered by an installed package, or trusted by
    whoever asks.

    Args:
        config: As it travels in an episode.
        trusted: Classes outside of those, as "package.module:Class".

    Returns:
        A new controller of the same class and configuration.

    Raises:
        ValueError: If the class is unknown and not trusted, is no controller, or does not take the configuration.
    """
    if not isinstance(config, dict) or not isinstance(config.get("class"), str):
        raise ValueError(f'controller_config = {config!r} is not allowed; allowed: a JSON object with "class"')
    values = dict(config)
    path = values.pop("class")
    kind = _known_class(path, trusted)
    _check_values(path, kind, values, trusted)
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"controller {path!r} cannot be made with {values}: {error}") from error


def _known_class(path: str, trusted: Collection[str]) -> Callable[..., Controller]:
    offered = [*BUILT_IN.values(), *(_load(entry.name, entry.value) for entry in entry_points(group=ENTRY_POINT_GROUP))]
    for factory in offered:
        if isinstance(factory, type) and class_path(factory) == path:
            return factory
    if path not in trusted:
        raise ValueError(_untrusted(path))
    kind = _load(path, path)
    lacking = [name for name in ("reset", "act") if not callable(getattr(kind, name, None))]
    if not isinstance(kind, type) or lacking:
        raise ValueError(f"{path!r} is no controller: expected a class with reset and act")
    return kind


def _fields(kind: Callable[..., Controller]) -> list[Field[Any]]:
    """Settings of a class: none if it is no dataclass."""
    return [field for field in fields(kind) if field.init] if is_dataclass(kind) else []


def _untrusted(path: str) -> str:
    return (
        f"the file names the controller {path!r}, which is neither built in nor offered by an installed package; "
        f"importing it runs its code. If you trust that code, add --trust {path}"
    )


def _check_values(path: str, kind: Callable[..., Controller], values: dict[str, Any], trusted: Collection[str]) -> None:
    """Settings that a file gives are those that the class has, of their types, and name nothing untrusted either."""
    allowed = {field.name: field for field in _fields(kind)}
    hints = get_type_hints(kind) if allowed else {}
    for name, value in values.items():
        if name not in allowed:
            known = ", ".join(allowed) or "none"
            raise ValueError(f"controller {path!r} has no setting {name!r}; allowed: {known}")
        try:
            check_type(value, hints[name])
        except TypeCheckError as error:
            raise ValueError(f"controller {path!r}: {name} = {value!r} is not allowed: {error}") from error
        if allowed[name].metadata.get(NAMES_CONTROLLER):
            _check_trusted_spec(value, trusted)


def _check_trusted_spec(spec: str, trusted: Collection[str]) -> None:
    name, config = _parse(spec)
    if ":" in name and name not in trusted:
        raise ValueError(_untrusted(name))
    factory = _factory(name)
    for field in _fields(factory):
        if field.metadata.get(NAMES_CONTROLLER) and field.name in config:
            _check_trusted_spec(config[field.name], trusted)


def _parse(spec: str) -> tuple[str, dict[str, Any]]:
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


def _factory(name: str) -> Callable[..., Controller]:
    if name in BUILT_IN:
        return BUILT_IN[name]
    if ":" in name:
        return _load(name, name)
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        if entry.name == name:
            return _load(name, entry.value)
    raise ValueError(f"unknown controller {name!r}; available: {', '.join(available())}, or package.module:Class")


def _load(name: str, path: str) -> Callable[..., Controller]:
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


__all__ = [
    "BUILT_IN",
    "Controller",
    "Limits",
    "Observation",
    "TwistController",
    "available",
    "class_path",
    "controller_config",
    "controller_of",
    "make_controller",
    "with_policy_of",
]
