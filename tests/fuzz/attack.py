"""One process that feeds inputs to readers, and tells what became of them."""

import hashlib
import logging
import resource
import signal
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from time import monotonic
from types import FrameType

from .target import Target, input_of, seeds_of

SLOWEST = 10.0
"""An input may take so long [s]."""
LARGEST = 10**9
"""An input may ask for so much memory beyond what the process has with everything imported [bytes]."""
AT_ONCE = 2.0
"""A target is attacked this long before it is the next one's turn [s]."""
_KEPT = 3
"""Inputs that are kept of each place where it fails."""
BAD = ("raw", "slow", "memory")
"""What must not happen; `died` besides, which the process cannot tell itself."""


def scratch() -> TemporaryDirectory[str]:
    """A folder in memory, if there is one: most of an input's time would go into the disk."""
    return TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else gettempdir())


class Late(BaseException):
    """An input takes too long; no `except Exception` swallows it."""


@dataclass
class Attack:
    """Feeds inputs to targets, in turn, and counts what becomes of them."""

    targets: list[Target]
    seed: int
    failures: Path
    """Folder that gets the inputs that fail, with their traceback."""
    counts: dict[str, Counter[str]] = field(default_factory=dict)
    """Per target: accepted, refused, raw, slow, memory."""
    _limited: bool = False
    _seen: Counter[str] = field(default_factory=Counter)

    def limit(self) -> None:
        """Bound memory and time of what follows, after everything has been imported and tried once."""
        logging.disable()
        with scratch() as folder:
            for target in self.targets:
                for content in seeds_of(target):
                    target.read(content, Path(folder))
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        bound = pages * resource.getpagesize() + LARGEST
        resource.setrlimit(resource.RLIMIT_AS, (bound, resource.RLIM_INFINITY))
        signal.signal(signal.SIGALRM, _late)
        self._limited = True
        warnings.simplefilter("ignore")  # of numpy about overflow; what comes of it is checked

    def one(self, target: Target, index: int, folder: Path) -> str:
        """Feed one input.

        Args:
            target: What is attacked.
            index: Of the input.
            folder: To put files into.

        Returns:
            accepted, refused, raw, slow or memory.
        """
        content = input_of(target, self.seed, index)
        if self._limited:
            signal.setitimer(signal.ITIMER_REAL, SLOWEST)
        try:
            target.read(content, folder)
            kind, caught = "accepted", None
        except Late as error:
            kind, caught = "slow", error
        except target.refuses() as error:
            # A reader may have turned a lack of memory into its own error.
            kind, caught = ("memory" if _lacked_memory(error) else "refused"), error
        except MemoryError as error:
            kind, caught = "memory", error
        except Exception as error:  # noqa: BLE001  this is what is looked for
            kind, caught = "raw", error
        finally:
            if self._limited:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        self.counts.setdefault(target.name, Counter())[kind] += 1
        if kind in BAD and caught is not None:
            self._keep(target, index, content, kind, caught)
        return kind

    def run(self, start: dict[str, int], end: float, step: int, until: float, note: "Note") -> None:
        """Feed inputs to the targets in turn.

        Args:
            start: Per target the first index.
            end: Indices stay below it.
            step: To the next index.
            until: On the monotonic clock [s].
            note: Told of each input before it is fed, and of the counts now and then.
        """
        index = dict(start)
        with scratch() as folder:
            while monotonic() < until and min(index.values()) < end:
                for number, target in enumerate(self.targets):
                    turn = min(until, monotonic() + AT_ONCE)
                    while monotonic() < turn and index[target.name] < end:
                        note.before(number, index[target.name])
                        self.one(target, index[target.name], Path(folder))
                        index[target.name] += step
                    note.counts(self.counts)
                    self.counts = {}

    def _keep(self, target: Target, index: int, content: bytes, kind: str, error: BaseException) -> None:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if "socialnav_mj" in frame.filename] or frames
        place = f"{type(error).__name__} {Path(own[-1].filename).name}:{own[-1].lineno}"
        self._seen[place] += 1
        if self._seen[place] <= _KEPT:
            text = "".join(traceback.format_exception(error))
            keep(self.failures, target, self.seed, index, content, kind, f"{place}\n\n{text}")


class Note:
    """What an attack tells; the parent process listens to a subclass."""

    def before(self, target: int, index: int) -> None:
        """An input is fed next."""

    def counts(self, counts: dict[str, Counter[str]]) -> None:
        """What became of the inputs since the last time."""


def keep(folder: Path, target: Target, seed: int, index: int, content: bytes, kind: str, text: str) -> None:
    """Write an input that fails, and why, named after its content."""
    name = f"{target.name.replace('/', '.')}.{kind}.{hashlib.sha256(content).hexdigest()[:12]}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.bin").write_bytes(content)
    (folder / f"{name}.txt").write_text(f"{target.name}, seed {seed}, input {index}: {text}", errors="replace")


def _lacked_memory(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _late(number: int, frame: FrameType | None) -> None:
    raise Late
