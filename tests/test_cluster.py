"""A Ray cluster gives the bytes of one process, also if one of its machines is lost half way."""

import importlib
import os
import signal
import socket
import sys
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from types import ModuleType

import pytest

from socialnav_mj import cluster as cluster_module
from socialnav_mj.cli import main
from socialnav_mj.cli.arguments import Where
from socialnav_mj.cluster import Cluster, active_cluster, on_cluster
from socialnav_mj.evaluation import Evaluation, evaluate
from socialnav_mj.processes import STOPPING, in_processes
from socialnav_mj.provenance import PACKAGES, package_versions
from socialnav_mj.recordings import Reading

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
QUICK = ("evaluate", "--dataset", TINY, "--scenarios", "1", "--draws", "1")
MACHINE = {"num_cpus": 1, "object_store_memory": 100_000_000}
# A controller of the user's own, in the current folder; it leaves a note of which process runs which draw, and waits.
NOTED = """
import os, time
from pathlib import Path
from socialnav_mj.controllers import GoStraight

class Noted(GoStraight):
    def __init__(self):
        super().__init__(name="noted")

    def reset(self, limits, *, seed=0):
        super().reset(limits, seed=seed)
        if Path("notes").is_dir():
            Path("notes", f"{seed}.{os.getpid()}").touch()
            time.sleep(1.0)

def refuse(number):
    raise LookupError(f"nothing at {number}")
"""
WANTED = Evaluation(
    dataset="plaza",
    reading=Reading(until=5.0),
    scenarios=("scenario_1",),
    controllers=("noted:Noted",),
    draws=4,
    seed=1000,
)


def fails(capsys, *words):
    with pytest.raises(SystemExit) as caught:
        main([*words])
    assert caught.value.code == 2
    return " ".join(capsys.readouterr().err.split())


def test_without_ray_the_extra_is_named_before_anything_runs(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ray", None)
    assert "needs the extra 'cluster' (pip install 'socialnav-mj[cluster]')" in fails(
        capsys, *QUICK, "--backend", "ray"
    )
    assert not (tmp_path / "runs").exists()


def test_address_without_ray_is_refused(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "--address h:1 is given without --backend ray" in fails(capsys, *QUICK, "--address", "h:1")
    assert "invalid choice 'dask'" in fails(capsys, *QUICK, "--backend", "dask")
    with Where().used():
        assert active_cluster() is None


def test_address_where_nobody_listens_is_told_at_once(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", ModuleType("ray"))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    nobody = Cluster(address=address, folder=".", environment={}, versions={})
    with pytest.raises(ConnectionError, match=f"no Ray cluster answers at '{address}'"), on_cluster(nobody):
        pass


def test_machine_with_another_file_system_or_other_packages_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SOCIALNAV_MJ_DATA", raising=False)
    monkeypatch.setattr(sys, "path", [*sys.path])
    own = {"folder": str(tmp_path), "environment": {"SOCIALNAV_MJ_DATA": "there"}}
    with pytest.raises(RuntimeError, match=r"has no folder .*/nowhere; a cluster's machines have to share a file sys"):
        cluster_module._settle(Cluster(folder=str(tmp_path / "nowhere"), environment={}, versions={}))
    with pytest.raises(RuntimeError, match=r"has mujoco \d\S+, but 1\.0 is asked for"):
        cluster_module._settle(Cluster(**own, versions={"mujoco": "1.0"}))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    cluster_module._settle(Cluster(**own, versions=package_versions((*PACKAGES, "none such"))))
    assert Path.cwd() == tmp_path and os.environ["SOCIALNAV_MJ_DATA"] == "there" and sys.path[-1] == str(tmp_path)


@contextmanager
def machines(folder, monkeypatch):
    """A head and, on this machine as well, a second one that can be lost; and the cluster as a command sees it."""
    pytest.importorskip("ray", reason="needs the extra `cluster`")
    monkeypatch.setenv("RAY_worker_niceness", "0")  # 15 by default: beside other work it would take for ever
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    from ray.cluster_utils import Cluster as Machines

    both = Machines(initialize_head=True, head_node_args={**MACHINE, "include_dashboard": False})
    try:
        second = both.add_node(**MACHINE)
        seen = Cluster(
            address=both.address, folder=str(folder), environment={}, versions=package_versions((*PACKAGES, "ray"))
        )
        handlers = [signal.getsignal(number) for number in STOPPING]
        with on_cluster(seen):
            assert [signal.getsignal(number) for number in STOPPING] == handlers  # a command's own hear Ctrl-C and kill
            yield both, second
    finally:
        both.shutdown()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # Ray's machines have put theirs there


def contents(folder):
    return {path.name: path.read_bytes() for path in (folder / "episodes").iterdir()}


def parent(process):
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return None


def lose(both, second, notes, lost):
    """Lose the second machine as soon as an episode has begun there."""
    (raylet,) = second.all_processes["raylet"]
    while not lost:
        lost += [path.name for path in notes.iterdir() if parent(path.name.split(".")[1]) == raylet.process.pid]
        time.sleep(0.02)
    both.remove_node(second, allow_graceful=False)


@pytest.mark.slow
def test_run_with_a_machine_lost_half_way_equals_the_serial_run_byte_for_byte(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    (tmp_path / "noted.py").write_text(NOTED)
    assert len(list(evaluate(WANTED, "serial", n_jobs=1))) == 8
    with machines(tmp_path, monkeypatch) as (both, second):
        episodes = evaluate(WANTED, "cluster", n_jobs=-1)
        notes, lost = tmp_path / "notes", []
        notes.mkdir()
        watch = Thread(target=lose, args=(both, second, notes, lost), daemon=True)
        watch.start()
        done = list(episodes)
        watch.join(60.0)
        with pytest.raises(LookupError, match="nothing at 7"):
            list(in_processes(importlib.import_module("noted").refuse, [(7,)], n_jobs=1))
    assert capsys.readouterr().out == ""  # which is for results
    assert len(done) == 8 and all(own.error is None for own in done)
    assert contents(tmp_path / "cluster") == contents(tmp_path / "serial")
    (name,) = lost
    begun = Counter(path.name.split(".")[0] for path in notes.iterdir())
    assert begun == {str(draw): 1 for draw in range(1000, 1004)} | {name.split(".")[0]: 2}
