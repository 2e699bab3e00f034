"""Commands that `tests.kill` kills, small enough that one takes a few seconds, and the program that starts them.

`python kill_commands.py MODULE ...` imports modules and then runs what its standard input tells it to, each command in
a process of its own that is forked: imports take longer than all that is worth killing.
"""

import hashlib
import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from toy_policies import write_toy

TINY = Path(__file__).parent / "data" / "tiny" / "tiny.txt"
SERVER = "TESTS_KILL_SERVER"
"""Environment variable with the address that `fetch` downloads from."""
CONTENT = b"0 1 0 0\n10 1 1 0\n" * 5000


@dataclass(frozen=True, kw_only=True)
class Command:
    """Something that can be killed and repeated."""

    run: Callable[[], None]
    """What the program does, in the current folder."""
    prepare: Callable[[Path], None] = lambda folder: None
    """Puts its inputs into a folder."""
    imports: tuple[str, ...] = ("socialnav_mj.cli", "socialnav_mj.studies.paper.outputs", "pandas", "requests")
    """What is imported before it starts; nothing that has threads, which a fork would leave behind."""


def _typed(*arguments: str) -> None:
    from socialnav_mj.cli import main

    sys.argv = ["socialnav-mj", *arguments]
    main([*arguments])


def _evaluate(jobs: int = 1) -> None:
    _draw_coarsely()
    wanted = f"--dataset {TINY} --scenarios 4 --controllers go_straight --draws 2 --jobs {jobs} --out out"
    _typed("evaluate", *wanted.split())


def _draw_coarsely() -> None:
    """Draw and resample little: neither is what is tested, and both take their time."""
    from socialnav_mj.report import style

    style.DOTS_PER_INCH = 40


def _report() -> None:
    _draw_coarsely()
    _typed("report", "out", "--jobs", "1")


def _prepare_report(folder: Path) -> None:
    from socialnav_mj.evaluation import Evaluation, evaluate

    evaluation = Evaluation(dataset=str(TINY), scenarios=("scenario_4",), controllers=("go_straight",), draws=2)
    list(evaluate(evaluation, folder / "out", command="as typed", n_jobs=1))


def _reproduce() -> None:
    _draw_coarsely()
    policies = [f"policies/p{seed}.safetensors" for seed in (0, 1)]
    _typed(*f"reproduce --dataset {TINY} --scenarios 1 4 --draws 1 --jobs 1 --out out --policies".split(), *policies)


def _prepare_reproduce(folder: Path) -> None:
    (folder / "policies").mkdir()
    for seed in (0, 1):
        write_toy(folder / "policies", f"p{seed}", seed=seed)


def _train() -> None:
    from socialnav_mj.config import Scenario

    Scenario.allowed_steps = lambda self, distance: 30  # type: ignore[method-assign]  # short validations
    small = (
        "--train-window 0 1 --validation-window 0 1 --test-window 0 1 --shares 0.4 1 --n-slots 3 --hidden 16 "
        "--batch-size 32 --updates-per-scene-step 1 --guided-scene-steps 20 --buffer-size 200 --checkpoint-every 40 "
        "--validation-shares 0.7 --scene-steps 120"
    )
    _typed("train", "replay-irl", "--dataset", str(TINY), "--out", "out", *small.split())


def _leaderboard() -> None:
    _draw_coarsely()
    wanted = f"--recordings {TINY} --scenarios 4 --controllers go_straight social_force --draws 1 --jobs 1 --out out"
    _typed("leaderboard", *wanted.split())


def _fetch() -> None:
    from socialnav_mj.recordings import catalogue, fetch

    files = dict.fromkeys(("a.txt", "b.txt", "c.txt"), hashlib.sha256(CONTENT).hexdigest())
    row = replace(catalogue.catalogue_row("students003"), url=os.environ[SERVER], folder="made", variants={"t": files})
    fetch.catalogue_row = lambda name: row
    _typed("data", "fetch", "students003", "--data-dir", "out")


COMMANDS = {
    "evaluate": Command(run=_evaluate),
    "evaluate in two processes": Command(run=partial(_evaluate, 2)),
    "report": Command(run=_report, prepare=_prepare_report),
    "train": Command(run=_train, imports=("socialnav_mj.cli", "socialnav_mj.learning.training", "torch._dynamo")),
    "reproduce": Command(run=_reproduce, prepare=_prepare_reproduce),
    "leaderboard": Command(run=_leaderboard),
    "fetch": Command(run=_fetch),
}


class _Dripping(BaseHTTPRequestHandler):
    """Serves CONTENT under any name, in pieces, so that there is time for a kill."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT)))
        self.end_headers()
        try:
            for start in range(0, len(CONTENT), 4096):
                self.wfile.write(CONTENT[start : start + 4096])
                time.sleep(0.03)
        except (BrokenPipeError, ConnectionResetError):
            return  # killed

    def log_message(self, format: str, *args: object) -> None:
        pass


def serve() -> str:
    """Start the source of `fetch` in a thread that lives as long as this process.

    Returns:
        Its address.
    """
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Dripping)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_port}/"


def run_what_is_told() -> None:
    """For each line NAME, tab, FOLDER: run a command in a folder, in a forked process that leads a group of its own.

    The process writes its number when it can be killed, and this one the exit code when it has ended. What the command
    says is in `FOLDER.log`.
    """
    while line := sys.stdin.readline():
        name, folder = line.rstrip("\n").split("\t")
        child = os.fork()
        if not child:
            _lead(Path(folder))
            COMMANDS[name].run()
            return
        _, status = os.waitpid(child, 0)
        _tell(os.waitstatus_to_exitcode(status))


def _lead(folder: Path) -> None:
    """Become the leader of a process group in a folder, and hear all signals, even if this runs in the background."""
    os.setsid()
    os.chdir(folder)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    _tell(os.getpid())
    log = os.open(folder.with_name(f"{folder.name}.log"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for stream, target in ((os.open(os.devnull, os.O_RDONLY), 0), (log, 1), (log, 2)):
        os.dup2(stream, target)


def _tell(number: int) -> None:
    os.write(1, f"{number}\n".encode())


if __name__ == "__main__":
    for module in sys.argv[1:]:
        importlib.import_module(module)
    run_what_is_told()
