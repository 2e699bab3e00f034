"""What is attacked: valid files, and a reader that may only refuse them with the errors that it declares."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random

from .mutators import mutate


@dataclass(frozen=True, kw_only=True)
class Target:
    """A reader of files."""

    name: str
    """room/kind."""
    seeds: Callable[[], list[bytes]]
    """Makes valid files."""
    read: Callable[[bytes, Path], None]
    """Reads one input, by way of files in a folder of its own if need be, and checks what it accepts."""
    refuses: Callable[[], tuple[type[Exception], ...]]
    """The errors that it declares; imported late, as the readers are."""


def input_of(target: Target, seed: int, index: int) -> bytes:
    """An input of a target.

    Args:
        target: What is attacked.
        seed: Of the run.
        index: Of the input; the first are the valid files themselves.

    Returns:
        The same bytes for the same arguments.
    """
    seeds = seeds_of(target)
    return seeds[index] if index < len(seeds) else mutate(Random(f"{target.name} {seed} {index}"), seeds)


@cache
def seeds_of(target: Target) -> list[bytes]:
    """Valid files of a target, made once in a process."""
    return target.seeds()
