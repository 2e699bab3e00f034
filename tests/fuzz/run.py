"""Attack readers of files on all cores for a while: `python -m tests.fuzz.run --seconds 600 --seed 1`.

Counts what is accepted and refused, and ends with exit code 1 if an input was met by an error that its reader does not
declare (raw), took over 10 s (slow), asked for over 1 GB (memory) or ended the process (died). Such inputs are kept.
"""

import argparse
import multiprocessing
import os
import sys
from collections import Counter
from dataclasses import dataclass
from importlib import import_module
from math import inf
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from time import monotonic
from typing import Any

from .attack import BAD, SLOWEST, Attack, Note, keep
from .target import Target, input_of

COLUMNS = ("accepted", "refused", *BAD, "died")
TARGETS = f"{__package__}.targets"
CONTEXT = multiprocessing.get_context("spawn")


@dataclass
class Worker(Note):
    """A process that attacks: it tells what it does by way of this, and the parent reads it."""

    number: int
    names: list[str]
    current: Any
    """Shared: place of the target in `names`, time at which it was fed [us], and per target the last index fed."""
    connection: Connection
    process: SpawnProcess | None = None

    def before(self, target: int, index: int) -> None:
        self.current[2 + target] = index
        self.current[:2] = [target, int(1e6 * monotonic())]

    def counts(self, counts: dict[str, Counter[str]]) -> None:
        self.connection.send(counts)


def work(worker: Worker, module: str, end: float, step: int, seed: int, until: float, failures: str) -> None:
    """What a process does."""
    targets = _chosen(module, worker.names)
    attack = Attack(targets=targets, seed=seed, failures=Path(failures))
    attack.limit()
    start = {name: last + step for name, last in zip(worker.names, worker.current[2:], strict=True)}
    attack.run(start, end, step, until, worker)


def attack_all(
    names: list[str],
    *,
    seconds: float,
    seed: int,
    jobs: int,
    failures: Path,
    inputs: float = inf,
    module: str = TARGETS,
) -> dict[str, Counter[str]]:
    """Attack targets with several processes; one that dies is noted and replaced.

    Args:
        names: Of targets.
        seconds: For all together.
        seed: Of the inputs.
        jobs: Processes.
        failures: Folder of inputs that fail.
        inputs: For each target.
        module: Whose TARGETS these are.

    Returns:
        Per target what became of its inputs.
    """
    until = monotonic() + seconds
    targets = _chosen(module, names)
    totals: dict[str, Counter[str]] = {name: Counter() for name in names}

    def start(number: int, fed: list[int]) -> Worker:
        receive, send = CONTEXT.Pipe(duplex=False)
        current = CONTEXT.Array("q", [0, 0, *fed], lock=False)
        teller = Worker(number=number, names=names, current=current, connection=send)
        process = CONTEXT.Process(
            target=work, args=(teller, module, inputs, jobs, seed, until, str(failures)), daemon=True
        )
        process.start()
        send.close()
        return Worker(number=number, names=names, current=current, connection=receive, process=process)

    workers = [start(number, [number - jobs] * len(names)) for number in range(jobs)]
    while workers:
        wait([worker.connection for worker in workers], timeout=0.5)
        for worker in list(workers):
            assert worker.process is not None
            place, since, *fed = worker.current[:]
            if since and monotonic() - since / 1e6 > 2.0 * SLOWEST:
                worker.process.kill()  # too deep in a library to be interrupted
                worker.process.join()
            alive = worker.process.is_alive()
            _listen(worker, totals)
            if alive:
                continue
            worker.process.join()
            workers.remove(worker)
            code = worker.process.exitcode
            if code == 0:
                continue
            if not since:
                raise RuntimeError(f"a process ended with {code} before its first input")
            totals[names[place]]["died"] += 1
            content = input_of(targets[place], seed, fed[place])
            keep(failures, targets[place], seed, fed[place], content, "died", f"the process ended with {code}")
            if monotonic() < until:
                workers.append(start(worker.number, fed))
    return totals


def _chosen(module: str, names: list[str]) -> list[Target]:
    return [target for target in import_module(module).TARGETS if target.name in names]


def _listen(worker: Worker, totals: dict[str, Counter[str]]) -> None:
    try:
        while worker.connection.poll():
            for name, counts in worker.connection.recv().items():
                totals[name].update(counts)
    except EOFError:
        pass


def main(args: list[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all targets together (default: 60)")
    parser.add_argument("--inputs", type=int, default=inf, help="for each target, at most (default: as time allows)")
    parser.add_argument("--seed", type=int, default=0, help="of the inputs (default: 0)")
    parser.add_argument("--target", action="append", help="name, or beginning of names; repeatable (default: all)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes (default: one a core)")
    parser.add_argument("--failures", type=Path, default=Path("runs/fuzz"), help="folder of inputs that fail")
    given = parser.parse_args(args)
    known = [target.name for target in import_module(TARGETS).TARGETS]
    names = [name for name in known if not given.target or name.startswith(tuple(given.target))]
    if not names:
        parser.error(f"no target begins with {given.target}; there are {', '.join(known)}")
    begin = monotonic()
    totals = attack_all(
        names,
        seconds=given.seconds,
        seed=given.seed,
        jobs=given.jobs,
        failures=given.failures,
        inputs=given.inputs,
    )
    took = monotonic() - begin
    sys.stdout.write(f"{'target':20}" + "".join(f"{name:>10}" for name in COLUMNS) + "\n")
    for name, counts in totals.items():
        sys.stdout.write(f"{name:20}" + "".join(f"{counts[column]:10}" for column in COLUMNS) + "\n")
    n_inputs = sum(counts.total() for counts in totals.values())
    failed = sum(counts[kind] for counts in totals.values() for kind in (*BAD, "died"))
    sys.stdout.write(f"{n_inputs} inputs in {took:.0f} s ({n_inputs / took:.0f}/s), {failed} failed")
    sys.stdout.write(f"; the inputs are in {given.failures}\n" if failed else "\n")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
