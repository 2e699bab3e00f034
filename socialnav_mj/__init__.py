"""Social navigation in recorded crowds, as a MuJoCo physics benchmark."""

from __future__ import annotations

import ctypes
import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dm_control.rl import control


def load(
    task_name: str,
    task_kwargs: dict[str, Any] | None = None,
    environment_kwargs: dict[str, Any] | None = None,
    **keywords: Any,
) -> control.Environment:
    """Environment of a scenario; see `socialnav_mj.suite.load`.

    Args:
        task_name: One of `socialnav_mj.suite.ALL_TASKS`.
        task_kwargs: Keyword arguments of `socialnav_mj.environment.make_environment`.
        environment_kwargs: Keyword arguments of `dm_control.rl.control.Environment`.
        **keywords: More of `task_kwargs`, such as seed=1.

    Returns:
        A dm_control environment.
    """
    from socialnav_mj import suite

    return suite.load(task_name, task_kwargs, environment_kwargs, **keywords)


def register_with_dm_control() -> None:
    """Make `dm_control.suite.load("socialnav", "scenario_1")` work; see `socialnav_mj.suite`."""
    from socialnav_mj import suite

    suite.register_with_dm_control()


def _choose_renderer() -> None:
    """Without a display dm_control's own choice, GLFW, cannot render: name a library that can before its import."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return
    for renderer, library in (("egl", "libEGL.so.1"), ("osmesa", "libOSMesa.so.8")):
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        os.environ.setdefault("MUJOCO_GL", renderer)
        return
    os.environ.setdefault("MUJOCO_GL", "disable")


_choose_renderer()
