"""What all tests share: the package names a drawing library before any test imports MuJoCo."""

import os
import signal

import pytest

import socialnav_mj  # noqa: F401


@pytest.fixture(scope="session")
def offscreen() -> str:
    """The name of MuJoCo's drawing library; a test that draws asks for it and is skipped where there is none."""
    backend = os.environ.get("MUJOCO_GL", "glfw")
    if backend in {"disable", "disabled", "off", "false", "0"}:
        pytest.skip("drawing needs a display, or the library EGL or OSMesa (Debian: libegl1, libosmesa6)")
    return backend


@pytest.fixture(scope="session", autouse=True)
def signals_as_a_terminal_gives_them() -> None:
    """Whoever runs the tests in the background or under nohup has signals ignored that programs here have to hear."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
