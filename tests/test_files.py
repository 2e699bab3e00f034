"""Files appear whole or not at all; folders of the installation are found from anywhere."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from socialnav_mj.files import clear_leftovers, csv_bytes, write_whole, written_whole
from socialnav_mj.resources import assets_folder, data_folder


def test_file_and_its_folders_appear_with_their_content(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "table.csv"
    assert write_whole(path, b"1,2\n") == path
    assert path.read_bytes() == b"1,2\n"
    assert [p.name for p in path.parent.iterdir()] == ["table.csv"]


def test_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    write_whole(path, b"old")

    def fail() -> None:
        with written_whole(path) as part:
            part.write_bytes(b"ne")
            assert part.suffix == ".csv" and path.read_bytes() == b"old"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def dead_process() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


WRITER = """
import os, sys, time
from socialnav_mj.files import written_whole
with written_whole(sys.argv[1]) as part:
    part.write_bytes(b"half")
    print(part.name, flush=True)
    time.sleep(600)
"""


def test_next_writer_removes_what_a_killed_one_left_and_nothing_else(tmp_path: Path) -> None:
    writer = subprocess.Popen([sys.executable, "-c", WRITER, tmp_path / "a.npz"], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    part = tmp_path / writer.stdout.readline().strip()
    others = {".hidden", ".a.part.npz", ".a.x.part.npz", f"a.{writer.pid}.part.npz", f".a.{writer.pid}.npz"}
    for name in others:
        (tmp_path / name).write_bytes(b"another's")
    clear_leftovers(tmp_path)
    assert part.name.startswith(".a.") and part.read_bytes() == b"half"  # it lives
    writer.kill()
    writer.communicate()
    assert part.exists()
    write_whole(tmp_path / "b.npz", b"whole")
    assert {path.name for path in tmp_path.iterdir()} == {"b.npz", *others}


def test_files_of_a_dead_writer_are_told_from_those_of_a_living_one_of_the_same_number(tmp_path: Path) -> None:
    """A number is given anew, most of all in containers: then the file is older than the process."""
    old, new = tmp_path / f".old.{os.getpid()}.part.csv", tmp_path / f".new.{os.getpid()}.part.csv"
    for path in (old, new):
        path.write_bytes(b"half")
    os.utime(old, (1e9, 1e9))
    clear_leftovers(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {new.name}


def test_file_that_is_being_written_elsewhere_stays(tmp_path: Path) -> None:
    """Its process is on another machine and its number is nobody's here, but the lock is held."""
    with written_whole(tmp_path / "a.csv") as part:
        elsewhere = part.rename(tmp_path / f".a.{dead_process()}.part.csv")
        clear_leftovers(tmp_path)
        assert elsewhere.exists()
        elsewhere.rename(part)
        part.write_bytes(b"whole")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_folder_that_is_not_there_has_no_leftovers(tmp_path: Path) -> None:
    clear_leftovers(tmp_path / "nowhere")
    assert not list(tmp_path.iterdir())


def test_two_writers_of_one_file_leave_the_whole_of_the_last(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    writer = subprocess.Popen([sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    theirs = tmp_path / writer.stdout.readline().strip()
    write_whole(path, b"whole")
    assert path.read_bytes() == b"whole" and theirs.read_bytes() == b"half"
    writer.kill()
    writer.communicate()


def test_folders_are_found_from_any_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("robot.xml", "pedestrian.xml", "arena.xml"):
        assert (assets_folder() / name).is_file()
    assert data_folder().is_absolute()


def test_table_is_written_with_all_digits_or_with_those_asked_for() -> None:
    rows = [{"a": 1, "b": 1.0 / 3.0, "c": "x, y"}, {"a": 2, "b": float("nan"), "c": ""}]
    assert csv_bytes(["a", "b", "c"], rows) == b'a,b,c\n1,0.3333333333333333,"x, y"\n2,,\n'
    assert csv_bytes(["a", "b", "c"], rows, number=".3g") == b'a,b,c\n1,0.333,"x, y"\n2,,\n'
    assert csv_bytes(["a", "b"], []) == b"a,b\n"
