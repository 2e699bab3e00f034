"""A crowd in a process of its own: commands go through a pipe, and slots lie in memory that both sides see."""

import pickle
import signal
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from ctypes import Array as SharedBytes
from ctypes import c_char
from dataclasses import dataclass
from multiprocessing import get_context, get_start_method, set_start_method
from multiprocessing.connection import Connection
from multiprocessing.resource_tracker import ensure_running
from time import process_time
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.envs.guided import GuidedCrowd
from socialnav_mj.processes import held_back

PATIENCE = 2.0
"""A worker whose pipe is closed gets so long to end [s]; it owns nothing, so that ending it by force is safe."""

# Neither forks, which copy locks that other threads hold, and each other's pipes, so that a death would not be noticed;
# nor a fork server, which stays behind, and which workers would have for a parent.
_CONTEXT = get_context("spawn")


class WorkerError(RuntimeError):
    """A worker raised or died; the message says which one, and what went wrong."""


def slot_type(size: int) -> np.dtype[Any]:
    """What is told of a slot between processes.

    Args:
        size: Numbers in a state.

    Returns:
        A structured type: action [in], seen, last_state, reward, outcome and active [out].
    """
    return np.dtype(
        [
            ("action", np.float64, 2),
            ("seen", np.float32, size),
            ("last_state", np.float32, size),
            ("reward", np.float32),
            ("outcome", np.int64),
            ("active", np.bool_),
        ],
        align=True,
    )


class SharedSlots:
    """Slots that several processes see; no name in the file system holds the memory, so it ends with the processes."""

    def __init__(self, count: int, size: int) -> None:
        """Share memory, all zeros.

        Args:
            count: Slots.
            size: Numbers in a state.
        """
        self._type = slot_type(size)
        # Not multiprocessing.shared_memory: its blocks have names, which outlive processes that are killed.
        self._bytes: SharedBytes[c_char] = _CONTEXT.RawArray(c_char, count * self._type.itemsize)

    @property
    def slots(self) -> NDArray[Any]:
        """The slots, shape (count,), of `slot_type`; a view."""
        return np.frombuffer(memoryview(self._bytes), dtype=self._type)


@dataclass(frozen=True, kw_only=True)
class Failure:
    """An exception of a worker, as text: whatever it holds, it travels."""

    kind: str
    """Name of its type."""
    message: str
    trace: str
    """Where it was raised."""
    is_missing_attribute: bool
    """The worker's crowd has no such attribute."""

    @classmethod
    def of(cls, error: Exception) -> "Failure":
        """Tell an exception.

        Args:
            error: Caught in the worker.

        Returns:
            Its texts.
        """
        return cls(
            kind=type(error).__name__,
            message=str(error),
            trace="".join(traceback.format_exception(error)),
            is_missing_attribute=isinstance(error, AttributeError),
        )

    def raise_here(self, whose: str) -> None:
        """Raise it in this process.

        Args:
            whose: Names the worker.

        Raises:
            AttributeError: If it was one; learners ask in this way whether there is an attribute.
            WorkerError: If it was any other.
        """
        here = AttributeError if self.is_missing_attribute else WorkerError
        error = here(f"{whose} raised {self.kind}: {self.message}")
        error.add_note(f"In the worker:\n{self.trace}")
        raise error


class _Scenes:
    """The commands that a worker knows."""

    def __init__(self, make: Callable[[], GuidedCrowd], slots: NDArray[Any]) -> None:
        self._make, self._slots = make, slots

    def start(self) -> None:
        """Build the first scene."""
        self._crowd = self._make()

    def reset(self) -> None:
        self._slots["seen"] = self._crowd.begin()[""]

    def step(self) -> None:
        step = self._crowd.step(self._slots["action"])
        self._slots["last_state"] = self._crowd.last_states(step)
        self._slots["seen"], self._slots["reward"] = step.seen[""], step.reward
        self._slots["outcome"], self._slots["active"] = step.outcome, step.active

    def get(self, name: str) -> Any:
        return getattr(self._crowd, name)

    def set(self, name: str, value: Any) -> None:
        setattr(self._crowd, name, value)

    def call(self, name: str, args: Sequence[Any] = (), kwargs: Mapping[str, Any] = MappingProxyType({})) -> Any:
        return getattr(self._crowd, name)(*args, **kwargs)

    def cpu_time(self) -> float:
        return process_time()


