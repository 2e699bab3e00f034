"""Work in several processes that leave signals to the command that started them, and end with it."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

from joblib import Parallel, delayed
from joblib.externals.loky import ProcessPoolExecutor

from socialnav_mj.cluster import active_cluster, calls_on

Result = TypeVar("Result")

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that ask a command to stop: Ctrl-C, a batch system or a shutdown, a closed terminal."""
WATCH_PERIOD = 0.2
"""Time between two looks of a worker at whether its parent lives [s]."""


class Interruption(KeyboardInterrupt):
    """A signal other than Ctrl-C's asked to stop; whatever lets a KeyboardInterrupt through lets this through."""

    def __init__(self, number: int) -> None:
        """Keep the signal.

        Args:
            number: Of the signal.
        """
        super().__init__(number)
        self.number = number


@contextmanager
def stoppable() -> Iterator[None]:
    """Let SIGTERM and SIGHUP stop the block as Ctrl-C does, with an `Interruption`.

    A signal that this process was told to ignore, as `nohup` does with SIGHUP, stays ignored. Signals can be handled in
    the main thread alone; elsewhere the block runs as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    own = [number for number in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(number) == signal.SIG_DFL]

    def stop(number: int, _: FrameType | None) -> None:
        # A shutdown sends both, one after the other: the second must not break the clean end that the first began.
        for each in own:
            signal.signal(each, signal.SIG_IGN)
        raise Interruption(number)

    for number in own:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in own:
            signal.signal(number, signal.SIG_DFL)


def in_processes(
    function: Callable[..., Result], arguments: Iterable[tuple[object, ...]], *, n_jobs: int
) -> Iterator[Result]:
    """Call a function with many arguments, in several processes, or on a cluster in the block of `on_cluster`.

    Args:
        function: To be called; it and its results travel between processes.
        arguments: Of each call.
        n_jobs: Processes; 1 for none but this one, or one of the cluster's; -1 for one a core.

    Returns:
        Results in the order in which the calls end, which differs from one time to the next. An exception of a call is
        raised here. The processes end within a second of this one, however it ends.
    """
    if (cluster := active_cluster()) is not None:
        return calls_on(cluster, function, arguments, n_jobs=n_jobs)
    with held_back(STOPPING):
        # Processes start here and inherit it: signals are this process's to handle, which then ends them.
        results: Iterator[Result] = Parallel(
            n_jobs=n_jobs, return_as="generator_unordered", initializer=_serve, initargs=(os.getpid(),)
        )(delayed(function)(*own) for own in arguments)
    return results


class Beside:
    """One process for work that goes on beside this one's; it ends within a second of this one, however that ends."""

    def __init__(self) -> None:
        """Start nothing yet."""
        self._executor = ProcessPoolExecutor(max_workers=1, initializer=_serve, initargs=(os.getpid(),))

    def ask(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Have a function called there, after what was asked before.

        Args:
            function: To be called; it, the arguments and the result travel between processes.
            *arguments: Of the call.

        Returns:
            Its result to come.
        """
        with held_back(STOPPING):
            found: Future[Result] = self._executor.submit(function, *arguments)
        return found

    def close(self) -> None:
        """End the process, whatever it does."""
        self._executor.shutdown(wait=True, kill_workers=True)


@contextmanager
def held_back(signals: Iterable[signal.Signals]) -> Iterator[None]:
    """Hold signals back for a moment: they come when the block has ended; processes started in it never get them.

    Args:
        signals: To be held back.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(parent: int) -> None:
    """Begin a worker's life: deaf to what its parent handles, and not longer than its parent's."""
    for number in STOPPING:
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process soon after its parent; a parent that is gone already has left it to another one.

    Not prctl's PR_SET_PDEATHSIG, which also fires when the thread that started the worker ends.
    """
    while os.getppid() == parent:
        time.sleep(WATCH_PERIOD)
    os._exit(1)
