"""Work on a Ray cluster: calls go wherever a core is free, and elsewhere again if a machine is lost on the way.

Calls are Ray tasks. joblib's backend for Ray pins calls to actors: a lost machine ends the run or, with restarts, stops
it for good, and results come when all are there.
"""

import logging
import os
import pickle
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

logger = logging.getLogger(__name__)

Result = TypeVar("Result")

ATTEMPTS = 5
"""How often a call is made again whose machine or process was lost; a crash of its own would go on for ever."""
AHEAD = 2
"""Calls that are handed to the cluster, for each core: one that runs, and one that waits beside it."""
LOOK_PERIOD = 5.0
"""Time between two looks at how many cores the cluster has [s]."""
ANSWER_TIME = 10.0
"""Time for a head to answer [s]."""


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """A Ray cluster, and what its machines have to have in common with the one that asks.

    They share a file system: paths mean the same on all of them, and what calls write is found by whoever asked.
    """

    address: str = "auto"
    """Host and port of the head, as `ray.init` takes it; "auto" finds the one of this machine, or RAY_ADDRESS's."""
    folder: str
    """Where calls run, so that relative paths hold."""
    environment: Mapping[str, str]
    """Variables that calls see."""
    versions: Mapping[str, str]
    """Of packages that have to be the same everywhere; else equal calls could give other bits."""


_ACTIVE: ContextVar[Cluster | None] = ContextVar("cluster", default=None)


def active_cluster() -> Cluster | None:
    """Where calls are made now.

    Returns:
        The cluster of the innermost `on_cluster`, or None.
    """
    return _ACTIVE.get()


@contextmanager
def on_cluster(cluster: Cluster) -> Iterator[None]:
    """Have all calls of `processes.in_processes` made on a cluster while the block runs.

    Args:
        cluster: To connect to. Calls that have not ended with the block are given up.

    Raises:
        RuntimeError: If Ray is not installed.
        ConnectionError: If no cluster answers.
    """
    try:
        import ray
    except ImportError as error:
        raise RuntimeError(
            f"the backend 'ray' needs the extra 'cluster' (pip install 'socialnav-mj[cluster]'): {error}"
        ) from error
    _check_answer(cluster.address)
    # Ray prints what befalls its machines to stdout, which is for results, and offers no way to have it elsewhere.
    printing: Any = import_module("ray._private.worker")
    printed = printing.print_to_stdstream
    printing.print_to_stdstream = _warn
    before = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM)]
    try:
        ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
    except (ConnectionError, RuntimeError, ValueError) as error:
        printing.print_to_stdstream = printed
        raise ConnectionError(
            f"no Ray cluster answers at {cluster.address!r}; `ray start --head` starts one on this machine: {error}"
        ) from error
    finally:
        for number, handler in before:  # Ray has put its own there
            if signal.getsignal(number) != handler:
                signal.signal(number, handler)
    token = _ACTIVE.set(cluster)
    try:
        yield
    finally:
        _ACTIVE.reset(token)
        ray.shutdown()
        printing.print_to_stdstream = printed


def _check_answer(address: str) -> None:
    """Refuse an address at which nobody listens: Ray would try for minutes."""
    host, colon, port = address.rpartition(":")
    if colon and port.isdigit() and "/" not in host:
        try:
            socket.create_connection((host, int(port)), timeout=ANSWER_TIME).close()
        except (OSError, OverflowError) as error:
            raise ConnectionError(
                f"no Ray cluster answers at {address!r}; `ray start --head` starts one on this machine: {error}"
            ) from error


def _warn(message: Mapping[str, Any], ignore_prefix: bool) -> None:
    """Tell the first line of each of Ray's messages; the rest is for its developers, and in its logs."""
    for text in message["lines"]:
        logger.warning("Ray: %s", text.strip().partition("\n")[0])


def calls_on(
    cluster: Cluster, function: Callable[..., Result], arguments: Iterable[tuple[object, ...]], *, n_jobs: int
) -> Iterator[Result]:
    """Call a function with many arguments, in the block of `on_cluster`.

    Args:
        cluster: That of the block.
        function: To be called; it and its results travel between machines.
        arguments: Of each call.
        n_jobs: Calls under way at once, at most; -1 for one a core, of as many as the cluster has by then.

    Yields:
        Results in the order in which the calls end. An exception of a call is raised here, one of Ray's if the call was
        lost `ATTEMPTS` times and once more.
    """
    import ray

    task = ray.remote(num_cpus=1, max_retries=ATTEMPTS)(_call)
    shared = ray.put(cluster)
    left = iter(arguments)
    under_way: set[Any] = set()
    most, looked = n_jobs, float("-inf")
    try:
        while True:
            if n_jobs < 0 and time.monotonic() > looked + LOOK_PERIOD:
                most, looked = AHEAD * int(ray.cluster_resources().get("CPU", 1)), time.monotonic()
            room = most - len(under_way)
            under_way |= {task.remote(shared, pickle.dumps((function, own))) for own in islice(left, max(room, 0))}
            if not under_way:
                return
            (done,), _ = ray.wait(list(under_way), num_returns=1)
            under_way.remove(done)
            try:
                result: Result = ray.get(done)
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            yield result
    finally:
        for call in under_way:
            ray.cancel(call, force=True)


def _call(cluster: Cluster, pickled: bytes) -> Any:
    """Make a call in a worker of whatever machine, as if it were made where it was asked for."""
    _settle(cluster)
    function, arguments = pickle.loads(pickled)
    return function(*arguments)


def _settle(cluster: Cluster) -> None:
    """Go where calls are to run.

    Raises:
        RuntimeError: If this machine does not share the folder, or has other packages.
    """
    here = socket.gethostname()
    if not Path(cluster.folder).is_dir():
        raise RuntimeError(f"{here} has no folder {cluster.folder}; a cluster's machines have to share a file system")
    for name, wanted in cluster.versions.items():
        try:
            found = version(name)
        except PackageNotFoundError:
            found = "not installed"
        if found != wanted:
            raise RuntimeError(f"{here} has {name} {found}, but {wanted} is asked for: install the same everywhere")
    os.chdir(cluster.folder)
    os.environ.update(cluster.environment)
    if cluster.folder not in sys.path:
        sys.path.append(cluster.folder)
