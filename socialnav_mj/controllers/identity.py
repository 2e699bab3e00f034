"""What tells a controller from what it was before somebody edited it: its sources, and what it holds."""

import hashlib
import inspect
import json
import sysconfig
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.sources import made_of

PACKAGE = Path(__file__).resolve().parents[1]
"""This package: its sources are told by its version."""
SHOWN_NUMBERS = 16
"""An array of more is told by its digest."""


def sources_of(kind: type) -> dict[str, str]:
    """Digests of the source files that a class is made of, as far as its author wrote them.

    Its module; and what that imports from the package that it is in or, for a module of its own, from its folder; and
    so on. Installed packages beside it are told by their versions.

    Args:
        kind: A class; one of this package has none.

    Returns:
        Path below the folder of the module or package: sha256. For a class that was written at a prompt, its qualified
        name: sha256 of its source, if that is known.
    """
    path = _file_of(kind)
    if path is None:
        return _typed(kind)
    if path.is_relative_to(PACKAGE):
        return {}
    root = path.parent
    while (root / "__init__.py").is_file():
        root = root.parent
    return made_of([path], root, lambda own: _is_beside(own, path, root))


def files_of(settings: Mapping[str, Any]) -> dict[str, str]:
    """Digests of the files that settings name, such as the weights of a policy.

    Args:
        settings: Setting: its value.

    Returns:
        Path as the setting has it: sha256.
    """
    named = [value for value in settings.values() if isinstance(value, str) and Path(value).suffix]
    return {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in named if Path(name).is_file()}


def parameters_of(factory: Callable[..., Any]) -> dict[str, Any] | None:
    """What a class or function takes when it is called.

    Args:
        factory: Anything that can be called.

    Returns:
        Keyword: default, `inspect.Parameter.empty` where there is none; None if it takes any keyword, or does not say.
    """
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return None
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return None
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.VAR_POSITIONAL)
    return {parameter.name: parameter.default for parameter in parameters if parameter.kind not in positional}


def json_value(value: Any) -> Any:
    """A JSON value that stands for any value.

    Args:
        value: Anything.

    Returns:
        Itself, as it is read back; short arrays as lists, longer ones by their digest, anything else by its type.
    """
    if isinstance(value, np.ndarray) and value.size > SHOWN_NUMBERS:
        return f"{value.dtype} {value.shape} sha256 {hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
    if is_json(value):
        return json.loads(json.dumps(value, default=_plain))
    return f"{type(value).__module__}.{type(value).__qualname__}"


def is_json(value: Any) -> bool:
    """Whether JSON can say a value, short arrays included.

    Args:
        value: Anything.

    Returns:
        False for anything else, and for what holds NaN or infinity.
    """
    try:
        json.dumps(value, allow_nan=False, default=_plain)
    except (TypeError, ValueError, RecursionError):
        return False
    return True


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray) and value.size <= SHOWN_NUMBERS:
        return value.tolist()
    raise TypeError


def _file_of(kind: type) -> Path | None:
    try:
        name = inspect.getsourcefile(kind)
    except (TypeError, OSError):  # written at a prompt, or built in
        return None
    return Path(name).resolve() if name and Path(name).is_file() else None


def _typed(kind: type) -> dict[str, str]:
    try:
        return {kind.__qualname__: hashlib.sha256(inspect.getsource(kind).encode()).hexdigest()}
    except (OSError, TypeError):
        return {}


def _is_beside(file: Path, module: Path, root: Path) -> bool:
    """Whether a file belongs to the same work as a module: to its package, or to the folder of a module of its own."""
    if file.is_relative_to(PACKAGE) or not file.is_relative_to(root):
        return False
    top = module.relative_to(root).parts[0]
    if file.relative_to(root).parts[0] == top:
        return True
    installed = {Path(folder).resolve() for name, folder in sysconfig.get_paths().items() if name.endswith("lib")}
    return module.parent == root and root not in installed
