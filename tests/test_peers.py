"""The comparison with other simulators runs as far as it needs none of them, and names who is in it."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

PEERS = Path(__file__).resolve().parents[1] / "benchmarks" / "peers"


def run(*arguments):
    command = [sys.executable, str(PEERS / "run.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_every_peer_has_its_script_and_exact_packages():
    peers = tomllib.loads((PEERS / "peers.toml").read_text(encoding="utf-8"))
    assert len(peers) >= 7
    for peer in peers.values():
        assert (PEERS / peer["script"]).is_file() and peer["simulates"] and peer["title"]
        assert all("==" in requirement for requirement in peer["requirements"])


def test_ours_are_timed_and_shown(tmp_path):
    only = ["socialnav_mj", "socialnav_mj_unicycle"]
    done = run("--only", *only, "--agents", 2, 4, "--seconds", 0.4, "--repetitions", 1, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "peers.json").read_text(encoding="utf-8"))["rows"]
    assert [(row["peer"], row["agents"]) for row in rows] == [(name, n) for n in (2, 4) for name in only]
    for row in rows:
        assert (row["steps"], row["timestep"]) == (40, pytest.approx(0.01)) and row["cpu"] > 0.0
        assert row["agent_seconds_per_second"] == pytest.approx(0.4 * row["agents"] / row["cpu"])
    assert (tmp_path / "peers.md").read_text(encoding="utf-8").count("\n") == 2 + len(only)
    assert (tmp_path / "peers.png").stat().st_size > 10_000


def test_unknown_peers_are_named_with_those_there_are(tmp_path):
    done = run("--only", "gazebo", "--out", tmp_path)
    assert done.returncode == 2 and "unknown peer 'gazebo'; available: socialnav_mj," in done.stderr
