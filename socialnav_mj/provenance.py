"""Where a result comes from: versions, recording and configuration, and the hash of what was simulated."""

import hashlib
import os
import platform
import re
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from socialnav_mj.config import Scenario
from socialnav_mj.geometry import Array
from socialnav_mj.recordings import Recording

PACKAGES = ("socialnav-mj", "mujoco", "dm-control", "numpy", "scipy")
"""Whose versions travel in every result."""
_DIGEST = re.compile("[0-9a-f]{64}")


def state_hash(*arrays: Array) -> str:
    """SHA-256 of arrays' bytes.

    Args:
        *arrays: Hashed one after the other, so that their order counts.

    Returns:
        Hexadecimal digits.
    """
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def episode_metadata(recording: Recording, scenario: Scenario, **rest: Any) -> dict[str, Any]:
    """All that makes an episode traceable.

    Args:
        recording: What was replayed; its name, variant, checksum and reading are kept.
        scenario: All its settings are kept.
        **rest: Further JSON values: controller, controller_config, scenario_name, steps, state_hash.

    Returns:
        The value of `Episode.metadata`.
    """
    return {
        **rest,
        "scenario": scenario.as_dict(),
        "draw": scenario.seed,
        "recording": recording_metadata(recording),
        "versions": package_versions(PACKAGES),
        "platform": platform_facts(),
    }


def recording_metadata(recording: Recording) -> dict[str, Any]:
    """What tells a recording from others.

    Args:
        recording: Its tracks are not looked at, only what is said of them.

    Returns:
        JSON values: name, variant, checksum, frame rate and how it was read.
    """
    return {
        "name": recording.name,
        "variant": recording.variant,
        "checksum": recording.checksum,
        "frame_rate": recording.frame_rate,
        "reading": dict(recording.reading),
    }


def differences(then: Any, now: Any, key: str = "") -> tuple[str, ...]:
    """What sets two configurations apart.

    Args:
        then: JSON values.
        now: JSON values.
        key: What they are, which comes before each name.

    Returns:
        Such as "margin = 0.5, but 0.25", one for each value that differs; digests are cut to what tells them apart.
    """
    if isinstance(then, dict) and isinstance(now, dict):
        found: tuple[str, ...] = ()
        for name in (*now, *(name for name in then if name not in now)):
            found += differences(then.get(name), now.get(name), f"{key}.{name}" if key else name)
        return found
    return () if then == now else (f"{key} = {_shown(then)}, but {_shown(now)}",)


def _shown(value: Any) -> str:
    return value[:8] if isinstance(value, str) and _DIGEST.fullmatch(value) else repr(value)


def platform_facts() -> dict[str, str]:
    """What the last bits of a simulation depend on besides packages.

    MuJoCo takes sines and roots from the C library, which rounds some otherwise on processors without fused
    multiply-add (before 2013), and in other versions.

    Returns:
        machine (architecture, and the levels of vector instructions that numpy found), c_library.
    """
    levels = np.show_config(mode="dicts")["SIMD Extensions"]
    found = [*levels.get("baseline", []), *levels.get("found", [])]
    names = os.confstr_names
    c_library = os.confstr("CS_GNU_LIBC_VERSION") if "CS_GNU_LIBC_VERSION" in names else None
    return {"machine": " ".join([platform.machine(), *found]), "c_library": c_library or "unknown"}


def package_versions(names: tuple[str, ...]) -> dict[str, str]:
    """Versions of installed packages.

    Args:
        names: Distribution names.

    Returns:
        Version by name; "not installed" for those that are not.
    """
    found = {}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
