"""Known recordings: lookup, checksums, download."""

import dataclasses
import hashlib
import http.server
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.recordings import catalogue as module
from socialnav_mj.recordings import fetch as fetch_module
from socialnav_mj.recordings import load_recording
from socialnav_mj.recordings.catalogue import UNKNOWN, CatalogueRow, catalogue, catalogue_row, read_catalogue
from socialnav_mj.recordings.fetch import FetchError, fetch, fetch_row
from socialnav_mj.recordings.fields import FormatError
from socialnav_mj.recordings.known import crowd_of, is_simulated, unverified
from socialnav_mj.resources import data_folder

UNVERIFIED = {
    "zara03": {"annotation.vsp", "H.txt"},
    "students001": {"annotation.vsp"},
    "eth": {"obsmat.txt"},
    "hotel": {"obsmat.txt"},
}
"""Recording: files whose sha256 could not be had."""
CONTENT = b"0 1 0 0\n10 1 1 0\n" * 1000
needs_ucy = pytest.mark.skipif(
    not os.environ.get("SOCIALNAV_MJ_DATA"), reason="needs the UCY recordings: SOCIALNAV_MJ_DATA is not set"
)


class Handler(http.server.BaseHTTPRequestHandler):
    """Serves CONTENT; `cut.txt` breaks off half-way, anything below `/none/` does not exist."""

    def do_GET(self) -> None:
        if self.path.startswith("/none/"):
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT)))
        self.end_headers()
        self.wfile.write(CONTENT[: len(CONTENT) // 2] if self.path.endswith("cut.txt") else CONTENT)

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{running.server_port}/"
        running.shutdown()
        thread.join()


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")


def row_of(url: str, *names: str, digest: str = hashlib.sha256(CONTENT).hexdigest()) -> CatalogueRow:
    files = dict.fromkeys(names or ("a.txt",), digest)
    return dataclasses.replace(catalogue_row("students003"), url=url, folder="made", variants={"text": files})


def files_below(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_catalogue_says_all_that_is_needed_of_each_recording() -> None:
    assert {"plaza", "students003", "zara01", "zara02"} | UNVERIFIED.keys() == set(catalogue())
    assert {name for name, row in catalogue().items() if row.simulated} == {"plaza"}
    for row in catalogue().values():
        assert row.source and row.licence and row.scale and row.frame_rate > 0.0 and row.axis_order in ("xy", "yx")
        assert row.url is None or (row.url.startswith("https://") and row.url.endswith("/"))
        for files in row.variants.values():
            unknown = {file for file, digest in files.items() if digest == UNKNOWN}
            assert all(len(digest) == 64 for digest in files.values() if digest != UNKNOWN)
            assert unknown == UNVERIFIED.get(row.name, set())
    assert (catalogue_row("eth").frame_rate, catalogue_row("hotel").frame_rate) == (15.0, 25.0)
    # The homography of students001 is that of students003, from its folder.
    one, three = catalogue_row("students001"), catalogue_row("students003")
    assert (
        one.address("H.txt") == three.address("H.txt") and one.address("annotation.vsp") == f"{one.url}annotation.vsp"
    )
    assert one.variants["vsp"]["H.txt"] == three.variants["vsp"]["H.txt"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "frame_rate = 25.0",
            "frame_rate = nan",
            "frame_rate of the recording 'plaza' is not allowed; expected a number",
        ),
        ("frame_rate = 25.0", "frame_rate = true", "frame_rate of the recording"),
        (
            'folder = "plaza"',
            'folder = "../elsewhere"',
            "folder of the recording 'plaza' is not allowed; expected a path",
        ),
        ('folder = "plaza"', 'folder = "/etc"', "folder of the recording 'plaza' is not allowed"),
        ('folder = "plaza"', 'url = "http://a/"\nfolder = "plaza"', "url of the recording .* expected https://"),
        (
            'axis_order = "xy"',
            'axis_order = ["xy"]',
            "axis_order of the recording 'plaza' is not allowed; expected xy or",
        ),
        ('axis_order = "xy"', "", "the set of fields of the recording 'plaza' is not allowed; expected axis_order, "),
        (
            "[plaza.variants.vsp]",
            "[plaza.variants.csv]",
            "variant csv of the recording 'plaza' is not allowed; expected v",
        ),
        (
            '"H.txt" = "60e5',
            '"../H.txt" = "60e5',
            "vsp of the recording 'plaza' is not allowed; expected file names with",
        ),
        ('"H.txt" = "60e5', '"H.txt" = "60eX', "vsp of the recording 'plaza' is not allowed"),
        ("[plaza]", "[plaza", r"no TOML \(Expected"),
        ("frame_rate = 25.0", "frame_rate = " + "9" * 5000, r"no TOML \(Exceeds the limit"),
        ("frame_rate = 25.0", "frame_rate = " + "[" * 10_000, r"no TOML \(maximum recursion"),
    ],
)
def test_catalogue_with_a_wrong_field_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = (data_folder() / "catalogue.toml").read_text()
    text = text[text.index("[plaza]") :]
    assert old in text
    path = tmp_path / "catalogue.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(FormatError, match=message):
        read_catalogue(path)


def test_unknown_names_list_what_exists() -> None:
    with pytest.raises(ValueError, match=r"unknown recording 'zara3'; available: .*students003, zara01"):
        catalogue_row("zara3")
    with pytest.raises(FileNotFoundError, match=r"no recording 'zara3': it is neither in the catalogue .* nor a file"):
        load_recording("zara3")


def test_missing_recording_says_where_it_looked_and_what_helps(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("SOCIALNAV_MJ_DATA", str(tmp_path / "b"))
    monkeypatch.setattr(module.pooch, "os_cache", lambda name: tmp_path / "c")
    with pytest.raises(FileNotFoundError) as error:
        load_recording("students003", data_dir=tmp_path / "a")
    message = str(error.value)
    assert f"{tmp_path / 'a'}, {tmp_path / 'b'}, {tmp_path / 'c'}" in message
    assert "socialnav-mj data fetch students003" in message and "export SOCIALNAV_MJ_DATA=" in message


def test_lookup_prefers_the_given_directory_then_the_variable_then_the_cache(tmp_path: Path, monkeypatch) -> None:
    row = row_of("http://127.0.0.1/")
    monkeypatch.setattr(module, "catalogue", lambda: {"made": dataclasses.replace(row, name="made")})
    monkeypatch.setattr(module.pooch, "os_cache", lambda name: tmp_path / "c")
    monkeypatch.setenv("SOCIALNAV_MJ_DATA", str(tmp_path / "b"))
    used = []
    monkeypatch.setattr(module, "_verify", lambda row, variant, files: used.append(files[0].parents[1].name))
    for place in "cba":
        (tmp_path / place / "made").mkdir(parents=True)
        (tmp_path / place / "made" / "a.txt").write_text("0 1 0 0\n10 1 1 0\n")
        load_recording("made", data_dir=tmp_path / "a")
    assert used == ["c", "b", "a"]


def test_changed_file_is_refused_with_both_sums(tmp_path: Path) -> None:
    folder = tmp_path / "ucy" / "students03"
    folder.mkdir(parents=True)
    for name in ("annotation.vsp", "H.txt"):
        (folder / name).write_text("changed")
    with pytest.raises(ValueError) as error:
        load_recording("students003", data_dir=tmp_path)
    assert str(folder / "annotation.vsp") in str(error.value)
    assert hashlib.sha256(b"changed").hexdigest() in str(error.value)
    assert catalogue_row("students003").variants["vsp"]["annotation.vsp"] in str(error.value)


def test_unknown_variant_lists_what_exists() -> None:
    with pytest.raises(ValueError, match="'students003' has no variant 'text'; available: vsp, obsmat"):
        load_recording("students003", variant="text")


def test_fetch_downloads_reports_progress_and_keeps_what_is_right(server: str, tmp_path: Path) -> None:
    calls: list[tuple[str, int, int]] = []
    row = row_of(server, "a.txt", "b.txt")
    paths = fetch_row(row, tmp_path, progress=lambda *call: calls.append(call))
    assert paths == (tmp_path / "made" / "a.txt", tmp_path / "made" / "b.txt")
    assert all(path.read_bytes() == CONTENT for path in paths)
    assert {call[0] for call in calls} == {"a.txt", "b.txt"}
    assert all(0 < done <= total == len(CONTENT) for _, done, total in calls)
    assert calls[-1] == ("b.txt", len(CONTENT), len(CONTENT))
    calls.clear()
    assert fetch_row(row, tmp_path, progress=lambda *call: calls.append(call)) == paths
    assert not calls


def test_fetch_is_killed_and_the_next_one_clears_up(server: str, tmp_path: Path) -> None:
    """Killed between the download and its check; what is left is known as what it is."""
    begun = """
import os, signal, sys
from pathlib import Path
from socialnav_mj.recordings import fetch
from test_catalogue import row_of
fetch.hash_matches = lambda *args, **kwargs: os.kill(os.getpid(), signal.SIGKILL)
fetch.fetch_row(row_of(sys.argv[1]), Path(sys.argv[2]))
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path])}
    done = subprocess.run([sys.executable, "-c", begun, server, str(tmp_path)], env=environment, check=False)
    assert done.returncode == -signal.SIGKILL
    (left,) = files_below(tmp_path)
    assert left.read_bytes() == CONTENT and left.name != "a.txt"
    (path,) = fetch_row(row_of(server), tmp_path)
    assert files_below(tmp_path) == [path]


def test_fetch_replaces_a_damaged_file(server: str, tmp_path: Path) -> None:
    path = tmp_path / "made" / "a.txt"
    path.parent.mkdir()
    path.write_bytes(b"damaged")
    fetch_row(row_of(server), tmp_path)
    assert path.read_bytes() == CONTENT


def test_wrong_checksum_is_an_error_and_leaves_nothing_behind(server: str, tmp_path: Path) -> None:
    with pytest.raises(FetchError) as error:
        fetch_row(row_of(server, digest="0" * 64), tmp_path)
    message = str(error.value)
    assert f"{server}a.txt" in message and "0" * 64 in message and hashlib.sha256(CONTENT).hexdigest() in message
    assert files_below(tmp_path) == []


@pytest.mark.parametrize("where", ["cut.txt", "none/a.txt"])
def test_broken_download_is_a_clear_error_and_leaves_nothing_behind(server: str, where: str, tmp_path: Path) -> None:
    folder, _, name = where.rpartition("/")
    url = f"{server}{folder}/" if folder else server
    with pytest.raises(FetchError, match=f"could not fetch .*{name} of recording 'students003' from {url}{name}: "):
        fetch_row(row_of(url, name), tmp_path)
    assert files_below(tmp_path) == []


def test_unreachable_server_is_a_clear_error_and_leaves_nothing_behind(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}/"
    with pytest.raises(FetchError, match=r"could not fetch .*refused"):
        fetch_row(row_of(url), tmp_path)
    assert files_below(tmp_path) == []


def test_fetch_of_an_unknown_recording_lists_what_exists(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown recording 'zara3'; available: "):
        fetch("zara3", data_dir=tmp_path)


@needs_ucy
@pytest.mark.parametrize(
    ("name", "variant", "people", "extent"),
    [
        ("students003", "vsp", 434, (15.5, 13.9)),
        ("students003", "obsmat", 428, (17.6, 17.7)),
        ("zara01", "vsp", 148, (13.7, 15.8)),
        ("zara01", "obsmat", 148, (13.7, 15.7)),
        ("zara02", "vsp", 204, (14.9, 16.1)),
        ("zara02", "obsmat", 204, (14.8, 15.9)),
    ],
)
def test_ucy_recordings_load_and_have_their_known_size(name: str, variant, people: int, extent) -> None:
    recording = load_recording(name, variant=variant)
    position = np.concatenate(recording.positions)
    assert (recording.name, recording.variant, recording.n_people) == (name, variant, people)
    assert tuple(np.ptp(position, axis=0)) == pytest.approx(extent, abs=0.06)


@needs_ucy
def test_folder_given_by_path_is_known_by_its_checksum() -> None:
    folder = Path(os.environ["SOCIALNAV_MJ_DATA"]) / "ucy" / "zara01"
    by_path, by_name = load_recording(folder), load_recording("zara01")
    assert by_path.checksum == by_name.checksum
    assert (by_path.end == by_name.end).all()


def test_files_without_a_known_checksum_are_never_taken_silently(
    server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    row = dataclasses.replace(row_of(server, digest=UNKNOWN), name="made", frame_rate=25.0)
    known = hashlib.sha256(CONTENT).hexdigest()
    elsewhere = dataclasses.replace(row, url="https://nowhere.invalid/", elsewhere={"a.txt": f"{server}there/a.txt"})
    for own in (module, fetch_module):
        monkeypatch.setattr(own, "catalogue", lambda: {"made": elsewhere})
    with pytest.raises(FetchError, match=r"knows no sha256 of a\.txt of recording 'made'.*--accept-unverified"):
        fetch("made", data_dir=tmp_path)
    assert not files_below(tmp_path)
    (path,) = fetch("made", data_dir=tmp_path, accept_unverified=True)
    path.write_bytes(b"0 1 0 0\n10 1 1 0\n")
    again = hashlib.sha256(path.read_bytes()).hexdigest()
    assert fetch("made", data_dir=tmp_path, accept_unverified=True) == (path,)  # what is there is kept
    assert load_recording("made", data_dir=tmp_path).checksum == again != known
    (told,) = [record.getMessage() for record in caplog.records if "not verified" in record.getMessage()]
    assert "the catalogue knows no sha256 of a.txt" in told and again in told


def test_only_simulated_people_are_called_so(tmp_path: Path) -> None:
    plaza = load_recording("plaza")
    assert is_simulated("plaza", "vsp") and not is_simulated("plaza", "text") and not is_simulated("zara01", "vsp")
    assert crowd_of("plaza", "vsp") == "plaza (vsp, simulated crowd)" and crowd_of("zara01", "vsp") == "zara01 (vsp)"
    assert unverified(plaza) == ()
    assert unverified(dataclasses.replace(plaza, name="eth", variant="obsmat"))[0].startswith("not verified")
