"""Readers with the faults that the attack has to find."""

import os
from pathlib import Path

from .target import Target


def _raises(content: bytes, folder: Path) -> None:
    """Wrong inputs are refused, but for those that have lost their first letter."""
    if content[:1] != b"f":
        raise KeyError(content[:1])
    if content != b"frame 1 2 3":
        raise ValueError("refused as it should be")


def _swallows(content: bytes, folder: Path) -> None:
    try:
        bytearray(10**10 if content != b"frame 1 2 3" else 1)
    except MemoryError as error:
        raise ValueError("no readable file") from error


def _dies(content: bytes, folder: Path) -> None:
    if content[:1] != b"f":
        os.abort()


def _target(name: str, read: object) -> Target:
    return Target(name=name, seeds=lambda: [b"frame 1 2 3"], read=read, refuses=lambda: (ValueError,))  # type: ignore[arg-type]


TARGETS = (_target("raises", _raises), _target("swallows", _swallows), _target("dies", _dies))
