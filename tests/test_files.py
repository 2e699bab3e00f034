"""Files appear whole or not at all; folders of the installation are found from anywhere."""

from pathlib import Path

import pytest

from socialnav_mj.files import write_whole, written_whole
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


def test_folders_are_found_from_any_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("robot.xml", "pedestrian.xml", "arena.xml"):
        assert (assets_folder() / name).is_file()
    assert data_folder().is_absolute()
