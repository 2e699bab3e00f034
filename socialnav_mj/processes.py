"""Work in several processes that leave Ctrl-C to the command that started them."""

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from joblib import Parallel, delayed

Result = TypeVar("Result")


def in_processes(
    function: Callable[..., Result], arguments: Iterable[tuple[object, ...]], *, n_jobs: int
) -> Iterator[Result]:
    """Call a function many times.

    Args:
        function: To be called; it and its results travel between processes.
        arguments: Of each call.
        n_jobs: Processes; 1 for none but this one, -1 for one a core.

    Returns:
        Results as they come, in no order. An exception of a call is raised here.
    """
    with _deaf_to_interrupts():
        # Processes start here and inherit it: Ctrl-C is this process's to handle, which then ends them.
        results: Iterator[Result] = Parallel(n_jobs=n_jobs, return_as="generator_unordered")(
            delayed(function)(*own) for own in arguments
        )
    return results


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C for a moment; signals can be set in the main thread alone."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if handler is None else handler)
