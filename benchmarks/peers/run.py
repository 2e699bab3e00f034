"""What an agent's step costs here and elsewhere: every simulator in an environment of its own, all in one run.

    python benchmarks/peers/run.py --out runs/peers

Makes an environment for each peer of peers.toml under --environments, runs all of them in turn, repetition after
repetition, and writes peers.json, a table and a figure. Our own figures are taken with the Python that runs this.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path
from statistics import median
from typing import Any

import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent


def interpreter(name: str, requirements: list[str], folder: Path) -> Path:
    """Python of a peer's environment, which is made if it is not there.

    Args:
        name: Of the peer.
        requirements: As pip takes them; none for this very Python.
        folder: Of all environments.

    Returns:
        Path of the executable.
    """
    if not requirements:
        return Path(sys.executable)
    python = folder / name / "bin" / "python"
    stamp = folder / name / "requirements.txt"
    if not stamp.is_file() or stamp.read_text(encoding="utf-8").split() != requirements:
        print(f"installing {', '.join(requirements)}", flush=True)
        venv.create(folder / name, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *requirements], check=True)
        stamp.write_text("\n".join(requirements) + "\n", encoding="utf-8")
    return python


def run(python: Path, peer: dict[str, Any], *, agents: int, seconds: float) -> dict[str, float]:
    """One simulation in a process of its own.

    Args:
        python: Of the peer.
        peer: Its table in peers.toml.
        agents: How many.
        seconds: Simulated time [s].

    Returns:
        What the script prints, and agent-steps and simulated agent-seconds per second of CPU.

    Raises:
        RuntimeError: If it fails; with the end of what it wrote.
    """
    command = [python, HERE / peer["script"], *peer.get("arguments", [])]
    command += ["--agents", str(agents), "--seconds", str(seconds)]
    with tempfile.TemporaryDirectory() as folder:  # some leave a log where they run
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{peer['title']} with {agents} agents failed:\n{done.stderr[-2000:]}")
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    result["agent_steps_per_second"] = agents * result["steps"] / result["cpu"]
    result["agent_seconds_per_second"] = result["agent_steps_per_second"] * result["timestep"]
    return result


def table(rows: list[dict[str, Any]], peers: dict[str, Any], counts: list[int]) -> str:
    """Medians as Markdown.

    Args:
        rows: One for each peer, count and repetition.
        peers: Of peers.toml.
        counts: Agents.

    Returns:
        A row for each peer; agent-steps and simulated agent-seconds per second of CPU, in thousands and as they are.
    """
    heads = ["simulator", "step [s]", *(f"{n} agents" for n in counts), "simulates"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for name, peer in peers.items():
        cells = []
        for count in counts:
            own = [row for row in rows if row["peer"] == name and row["agents"] == count]
            steps = median(row["agent_steps_per_second"] for row in own)
            seconds = median(row["agent_seconds_per_second"] for row in own)
            cells.append(f"{steps / 1e3:.3g} k / {seconds:.3g}")
        timestep = next(row["timestep"] for row in rows if row["peer"] == name)
        lines.append("| " + " | ".join([peer["title"], f"{timestep:g}", *cells, peer["simulates"]]) + " |")
    return "\n".join(lines) + "\n"


def draw(rows: list[dict[str, Any]], peers: dict[str, Any], counts: list[int], path: Path) -> None:
    """Simulated agent-seconds per second of CPU over the number of agents, both on logarithmic axes.

    Args:
        rows: As for `table`.
        peers: Of peers.toml.
        counts: Agents.
        path: Of the picture.
    """
    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    medians = {
        name: [
            median(r["agent_seconds_per_second"] for r in rows if r["peer"] == name and r["agents"] == count)
            for count in counts
        ]
        for name in peers
    }
    lowest = 0.0
    for name in sorted(peers, key=lambda name: medians[name][-1]):
        values, ours = medians[name], name.startswith("socialnav_mj")
        (line,) = axes.plot(counts, values, marker="o", linewidth=2.4 if ours else 1.2, alpha=1.0 if ours else 0.8)
        lowest = max(values[-1], 1.25 * lowest)  # names one above the other
        axes.annotate(
            peers[name]["title"], (counts[-1], lowest), (6, 0), textcoords="offset points", va="center", fontsize=8,
            color=line.get_color(),
        )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="agents", ylabel="simulated agent-seconds per second of CPU")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.margins(x=0.05)
    axes.set_xlim(right=counts[-1] * 4.0)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Run all of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, nargs="+", default=[5, 20, 50, 100])
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated time of each run")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--environments", type=Path, default=Path.home() / ".cache" / "socialnav_mj_peers")
    parser.add_argument("--only", nargs="+", default=[], help="names in peers.toml; all by default")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    peers = tomllib.loads((HERE / "peers.toml").read_text(encoding="utf-8"))
    if unknown := sorted({*options.only} - {*peers}):
        parser.error(f"unknown peer {unknown[0]!r}; available: {', '.join(peers)}")
    peers = {name: peer for name, peer in peers.items() if not options.only or name in options.only}
    pythons = {name: interpreter(name, peer["requirements"], options.environments) for name, peer in peers.items()}
    rows = []
    for repetition in range(options.repetitions):
        for count in options.agents:
            for name, peer in peers.items():
                result = run(pythons[name], peer, agents=count, seconds=options.seconds)
                rows.append({"peer": name, "repetition": repetition, **result})
                print(f"{peer['title']}, {count} agents: {result['agent_seconds_per_second']:.4g}", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "peers.json").write_text(
        json.dumps({"peers": peers, "rows": rows}, indent=1) + "\n", encoding="utf-8"
    )
    (options.out / "peers.md").write_text(table(rows, peers, options.agents), encoding="utf-8")
    draw(rows, peers, options.agents, options.out / "peers.png")


if __name__ == "__main__":
    main()
