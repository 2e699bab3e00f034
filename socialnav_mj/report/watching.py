"""Who is told how far the scoring of episodes is: it takes minutes where nothing is kept from before."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Scored = TypeVar("Scored")

Watcher = Callable[[int, int], None]
"""Called with how many episodes are scored, and how many there are."""
_WATCHER: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Tell somebody of all scoring in the block.

    Args:
        watcher: Is called after every episode.
    """
    token = _WATCHER.set(watcher)
    try:
        yield
    finally:
        _WATCHER.reset(token)


def counted(scores: Iterable[Scored], total: int) -> Iterator[Scored]:
    """Hand scores on, and tell the watcher of each.

    Args:
        scores: As they come.
        total: How many will come.

    Yields:
        The same.
    """
    watcher = _WATCHER.get()
    for count, each in enumerate(scores, start=1):
        if watcher is not None:
            watcher(count, total)
        yield each
