"""A disk that is full or read-only, data that vanish: told in one message, nothing half left, the next run goes on."""

import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from socialnav_mj.episode import Episode
from socialnav_mj.evaluation import Evaluation, EvaluationError, evaluate
from socialnav_mj.files import write_whole

TINY = Path(__file__).parent / "data" / "tiny" / "tiny.txt"
COMMAND = (sys.executable, "-c", "from socialnav_mj.cli import main; main()")
WANTED = ("evaluate", "--dataset", str(TINY), "--scenarios", "1", "--draws", "1", "--controllers", "go_straight")


def typed(*args: str, bytes_a_file: int | None = None) -> "subprocess.CompletedProcess[str]":
    """A command in a process that may write files of a certain size at most."""
    limit = None if bytes_a_file is None else partial(resource.setrlimit, resource.RLIMIT_FSIZE, (bytes_a_file,) * 2)
    return subprocess.run(
        [*COMMAND, *args, "--jobs", "1"], capture_output=True, text=True, check=False, preexec_fn=limit
    )


def files_of(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def mounted(folder: Path, options: str) -> Iterator[Path]:
    """A file system of its own, where the tests may mount one."""
    folder.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    yield from mounted(tmp_path / "small", "size=64k")


@pytest.fixture
def locked_folder(tmp_path: Path) -> Iterator[Path]:
    """A folder into which nobody can write: root can into any that is not on a read-only file system."""
    if os.geteuid() == 0:
        yield from mounted(tmp_path / "locked", "ro")
        return
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o555)
    yield folder
    folder.chmod(0o755)


def test_files_that_may_not_grow_are_told_and_the_next_run_goes_on(tmp_path: Path) -> None:
    """Room for run.json, and none for an episode."""
    out = tmp_path / "out"
    failed = typed(*WANTED, "--out", str(out), bytes_a_file=4096)
    assert failed.returncode == 2 and "Traceback" not in failed.stderr and failed.stdout == ""
    assert failed.stderr.count("File too large") == 2
    assert "2 of 2 episodes failed" in re.sub(r"\s+", " ", failed.stderr)
    assert files_of(out) == {"run.json"}
    done = typed(*WANTED, "--out", str(out))
    assert done.returncode == 0 and "2/2" in done.stderr
    assert not [name for name in files_of(out) if ".part" in name]


def test_full_disk_is_told_and_leaves_nothing_half(small_disk: Path) -> None:
    filler = small_disk / "filler"
    filler.write_bytes(b"x" * 48_000)
    failed = typed(*WANTED, "--out", str(small_disk / "out"))
    assert failed.returncode == 2 and "Traceback" not in failed.stderr
    assert "No space left on device" in failed.stderr
    kept = files_of(small_disk / "out")
    assert not [name for name in kept if ".part" in name]
    for name in kept:
        if name.endswith(".npz"):
            Episode.load(small_disk / "out" / name)


def test_full_disk_keeps_the_old_file(small_disk: Path) -> None:
    path = write_whole(small_disk / "a.csv", b"old")
    with pytest.raises(OSError, match="No space left on device"):
        write_whole(path, b"x" * 100_000)
    assert path.read_bytes() == b"old" and files_of(small_disk) == {"a.csv"}


@pytest.mark.parametrize("command", [WANTED, ("report",)])
def test_read_only_folder_is_told(command: tuple[str, ...], locked_folder: Path, tmp_path: Path) -> None:
    if command == ("report",):
        list(evaluate(Evaluation(dataset=str(TINY), scenarios=("scenario_1",), draws=1), tmp_path / "run", n_jobs=1))
        if os.geteuid() == 0:
            subprocess.run(["mount", "-o", "remount,rw", locked_folder], check=True)
            shutil.copytree(tmp_path / "run", locked_folder / "out")
            subprocess.run(["mount", "-o", "remount,ro", locked_folder], check=True)
        else:
            locked_folder.chmod(0o755)
            shutil.copytree(tmp_path / "run", locked_folder / "out")
            for path in (*locked_folder.rglob("*"), locked_folder):
                path.chmod(0o555 if path.is_dir() else 0o444)
        command = ("report", str(locked_folder / "out"))
    else:
        command = (*command, "--out", str(locked_folder / "out"))
    before = files_of(locked_folder)
    failed = typed(*command)
    assert failed.returncode == 2 and "Traceback" not in failed.stderr
    assert re.search(r"error: .*(Read-only file system|Permission denied|nothing can be written to)", failed.stderr)
    assert files_of(locked_folder) == before


def test_recording_that_vanishes_is_told_for_each_episode_and_the_next_run_goes_on(tmp_path: Path) -> None:
    """Workers read it when their first episode begins, after the command has looked at it."""
    data = Path(shutil.copy(TINY, tmp_path / "there.txt"))
    wanted = Evaluation(dataset=str(data), scenarios=("scenario_1",), controllers=("go_straight",), draws=2)
    started = evaluate(wanted, tmp_path / "out", n_jobs=2)
    data.rename(tmp_path / "away.txt")
    told: list[str] = []

    def follow() -> None:
        for done in started:
            told.append(done.error or "")

    with pytest.raises(EvaluationError, match="4 of 4 episodes failed"):
        follow()
    assert len(told) == 4 and all("FileNotFoundError" in error and str(data) in error for error in told)
    assert files_of(tmp_path / "out") == {"run.json"}
    (tmp_path / "away.txt").rename(data)
    assert all(done.error is None for done in evaluate(wanted, tmp_path / "out", n_jobs=2))
    assert len(list((tmp_path / "out" / "episodes").iterdir())) == 4
