"""Kill commands at random moments and repeat them: what they leave in the end is what an undisturbed one leaves.

`python -m tests.kill --rounds 200 --seed 0` prints a line a round and a summary, and ends with exit code 1 if a round
failed; its folder is kept. Round k of a seed takes the same command, signals and moments again, as far as the machine's
pace allows: `--rounds 1 --seed K` repeats the round that a failure names.
"""

import argparse
import atexit
import json
import os
import random
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol

sys.path.insert(0, str(Path(__file__).parent))

from kill_commands import COMMANDS, SERVER, serve

PROGRAM = Path(__file__).parent / "kill_commands.py"
ROOT = PROGRAM.parents[1]
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
LONGEST = 600.0
"""A command that takes longer hangs [s]."""
GRACE = 10.0
"""Workers that outlive their command by this stay; an idle machine takes a quarter of a second [s]."""


class BrokenError(Exception):
    """A round did not end as it has to."""


@dataclass(frozen=True, kw_only=True)
class Blow:
    """One signal to a running command."""

    number: signal.Signals
    to_all: bool
    """To the workers as well, as a terminal or a batch system does, or to the command alone."""
    share: float
    """Of the time that the undisturbed command takes, after which it falls, if `change` is None."""
    change: int | None
    """It falls at once when so many files have come or gone; that is when something is being written."""


def blows_of(seed: int) -> tuple[str, list[Blow]]:
    """What a round does.

    Args:
        seed: Of the round.

    Returns:
        Name of the command, each in turn, and one to four signals for as many starts of it, most of them SIGKILL.
    """
    chance = random.Random(seed)
    name = [*COMMANDS][seed % len(COMMANDS)]
    blows = []
    for _ in range(chance.randint(1, 4)):
        number = signal.SIGKILL if chance.random() < 0.8 else chance.choice(SIGNALS[1:])
        change = chance.randint(1, 12) if chance.random() < 0.5 else None
        blows.append(Blow(number=number, to_all=chance.random() < 0.5, share=chance.random(), change=change))
    return name, blows


class Process(Protocol):
    """What is done with a running command, as with a `subprocess.Popen`."""

    pid: int

    def poll(self) -> int | None:
        """Exit code, None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Exit code, when it has ended."""


