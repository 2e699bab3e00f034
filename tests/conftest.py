"""What all tests share: the package names a drawing library before any test imports MuJoCo."""

import os

import pytest

import socialnav_mj  # noqa: F401


@pytest.fixture(scope="session")
def offscreen() -> str:
    """The name of MuJoCo's drawing library; a test that draws asks for it and is skipped where there is none."""
    backend = os.environ.get("MUJOCO_GL", "glfw")
    if backend in {"disable", "disabled", "off", "false", "0"}:
        pytest.skip("drawing needs a display, or the library EGL or OSMesa (Debian: libegl1, libosmesa6)")
    return backend
