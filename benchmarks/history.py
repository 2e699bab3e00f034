"""What an episode cost at several commits of this repository, side by side in one run.

`python benchmarks/history.py 54f73fd c9e2eaa HEAD` gives each commit a checkout of its own, runs the same episodes in
each in turn, every one in a fresh process, and prints CPU times, real-time factors and whether all agents went the
same way to the bit.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
EPISODE = """
import hashlib, inspect, json, sys, time
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import make_controller
from socialnav_mj.environment import build_environment
from socialnav_mj.recordings import load_recording
from socialnav_mj.rollout import rollout

dataset, share, controller, seed = json.loads(sys.argv[1])
recording = load_recording(dataset)
few = {"robots": "likely"} if "robots" in inspect.signature(build_environment).parameters else {}
begin = time.process_time()
environment = build_environment(recording, Scenario(share=share, seed=seed), **few)
built = time.process_time()
episode = rollout(environment, make_controller(controller))
end = time.process_time()
went = hashlib.sha256(episode.agent_position.tobytes()).hexdigest()
print(json.dumps({"build": built - begin, "run": end - built, "time": float(episode.time[-1]), "went": went}))
"""


def measured(checkout: Path, *asked: Any) -> dict[str, Any]:
    """One episode with the code of a checkout, in a process of its own."""
    command = [sys.executable, "-c", EPISODE, json.dumps(asked)]
    environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=True)
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def main() -> None:
    """Measure, and print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commits", nargs="+", help="oldest first; ratios are to the first")
    parser.add_argument("--dataset", default="students003")
    parser.add_argument("--controller", default="potential_field")
    parser.add_argument("--shares", type=float, nargs="+", default=[0.1, 0.9])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repetitions", type=int, default=3)
    options = parser.parse_args()
    found: dict[tuple[str, float], list[dict[str, Any]]] = defaultdict(list)
    git = ["git", "-C", str(ROOT)]
    with tempfile.TemporaryDirectory() as folder:
        try:
            for commit in options.commits:
                checkout = Path(folder) / commit
                subprocess.run([*git, "worktree", "add", "-q", "--detach", str(checkout), commit], check=True)
            for _ in range(options.repetitions):
                for share in options.shares:
                    for commit in options.commits:
                        one = measured(Path(folder) / commit, options.dataset, share, options.controller, options.seed)
                        found[commit, share].append(one)
        finally:
            for commit in options.commits:
                subprocess.run([*git, "worktree", "remove", "--force", str(Path(folder) / commit)], check=False)
    lines = [
        "| commit | share | episode [s] | ratio | x real time | scene [s] | same way |",
        "|---|---|---|---|---|---|---|",
    ]
    for share in options.shares:
        first = found[options.commits[0], share]
        for commit in options.commits:
            own = found[commit, share]
            run = median(one["run"] for one in own)
            ratio = median(one["run"] / other["run"] for one, other in zip(own, first, strict=True))
            same = "yes" if {one["went"] for one in (*own, *first)} == {first[0]["went"]} else "no"
            build = median(one["build"] for one in own)
            cells = (f"`{commit}`", f"{share:g}", f"{run:.2f}", f"{ratio:.2f}", f"{own[0]['time'] / run:.0f}")
            lines.append(f"| {' | '.join((*cells, f'{build:.2f}', same))} |")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