class Forked:
    """A command that a starter has forked; it leads a process group of its own."""

    def __init__(self, name: str, folder: Path) -> None:
        """Start it.

        Args:
            name: Of `COMMANDS`.
            folder: Current folder of the command; its output and errors are in a log beside it.
        """
        self._idle = _starters(COMMANDS[name].imports)
        self._starter = self._idle.pop() if self._idle else _new_starter(COMMANDS[name].imports)
        self._starter.stdin.write(f"{name}\t{folder}\n".encode())
        self.pid = int(self._starter.stdout.readline())
        self._code: int | None = None

    def poll(self) -> int | None:
        """Exit code, None while it runs."""
        with suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end.

        Args:
            timeout: [s]; None for ever.

        Returns:
            Exit code, -N if signal N ended it.

        Raises:
            TimeoutExpired: If it runs on.
        """
        if self._code is None:
            if not select.select([self._starter.stdout], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("command", timeout or 0.0)
            self._code = int(self._starter.stdout.readline())
            self._idle.append(self._starter)
        return self._code


@lru_cache
def _starters(imports: tuple[str, ...]) -> "list[subprocess.Popen[bytes]]":
    """Starters that have nothing to do, by what they have imported."""
    return []


def _new_starter(imports: tuple[str, ...]) -> "subprocess.Popen[bytes]":
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    local = {"NO_PROXY": "127.0.0.1", "no_proxy": "127.0.0.1", SERVER: _server(), "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, PROGRAM, *imports],
        env={**os.environ, "PYTHONPATH": path, **local},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        bufsize=0,
    )


@lru_cache(maxsize=1)
def _server() -> str:
    return serve()


def strike(process: Process, blow: Blow, folder: Path, duration: float) -> bool:
    """Wait for the moment and send the signal, unless the command has ended before; then wait for all to end.

    Args:
        process: Of the command.
        blow: What to send, and when.
        folder: Of the command.
        duration: Of the undisturbed command [s].

    Returns:
        Whether the signal was sent: the command may have ended before.

    Raises:
        BrokenError: If the command ends with another exit code than the signal's, or leaves processes.
    """
    begin, seen, changes = time.monotonic(), set(folder.rglob("*")), 0
    while process.poll() is None and time.monotonic() - begin < LONGEST:
        if blow.change is None:
            if time.monotonic() - begin >= blow.share * duration:
                break
        else:
            now = set(folder.rglob("*"))
            changes += len(now ^ seen)
            seen = now
            if changes >= blow.change:
                break
        time.sleep(0.005)
    allowed = {0}
    if sent := process.poll() is None:  # else its number may be another's by now
        (os.killpg if blow.to_all else os.kill)(process.pid, blow.number)
        # Whoever is struck before the command has made itself ready ends by the signal itself.
        allowed |= {-blow.number, 128 + blow.number}
    code = wait(process)
    if code not in allowed:
        raise BrokenError(f"exit code {code} after {blow}; expected one of {sorted(allowed)}")
    return sent


def wait(process: Process) -> int:
    """Wait for a command and its workers.

    Args:
        process: Of the command.

    Returns:
        Exit code.

    Raises:
        BrokenError: If it hangs, or workers stay.
    """
    try:
        code = process.wait(timeout=LONGEST)
        deadline = time.monotonic() + GRACE
        while alive(process.pid) and time.monotonic() < deadline:
            time.sleep(0.02)
        if left := alive(process.pid):
            raise BrokenError(f"processes {left} outlive their command")
    except subprocess.TimeoutExpired as error:
        raise BrokenError(f"it did not end in {LONGEST:g} s") from error
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    return code


def alive(group: int) -> list[int]:
    """Processes of a group that still run.

    Args:
        group: Its number.

    Returns:
        Process numbers; the dead whom nobody has buried do not count.
    """
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # gone meanwhile
            state, _, own = path.read_text().rpartition(")")[2].split()[:3]
            if int(own) == group and state not in "ZX":
                found.append(int(path.parent.name))
    return found


def contents(folder: Path) -> dict[str, Any]:
    """What a command has left, as far as it has to be the same every time.

    Args:
        folder: Of the command.

    Returns:
        By file: arrays and metadata of an episode, columns of a trace, JSON without times, else a hash of the bytes.
        TensorBoard's logs, whose names hold the time, and torch's checkpoints, which hold it inside, are left out.
    """
    from socialnav_mj.episode import Episode
    from socialnav_mj.trace.columns import trace_columns

    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if not path.is_file() or "tensorboard" in path.parts or path.suffix == ".pt":
            continue
        if path.suffix == ".npz":
            episode = Episode.load(path)
            arrays = {k: v.tobytes() for k, v in vars(episode).items() if hasattr(v, "tobytes")}
            content: Any = (episode.policies, episode.metadata, arrays)
        elif path.suffix == ".rrd":
            content = trace_columns(path)
        elif path.suffix == ".json":
            content = _without_times(json.loads(path.read_text()))
        else:
            content = path.read_bytes()
        found[name] = sha256(repr(content).encode()).hexdigest()
    return found


def _without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_times(own) for key, own in sorted(value.items()) if key != "seconds"}
    return [_without_times(own) for own in value] if isinstance(value, list) else value


@lru_cache(maxsize=len(COMMANDS))
def _inputs(name: str) -> Path:
    """Folder with what a command needs, made once."""
    folder = Path(tempfile.mkdtemp(prefix=f"kill_{name}_inputs_"))
    atexit.register(shutil.rmtree, folder)
    COMMANDS[name].prepare(folder)
    return folder


@lru_cache(maxsize=len(COMMANDS))
def undisturbed(name: str) -> tuple[dict[str, Any], float]:
    """What a command leaves that nobody kills, and how long it takes.

    Args:
        name: Of `COMMANDS`.

    Returns:
        Contents and time [s].

    Raises:
        BrokenError: If it fails.
    """
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / "run"
        shutil.copytree(_inputs(name), folder)
        begin = time.monotonic()
        code = wait(Forked(name, folder))
        duration = time.monotonic() - begin
        if code:
            raise BrokenError(f"{name} fails undisturbed: {folder.with_name('run.log').read_text()}")
        return contents(folder), duration


def run_round(seed: int, root: Path, name: str | None = None) -> tuple[str, list[Blow]]:
    """Kill a command, once or several times, repeat it until it ends, and compare.

    Args:
        seed: Of the round.
        root: Gets a folder `run` and its log.
        name: Of the command; chosen by the seed by default.

    Returns:
        Name of the command, and the signals that were sent.

    Raises:
        BrokenError: If the command fails, leaves processes or temporary files, or something other than an undisturbed
            one.
    """
    chosen, blows = blows_of(seed)
    name = name or chosen
    expected, duration = undisturbed(name)
    folder = root / "run"
    shutil.copytree(_inputs(name), folder)
    sent = [blow for blow in blows if strike(Forked(name, folder), blow, folder, duration)]
    if code := wait(Forked(name, folder)):
        raise BrokenError(f"{name} ends with {code} when it is repeated, see {folder.with_name('run.log')}")
    found = contents(folder)
    if wrong := sorted(k for k in expected.keys() | found.keys() if expected.get(k) != found.get(k)):
        raise BrokenError(f"{name} leaves otherwise than undisturbed: {', '.join(wrong)}")
    return name, sent


def _told(blow: Blow) -> str:
    moment = f"{blow.share:.0%}" if blow.change is None else f"change {blow.change}"
    return f"{blow.number.name}{' to all' if blow.to_all else ''} at {moment}"


def main() -> None:
    """Run rounds."""
    parser = argparse.ArgumentParser(prog="python -m tests.kill", description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0, help="of the first round; the others count up from it")
    parser.add_argument("--command", choices=[*COMMANDS], help="one alone")
    arguments = parser.parse_args()
    failed, counts = [], {name: Counter[str]() for name in COMMANDS}
    for seed in range(arguments.seed, arguments.seed + arguments.rounds):
        root = Path(tempfile.mkdtemp(prefix=f"kill_{seed}_"))
        begin = time.monotonic()
        try:
            name, sent = run_round(seed, root, arguments.command)
        except BrokenError as error:
            failed.append(seed)
            result = f"FAILED, see {root}: {error}"
        else:
            shutil.rmtree(root)
            counts[name].update(["rounds", *(blow.number.name for blow in sent)])
            result = f"{name}: {', '.join(map(_told, sent)) or 'ended before it was struck'}"
        sys.stdout.write(f"round {seed} ({time.monotonic() - begin:.0f} s): {result}\n")
        sys.stdout.flush()
    for name, count in counts.items():
        sys.stdout.write(f"{name}: {', '.join(f'{number} {what}' for what, number in count.items())}\n")
    sys.stdout.write(f"{arguments.rounds - len(failed)} of {arguments.rounds} rounds end as undisturbed")
    sys.stdout.write(f"; not so {', '.join(map(str, failed))}\n" if failed else "\n")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