def serve(pipe: Connection, make: Callable[[], GuidedCrowd], shared: SharedSlots, rows: slice) -> None:
    """A worker's life: answer commands until the other end of the pipe is closed, also by its owner's death.

    Args:
        pipe: Brings the name of a command and its arguments; each is answered by its value or a `Failure`, pickled.
        make: Makes the crowd.
        shared: Slots of all workers.
        rows: Which of them are this one's.
    """
    scenes = _Scenes(make, shared.slots[rows])
    name: str = "start"
    args: tuple[Any, ...] = ()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            try:
                answer = pickle.dumps(getattr(scenes, name)(*args))
            except Exception as error:  # noqa: BLE001  whatever it is, it is raised on the other side
                answer = pickle.dumps(Failure.of(error))
            pipe.send_bytes(answer)
            name, args = pickle.loads(pipe.recv_bytes())


def command(name: str, *args: Any) -> bytes:
    """A command as it travels; what cannot travel raises before any worker has heard of it.

    Args:
        name: One of start, reset, step, get, set, call, cpu_time.
        *args: Its arguments.

    Returns:
        Its bytes, for `Worker.send`.
    """
    return pickle.dumps((name, args))


class Worker:
    """The other end of a worker's pipe."""

    def __init__(self, name: str, make: Callable[[], GuidedCrowd], shared: SharedSlots, rows: slice) -> None:
        """Start a process; it owes the answer to its first command, `start`.

        Args:
            name: Stands in messages.
            make: Makes the crowd, there.
            shared: Slots of all workers.
            rows: Which of them are this one's.
        """
        self.name = name
        self._pipe, theirs = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(target=serve, args=(theirs, make, shared, rows), name=name, daemon=True)
        # Spawning starts multiprocessing's tracker of resources if there is none, and that lets SIGINT through again.
        ensure_running()
        try:
            # Ctrl-C goes to all processes of a terminal; here it is for the first one, which then ends the others.
            with held_back((signal.SIGINT, signal.SIGHUP)), _start_method("spawn"):
                self._process.start()
        finally:
            theirs.close()

    def send(self, content: bytes) -> None:
        """Send a command.

        Args:
            content: As `command` returns it.

        Raises:
            WorkerError: If the worker has died.
        """
        try:
            self._pipe.send_bytes(content)
        except (BrokenPipeError, ConnectionResetError):
            raise WorkerError(self._death()) from None

    def receive(self) -> Any:
        """Wait for the answer to a command.

        Returns:
            Its value, or a `Failure`.

        Raises:
            WorkerError: If the worker has died.
        """
        try:
            answer = self._pipe.recv_bytes()
        except (EOFError, ConnectionResetError):
            raise WorkerError(self._death()) from None
        return pickle.loads(answer)

    def _death(self) -> str:
        self._process.join(PATIENCE)
        code = self._process.exitcode
        if code is None:
            return f"{self.name} no longer answers"
        if code >= 0:
            return f"{self.name} ended with exit code {code}; its own words, if any, are on stderr"
        memory = "; the system does so when memory runs out" if -code == signal.SIGKILL else ""
        return f"{self.name} was ended by {signal.Signals(-code).name}{memory}"

    def hang_up(self) -> None:
        """Close the pipe: the worker ends when it has done what it does."""
        self._pipe.close()

    def end(self, patience: float) -> None:
        """Wait for the end of a worker whose pipe is closed; then end it by force.

        Args:
            patience: Longest time to wait [s].
        """
        self._process.join(max(patience, 0.0))
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()
        self._process.close()


@contextmanager
def _start_method(name: str) -> Iterator[None]:
    """Processes are told how their parent starts others: joblib's have a way of their own, which ours do not know."""
    before = get_start_method(allow_none=True)
    set_start_method(name, force=True)
    try:
        yield
    finally:
        set_start_method(before, force=True)
