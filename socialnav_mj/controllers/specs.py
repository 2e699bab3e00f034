"""Controllers as text and as JSON values, and back: what travels in episodes, and what a file may have made."""

import inspect
import json
from collections.abc import Callable, Collection
from dataclasses import MISSING, is_dataclass
from functools import partial
from importlib.metadata import entry_points
from typing import Any, get_type_hints

from typeguard import TypeCheckError, check_type

from socialnav_mj.controllers.base import Controller
from socialnav_mj.controllers.identity import files_of, is_json, json_value, parameters_of, sources_of
from socialnav_mj.controllers.registry import (
    BUILT_IN,
    ENTRY_POINT_GROUP,
    class_path,
    factory_of,
    load,
    made,
    parse,
    parts_of,
    settings_of,
    split_label,
)
from socialnav_mj.controllers.sb3 import PREFIX, SB3Policy, checksum_of


def with_trust(spec: str, trusted: Collection[str]) -> str:
    """Name in a spec the file that is trusted by its content.

    Args:
        spec: As `make_controller` takes it.
        trusted: Specs of policies of stable-baselines3 without settings, as "sb3:policy.zip".

    Returns:
        The spec with the file's sha256, if it is trusted and has none; else unchanged.

    Raises:
        ValueError: If the spec or the file cannot be read.
    """
    label, plain = split_label(spec)
    name, config = parse(plain)
    if not name.startswith(PREFIX) or name not in trusted or "checksum" in config:
        return spec
    pinned = {"checksum": checksum_of(name.removeprefix(PREFIX)), **config}
    return text_of(name, {**pinned, "name": label or config.get("name", spec)})


_BESIDE = ("class", "attributes", "sources")
"""Keys of a controller's configuration that are no settings."""


def controller_config(controller: Controller) -> dict[str, Any]:
    """Configuration of a controller as it travels in every episode: what tells it from what it was before an edit.

    Args:
        controller: As it was made: `reset` may add to its attributes.

    Returns:
        JSON values, as they are read back. "class"; its settings: the fields of a dataclass, what a method `config`
        returns, or the attributes that are named like arguments of its class, controllers that it is made of by their
        specs; "attributes": other public attributes, if there are any; "sources": digests of the files that its
        author wrote and its settings name, also of its parts, if there are any.

    Raises:
        ValueError: If a setting is no JSON value.
    """
    kind = type(controller)
    path = class_path(kind)
    sources = {f"{path} in {name}": digest for name, digest in sources_of(kind).items()}
    settings: dict[str, Any] = {}
    for name, value in _settings(controller).items():
        try:
            is_part = name in parts_of(kind)
            settings[name] = each(value, spec_of) if is_part else json.loads(json.dumps(value, allow_nan=False))
        except (TypeError, ValueError) as error:
            raise ValueError(f"{path}.{name} = {value!r} is not allowed; allowed: JSON values") from error
        for part in (value if isinstance(value, list | tuple) else (value,)) if is_part else ():
            sources |= controller_config(part).get("sources", {})
    sources |= files_of(settings)
    attributes = {
        name: json_value(value)
        for name, value in sorted(getattr(controller, "__dict__", {}).items())
        if not (name.startswith("_") or name in settings) and (name == "name" or not is_dataclass(kind))
    }
    beside = {"attributes": attributes, "sources": sources}
    return {"class": path, **settings, **{name: value for name, value in beside.items() if value}}


def _settings(controller: Controller) -> dict[str, Any]:
    """What makes the same controller again: keyword arguments of its class."""
    kind = type(controller)
    if is_dataclass(kind):
        return {field.name: getattr(controller, field.name) for field in settings_of(kind)}
    config = getattr(controller, "config", None)
    if callable(config):
        found = config()
        if not isinstance(found, dict) or any(not isinstance(key, str) or key in _BESIDE for key in found):
            raise ValueError(
                f"{class_path(kind)}.config() returns {found!r}; expected a dictionary of keyword arguments of its "
                f"class, none of them named {', '.join(_BESIDE)}"
            )
        return found
    named = {name: getattr(controller, name) for name in parameters_of(kind) or () if hasattr(controller, name)}
    # What is no JSON value cannot make it again; it is told as an attribute.
    return {name: json_value(value) for name, value in named.items() if is_json(value)}


def spec_of(controller: Controller) -> str:
    """Text from which `make_controller` makes the same controller again.

    Args:
        controller: A dataclass, or an object of a class that is made without arguments.

    Returns:
        The controller's own name if that makes the same controller, else its class with the settings
        that it takes.

    Raises:
        ValueError: If a setting is no JSON value.
    """
    kind = type(controller)
    names = [name for name, factory in BUILT_IN.items() if factory is kind]
    names += [entry.name for entry in entry_points(group=ENTRY_POINT_GROUP) if entry.value == class_path(kind)]
    names.append(class_path(kind))
    wanted = controller_config(controller)
    settings = {name: value for name, value in wanted.items() if name not in _BESIDE}
    own_name = settings.get("name", wanted.get("attributes", {}).get("name"))
    if isinstance(own_name, str):
        if _is_made_by(own_name, names, wanted, kind):
            return own_name
        settings["name"] = own_name
    for name in settings.copy():
        fewer = {key: value for key, value in settings.items() if key != name}
        # With settings, a spec without a name would be the name.
        if (name != "name" or not fewer) and _makes(kind, fewer, wanted):
            settings = fewer
    return text_of(names[0], settings)


