"""Commands that `tests.kill` kills, small enough that one takes a few seconds, each as a program of its own.

`python kill_commands.py NAME` runs one in the current folder, which holds its inputs.
"""

import hashlib
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

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


def _typed(*arguments: str) -> None:
    from socialnav_mj.cli import main

    sys.argv = ["socialnav-mj", *arguments]
    main([*arguments])


def _evaluate() -> None:
    _typed(*f"evaluate --dataset {TINY} --scenarios 4 --draws 2 --jobs 2 --out out".split())


def _report() -> None:
    _typed("report", "out", "--jobs", "2")


def _prepare_report(folder: Path) -> None:
    from socialnav_mj.evaluation import Evaluation, evaluate

    evaluation = Evaluation(dataset=str(TINY), scenarios=("scenario_4",), draws=2)
    list(evaluate(evaluation, folder / "out", command="as typed", n_jobs=1))


def _reproduce() -> None:
    from socialnav_mj.report import style

    style.DOTS_PER_INCH = 40  # not what is tested, and takes its time
    policies = [f"policies/p{seed}.safetensors" for seed in (0, 1)]
    _typed(*f"reproduce --dataset {TINY} --scenarios 1 4 --draws 1 --jobs 2 --out out --policies".split(), *policies)


def _prepare_reproduce(folder: Path) -> None:
    (folder / "policies").mkdir()
    for seed in (0, 1):
        write_toy(folder / "policies", f"p{seed}", seed=seed)


def _train() -> None:
    from socialnav_mj.learning import config as module

    small = {
        "train_window": (0.0, 1.0),
        "validation_window": (0.0, 1.0),
        "test_window": (0.0, 1.0),
        "shares": (0.4, 1.0),
        "n_slots": 3,
        "hidden": (16,),
        "batch_size": 32,
        "updates_per_scene_step": 1,
        "guided_scene_steps": 40,
        "buffer_size": 400,
        "checkpoint_every": 60,
        "validation_shares": (0.7,),
    }
    whole = module.TrainingConfig

    def made(**given: Any) -> Any:
        return whole(**{**given, **small})

    made.scene_steps = 200  # type: ignore[attr-defined]
    module.TrainingConfig = made
    _typed("train", "replay-irl", "--dataset", str(TINY), "--out", "out")


def _fetch() -> None:
    from socialnav_mj.recordings import catalogue, fetch

    files = dict.fromkeys(("a.txt", "b.txt", "c.txt"), hashlib.sha256(CONTENT).hexdigest())
    row = replace(catalogue.catalogue_row("students003"), url=os.environ[SERVER], folder="made", variants={"t": files})
    fetch.catalogue_row = lambda name: row
    _typed("data", "fetch", "students003", "--data-dir", "out")


COMMANDS = {
    "evaluate": Command(run=_evaluate),
    "report": Command(run=_report, prepare=_prepare_report),
    "train": Command(run=_train),
    "reproduce": Command(run=_reproduce, prepare=_prepare_reproduce),
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


if __name__ == "__main__":
    COMMANDS[sys.argv[1]].run()
