"""Counts the work of an episode: calls, memory, contacts and slots for a control step, bytes of a trace for a second.

Counts are the same on a busy machine and an idle one. `test_counts.py` holds them below `tests/data/counts.json`; after
a change that is meant to cost more, or that saves something, run `python tests/counts.py`, which writes that file anew.
"""

import gc
import json
import sys
import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

from socialnav_mj.config import SHARES, Scenario
from socialnav_mj.controllers import make_controller
from socialnav_mj.environment import build_environment
from socialnav_mj.recordings import load_recording
from socialnav_mj.rollout import rollout
from socialnav_mj.trace.writer import write_trace

FILE = Path(__file__).parent / "data" / "counts.json"
SLACK = 1.15
"""A count may be this many times the stored one: Python 3.11 and 3.12 and other numpys differ by less."""
UNTIL = {"scenario_1": 20.0, "scenario_4": 10.0}
"""Length of the episode [s]: as long as it takes until robots touch people and each other."""
CONTROLLER = "potential_field"


class Watched:
    """A controller that has a look taken before each of its actions."""

    def __init__(self, look: Callable[[], tuple[float, ...]]) -> None:
        """Keep the look.

        Args:
            look: Its numbers are kept, one row a control step.
        """
        self._inner = make_controller(CONTROLLER)
        self.name = self._inner.name
        self._look = look
        self.rows: list[tuple[float, ...]] = []

    def reset(self, limits: Any, *, seed: int = 0) -> None:
        self._inner.reset(limits, seed=seed)

    def act(self, observation: Any) -> Any:
        self.rows.append(self._look())
        return self._inner.act(observation)

    def each_step(self, column: int) -> float:
        """How much a number that counts up grows in a control step, the mean."""
        return (self.rows[-1][column] - self.rows[0][column]) / (len(self.rows) - 1)

    def mean(self, column: int) -> float:
        """Mean of a number over control steps."""
        return sum(row[column] for row in self.rows) / len(self.rows)


def count(scenario: str) -> dict[str, float]:
    """Work of one short episode on plaza, after another one has warmed everything up.

    Args:
        scenario: Name of a task.

    Returns:
        What is counted: how many.
    """
    recording = load_recording("plaza")
    setting = Scenario(share=SHARES[scenario], seed=0)
    environment = build_environment(recording, setting, time_limit=UNTIL[scenario], robots="likely")
    rollout(environment, make_controller(CONTROLLER), scenario_name=scenario)
    physics = environment.physics
    scene = Watched(lambda: (physics.data.ncon, physics.model.nu // 2, physics.n_agents))
    episode = rollout(environment, scene, scenario_name=scenario)
    calls = _calls(environment)
    memory = _memory(environment)
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.rrd"
        write_trace(episode, trace)
        trace_bytes = trace.stat().st_size
    return {
        "calls of Python functions per control step": calls.each_step(0),
        "calls of C functions per control step": calls.each_step(1),
        "bytes that a control step holds at most, beside what it keeps": memory.mean(1),
        "bytes that are kept per control step": memory.each_step(0),
        "contacts per control step": scene.mean(0),
        "robots in the scene per control step": scene.mean(1),
        "slots per control step": scene.mean(2),
        "bytes of a trace per simulated second": trace_bytes / float(episode.time[-1]),
    }


def _calls(environment: Any) -> Watched:
    """Calls of Python and of C functions since the start."""
    seen = {"call": 0, "c_call": 0}

    def note(_frame: Any, event: str, _argument: Any) -> None:
        if event in seen:
            seen[event] += 1

    watched = Watched(lambda: (seen["call"], seen["c_call"]))
    sys.setprofile(note)
    try:
        rollout(environment, watched)
    finally:
        sys.setprofile(None)
    return watched


def _memory(environment: Any) -> Watched:
    """Bytes that are allocated, and how far they rose above what the control step before began with."""
    before = 0

    def look() -> tuple[float, ...]:
        nonlocal before
        now, peak = tracemalloc.get_traced_memory()
        risen = peak - max(before, now)
        before = now
        tracemalloc.reset_peak()
        return now, risen

    watched = Watched(look)
    tracemalloc.start()
    try:
        rollout(environment, watched)
    finally:
        tracemalloc.stop()
    watched.rows = watched.rows[1:]  # what building the first observation took is no control step's
    return watched


def count_all() -> dict[str, dict[str, float]]:
    """Counts of every scenario that is counted, in this process and with nothing collected meanwhile."""
    gc.disable()
    return {scenario: count(scenario) for scenario in UNTIL}


def grown(now: dict[str, dict[str, float]], stored: dict[str, dict[str, float]]) -> list[str]:
    """What is above the stored counts by more than the slack.

    Args:
        now: As `count_all` gives them.
        stored: As the file has them.

    Returns:
        A line for each, with what to do.
    """
    lines = []
    for scenario, counts in now.items():
        for name, value in counts.items():
            bound = SLACK * stored[scenario][name]
            if value > bound:
                lines.append(
                    f"{scenario}: {name} grew from {stored[scenario][name]:.1f} to {value:.1f} (allowed: {bound:.1f}); "
                    f"make it less, or, if it is worth it, write tests/data/counts.json anew: python tests/counts.py"
                )
    return lines


if __name__ == "__main__":
    if sys.argv[1:] == ["--print"]:
        sys.stdout.write(json.dumps(count_all()))
    else:
        rounded = {name: {k: round(v, 1) for k, v in own.items()} for name, own in count_all().items()}
        FILE.write_text(json.dumps(rounded, indent=1) + "\n", encoding="utf-8")