def _is_made_by(spec: str, names: Collection[str], wanted: dict[str, Any], kind: Callable[..., Controller]) -> bool:
    """Whether a spec, which may come from a file, makes a controller; settings that it does not have are not run."""
    try:
        name, config = parse(spec)
    except ValueError:
        return False
    known = name in names and all(key in wanted and wanted[key] == value for key, value in config.items())
    return known and _makes(kind, {**config, "name": spec}, wanted)


def _makes(kind: Callable[..., Controller], settings: dict[str, Any], wanted: dict[str, Any]) -> bool:
    try:
        return controller_config(made(kind, settings)) == wanted
    except (TypeError, ValueError):
        return False


def text_of(name: str, settings: dict[str, Any]) -> str:
    """A spec.

    Args:
        name: Of the controller.
        settings: Its keyword arguments, literals.

    Returns:
        Text that `make_controller` reads.
    """
    return f"{name}({', '.join(f'{key}={value!r}' for key, value in settings.items())})" if settings else name


def controller_of(config: dict[str, Any], *, trusted: Collection[str] = ()) -> Controller:
    """Make the controller again whose `controller_config` a file holds.

    Nothing that it names is imported or called unless it is built in, offered by an installed package, or trusted by
    whoever asks.

    Args:
        config: As it travels in an episode.
        trusted: Classes outside of those, as "package.module:Class", and files, as "sb3:policy.zip".

    Returns:
        A new controller of the same class and configuration.

    Raises:
        ValueError: If the class is unknown and not trusted, is no controller, or does not take the configuration.
    """
    if not isinstance(config, dict) or not isinstance(config.get("class"), str):
        raise ValueError(f'controller_config = {config!r} is not allowed; allowed: a JSON object with "class"')
    path = config["class"]
    values = {name: value for name, value in config.items() if name not in _BESIDE}
    if path == class_path(SB3Policy):
        # The file's code is what has to be trusted, not the class, which is this package's.
        if f"{PREFIX}{values.get('path')}" not in trusted:
            raise ValueError(_untrusted(f"{PREFIX}{values.get('path')}"))
        trusted = (*trusted, path)
    kind = _known_class(path, trusted)
    _check_values(path, kind, values, trusted)
    attributes = config.get("attributes")
    name = attributes.get("name") if isinstance(attributes, dict) else None
    if isinstance(name, str):
        values["name"] = name
    try:
        return made(kind, values)
    except TypeError as error:
        raise ValueError(f"controller {path!r} cannot be made with {values}: {error}") from error


def _known_class(path: str, trusted: Collection[str]) -> Callable[..., Controller]:
    offered = [*BUILT_IN.values(), *(load(entry.name, entry.value) for entry in entry_points(group=ENTRY_POINT_GROUP))]
    for factory in offered:
        if isinstance(factory, type) and class_path(factory) == path:
            return factory
    if path not in trusted:
        raise ValueError(_untrusted(path))
    kind = load(path, path)
    lacking = [name for name in ("reset", "act") if not callable(getattr(kind, name, None))]
    if not isinstance(kind, type) or lacking:
        raise ValueError(f"{path!r} is no controller: expected a class with reset and act")
    return kind


def _check_values(path: str, kind: Callable[..., Controller], values: dict[str, Any], trusted: Collection[str]) -> None:
    """Settings that a file gives are those that the class has, of their types, and name nothing untrusted either."""
    fields = [field.name for field in settings_of(kind)]
    parameters = parameters_of(kind)
    allowed = fields or parameters
    hints = get_type_hints(kind if fields else kind.__init__)
    for name, value in values.items():
        if allowed is not None and name not in allowed:
            known = ", ".join(allowed) or "none"
            raise ValueError(f"controller {path!r} has no setting {name!r}; allowed: {known}")
        try:
            check_type(value, str | list[str] if name in parts_of(kind) else hints.get(name, Any))
        except TypeCheckError as error:
            raise ValueError(f"controller {path!r}: {name} = {value!r} is not allowed: {error}") from error
        if name in parts_of(kind):
            each(value, partial(_check_trusted_spec, trusted=trusted))


def _check_trusted_spec(spec: str, trusted: Collection[str]) -> None:
    name, config = parse(split_label(spec)[1])
    if ":" in name and name not in trusted:
        raise ValueError(_untrusted(name))
    factory = factory_of(name)
    for part in parts_of(factory):
        if part in config:
            each(config[part], partial(_check_trusted_spec, trusted=trusted))


def each(part: Any, function: Callable[[Any], Any]) -> Any:
    """A function of one part, or the list of it for several.

    Args:
        part: What a field of a controller holds: one, or a list or tuple of several.
        function: Of one.

    Returns:
        Its value, or the list of its values.
    """
    return [function(one) for one in part] if isinstance(part, list | tuple) else function(part)


def _untrusted(path: str) -> str:
    return (
        f"the file names the controller {path!r}, which is neither built in nor offered by an installed package; "
        f"importing it runs its code. If you trust that code, add --trust {path}"
    )


def described_settings(factory: Callable[..., Controller]) -> str:
    """The settings of a controller with their defaults.

    Args:
        factory: What `factory_of` returns.

    Returns:
        Such as "margin=0.1, horizon=3.0"; a setting without a default as its name alone, and parts as specs.
    """
    own = {field.name: field for field in settings_of(factory)}
    shown = []
    for name, default in (parameters_of(factory) or {}).items():
        field = own.get(name)
        if field is not None and field.default_factory is not MISSING:
            part = field.default_factory()
            default = each(part, spec_of) if name in parts_of(factory) else part
        if name != "name":
            shown.append(name if default is inspect.Parameter.empty else f"{name}={default!r}")
    return ", ".join(shown)
