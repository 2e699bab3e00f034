"""What docs/scaling.md works its study out from: what an episode costs, and what it costs whoever asks for many.

`python benchmarks/scaling.py students003` measures on one core, in CPU seconds, and prints a line for each figure.
"""

import sys
import tempfile
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import TypeVar

from socialnav_mj import suite
from socialnav_mj.cluster import Cluster, on_cluster
from socialnav_mj.config import SHARES, Scenario
from socialnav_mj.controllers import make_controller
from socialnav_mj.environment import build_environment
from socialnav_mj.evaluation import Evaluation, evaluate, jobs_of
from socialnav_mj.processes import in_processes
from socialnav_mj.recordings import load_recording
from socialnav_mj.report import scores
from socialnav_mj.report.results import read_results
from socialnav_mj.report.scores import score
from socialnav_mj.rollout import rollout
from socialnav_mj.trace.writer import write_trace

TINY = str(Path(__file__).resolve().parents[1] / "tests" / "data" / "tiny" / "tiny.txt")
MANY = 100
"""Draws of the small crowd, with one controller and the recorded people."""
CALLS = 1000
Result = TypeVar("Result")


def timed(function: Callable[[], Result]) -> tuple[float, Result]:
    """CPU time of a call in this process [s], and what it gave."""
    begin = process_time()
    result = function()
    return process_time() - begin, result


def say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def of_an_episode(dataset: str, scenario: str, folder: Path) -> None:
    """CPU times and sizes of one episode of the potential field."""
    recording = load_recording(dataset)
    path = folder / f"{scenario}.npz"
    setting = Scenario(share=SHARES[scenario], seed=0)
    build, environment = timed(lambda: build_environment(recording, setting, robots="likely"))
    run, episode = timed(lambda: rollout(environment, make_controller("potential_field"), scenario_name=scenario))
    save, _ = timed(lambda: episode.save(path))
    trace, _ = timed(lambda: write_trace(episode, path.with_suffix(".rrd")))
    scoring, _ = timed(lambda: score(path))
    sizes = (path.stat().st_size / 1e6, path.with_suffix(".rrd").stat().st_size / 1e6)
    say(
        f"{dataset} {scenario}: {episode.n_agents} agents, {episode.time[-1]:.0f} s; CPU: scene {build:.2f} s, "
        f"episode {run:.2f} s, saving {save:.2f} s, trace {trace:.2f} s, scoring {scoring:.2f} s; "
        f"file {sizes[0]:.2f} MB, trace {sizes[1]:.2f} MB"
    )


def of_many(folder: Path) -> None:
    """What planning, resuming and reading cost for each episode, whatever is simulated."""
    many = Evaluation(dataset=TINY, scenarios=("scenario_1",), controllers=("go_straight",), draws=MANY)
    run, done = timed(lambda: len(list(evaluate(many, folder, n_jobs=1))))
    again, _ = timed(lambda: len(list(evaluate(many, folder, n_jobs=1))))
    scores.scores_folder = lambda: folder / "scores"  # not the user's own
    first, _ = timed(lambda: read_results(folder))
    tracemalloc.start()
    results = read_results(folder)
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    second, results = timed(lambda: read_results(folder))
    say(
        f"{done} episodes of three people, CPU of each: all {1e3 * run / done:.1f} ms, "
        f"resuming {1e3 * again / done:.2f} ms, scoring {1e3 * first / done:.1f} ms, "
        f"reading scores {1e3 * second / done:.2f} ms; "
        f"memory of each in the results {kept / done / 1e3:.1f} kB ({len(results.agents) / done:.1f} rows)"
    )
    large = Evaluation(scenarios=("scenario_1",), controllers=("go_straight",), draws=50_000)
    tracemalloc.start()
    planned = jobs_of(large)
    names = [job.file_name for job in planned]
    kept = tracemalloc.get_traced_memory()[0] / len(names)
    tracemalloc.stop()
    plan, _ = timed(lambda: [job.file_name for job in jobs_of(large)])
    say(f"planning: {kept:.0f} bytes and {1e6 * plan / len(names):.1f} us of CPU for each episode")
    begin = perf_counter()
    (folder / "flat").mkdir()
    for number in range(20_000):
        (folder / "flat" / f"scenario_1.go_straight.draw_{number}.npz").touch()
    making = perf_counter() - begin
    listing, found = timed(lambda: len(list((folder / "flat").glob("[!.]*.npz"))))
    each = (1e6 * listing / found, 1e6 * making / found)
    say(f"{found} files in a folder: listing {each[0]:.1f} us of CPU for each, making {each[1]:.0f} us")


@contextmanager
def own_cluster() -> Iterator[None]:
    """A Ray cluster of this machine alone."""
    with on_cluster(Cluster(address="local", folder=str(Path.cwd()), environment={}, versions={})):
        yield


def of_calls() -> None:
    """What a call that does nothing costs whoever asks for it."""
    list(in_processes(abs, [(k,) for k in range(20)], n_jobs=-1))
    begin = perf_counter()
    cpu, _ = timed(lambda: list(in_processes(abs, [(k,) for k in range(CALLS)], n_jobs=-1)))
    say(
        f"Ray: {1e3 * cpu / CALLS:.2f} ms of the driver's CPU for each call, {CALLS / (perf_counter() - begin):.0f} a s"
    )


def main(dataset: str) -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        warm = Path(folder) / "warm"
        warm.mkdir()
        of_an_episode(TINY, "scenario_1", warm)
        for scenario in suite.ALL_TASKS:
            of_an_episode(dataset, scenario, Path(folder))
        of_many(Path(folder) / "many")
    with own_cluster():
        of_calls()


if __name__ == "__main__":
    main(sys.argv[1])
