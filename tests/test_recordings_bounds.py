"""Recordings that are damaged, hostile or very large: an error that names the line, never a crash or the memory."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.recordings import Reading, Recording, load_recording
from socialnav_mj.recordings.fields import FormatError

VSP = "1 splines\n2 points\n0 0 {} 90\n10 10 {} 90\n"
BOM = b"\xef\xbb\xbf"


def text_of(frames: list[object], ids: list[object], x: object = 0) -> str:
    return "".join(f"{f} {i} {x} {k}\n" for k, (f, i) in enumerate(zip(frames, ids, strict=True)))


def track(frame: str = "0", person: str = "1", x: str = "0", y: str = "0") -> str:
    return f'{{"track": {{"f": {frame}, "p": {person}, "x": {x}, "y": {y}}}}}\n'


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "a.txt",
            text_of([0, 10, 20, 10**9], [1, 1, 2, 2]),
            r"line 4: frame 1000000000 makes the recording 4e\+07 s long at 25 Hz; expected at most 86400 s",
        ),
        ("a.txt", text_of([0, 10, 10**15], [1, 1, 1]), r"line 3: frame 1000000000000000 makes .* at most 86400 s"),
        (
            "a.txt",
            text_of([0, 10, 20, 30, 54000], [1, 1, 2, 1, 2]),
            r"line 5: person 2 is not seen for 2159\.2 s \(before: line 3\); expected a gap of at most 300 s",
        ),
        ("a.vsp", VSP.format(0, 10**9), r"a\.vsp, line 4: frame 1000000000 makes"),
        ("a.ndjson", track("0") + track("1000000000"), r"a\.ndjson, line 2: frame 1000000000 makes"),
        (
            "a.txt",
            text_of([0, 10], [1, "1e99"]),
            r"line 2: id is '1e99'; expected a whole number between -2\^62 and 2\^62",
        ),
        ("a.txt", text_of([0, 2**62], [1, 1]), r"line 2: frame is '4611686018427387904'; expected a whole number betw"),
        ("a.txt", text_of([0, "9" * 5000], [1, 1]), r"line 2: frame is '9{57}\.\.\.'; expected a finite number"),
        ("a.txt", text_of([0, "1e309"], [1, 1]), r"line 2: frame is '1e309'; expected a finite number"),
        (
            "a.txt",
            text_of([0, "7.00000000000000000001"], [1, 1]),
            r"line 2: frame is '7\.0+1'; expected a whole number",
        ),
        ("a.txt", text_of([0, "1_0"], [1, 1]), r"line 2: frame is '1_0'; expected a finite number"),
        ("a.txt", text_of([0, "\u0661\u0660"], [1, 1]), r"line 2: frame is '\u0661\u0660'; expected a finite number"),
        (
            "a.txt",
            text_of([0, 10], [1, 1], x="1e308"),
            r"line 1: the position \(1e\+308, 0\) m; expected coordinates wi",
        ),
        (
            "a.txt",
            text_of([0, 10], [1, 1], x="-1.1e7"),
            r"line 1: the position \(-1\.1e\+07, 0\) m; expected .* 1e\+07 m",
        ),
        ("a.txt", "0 1 0 0\n10 \x1b[2J 0 0\n", r"line 2: id is '\\x1b\[2J'; expected"),
        ("obsmat.txt", "0 1 0 0 0 0 0 0\n10 1 1e308 0 0 0 0 0\n", r"line 2: the position \(1e\+308, 0\) m"),
        ("a.ndjson", track() + track(frame="1", x="1e308"), r"line 2: the position \(1e\+308, 0\) m"),
        ("a.ndjson", track() + track(frame="9" * 5000), r"line 2: f is '9{57}\.\.\.'; expected a finite number"),
        ("a.ndjson", track() + track(person="1e99"), r"line 2: p is '1e99'; expected a whole number between"),
        ("a.ndjson", track() + track(x="NaN"), r"line 2: x is 'NaN'; expected a finite number"),
        (
            "a.ndjson",
            track() + track(x="[1]"),
            r"line 2: {\"track\": .*; expected a track with the numbers f, p, x and y",
        ),
        ("a.ndjson", track() + track(x='"\\ud800"'), r"line 2: x is '\\ud800'; expected a finite number"),
        (
            "a.ndjson",
            track() + "[" * 100_000 + "\n",
            r"line 2: JSON that is nested too deeply; expected one JSON object",
        ),
        ("a.ndjson", '{"a":' * 100_000 + "\n", r"line 1: JSON that is nested too deeply; expected one JSON object"),
        ("a.ndjson", '{"scene": {"fps": null}}\n', r"line 1: {\"scene\": {\"fps\": null}}; expected a number as fps"),
        (
            "a.ndjson",
            '{"scene": {"fps": 1e300}}\n' + track() + track("1"),
            r"frames come at 1e\+300 Hz; expected a frame",
        ),
        ("a.ndjson", '{"scene": {"fps": 1e-9}}\n' + track() + track("1"), r"frames come at 1e-09 Hz; expected a frame"),
    ],
)
def test_what_no_recording_holds_is_refused_with_file_and_line(
    name: str, content: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content)
    if name.endswith(".vsp"):
        np.savetxt(tmp_path / "H.txt", np.eye(3))
    with pytest.raises(FormatError, match=message):
        load_recording(tmp_path / name)


def test_error_travels_between_processes() -> None:
    error = FormatError(Path("a.txt"), 3, "this", "that")
    assert str(pickle.loads(pickle.dumps(error))) == str(error) == "a.txt, line 3: this; expected that"


def test_bounds_on_time_can_be_lifted(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text_of([0, 9000, 9010], [1, 1, 1]))
    with pytest.raises(FormatError, match="not seen for 360 s"):
        load_recording(path)
    assert load_recording(path, reading=Reading(max_gap=360.0)).duration == 360.4
    with pytest.raises(FormatError, match=r"makes the recording 360\.4 s long"):
        load_recording(path, reading=Reading(max_gap=360.0, max_duration=360.0))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"max_gap": 0.0}, r"max_gap = 0\.0 is not allowed; allowed: numbers > 0 up to 1e\+09"),
        ({"max_duration": float("inf")}, "max_duration = inf is not allowed"),
        ({"frame_rate": float("inf")}, r"frame_rate = inf is not allowed; allowed: numbers from 0\.001 to 1e\+06"),
        ({"frame_rate": 1e-9}, "frame_rate = 1e-09 is not allowed"),
        ({"units": "px"}, "units = 'px' is not allowed; allowed: m, cm, mm, or a length in metres"),
        ({"units": "nan"}, "units = 'nan' is not allowed"),
        ({"columns": ("frame", "x", "y")}, "columns = frame x y is not allowed; allowed: frame, id, x, y once each"),
    ],
)
def test_reading_refuses_what_makes_no_sense(values: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Reading(**values)


@pytest.mark.parametrize(
    "write",
    [
        lambda p: text_of([0, 10, 0, 10], p),
        lambda p: "".join(track(frame, person) for frame, person in zip(("0", "10", "0", "10"), p, strict=True)),
    ],
)
def test_ids_that_floating_point_numbers_do_not_tell_apart_stay_two_people(write, tmp_path: Path) -> None:
    ids = [2**53, 2**53, 2**53 + 1, 2**53 + 1]
    content = write(list(map(str, ids)))
    path = tmp_path / ("a.ndjson" if content.startswith("{") else "a.txt")
    path.write_text(content)
    assert load_recording(path).ids.tolist() == [2**53, 2**53 + 1]


def test_frames_beyond_floating_point_numbers_are_exact(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text_of([2**60 + 1, f"{2**60 + 2}.0"], [1, 1]))
    assert load_recording(path).times[0].tolist() == [0.0, 0.04]


@pytest.mark.parametrize("name", ["a.txt", "a.ndjson", "a.vsp", "a.csv"])
def test_byte_order_mark_is_read(name: str, tmp_path: Path) -> None:
    content = {"a.txt": text_of([0, 10], [1, 1]), "a.ndjson": track() + track("10"), "a.vsp": VSP.format(0, 10)}
    content["a.csv"] = "frame,id,x,y\n0,1,0,0\n10,1,1,0\n"
    np.savetxt(tmp_path / "H.txt", np.eye(3) + np.diag([0, 0, 9]))
    (tmp_path / "H.txt").write_bytes(BOM + (tmp_path / "H.txt").read_bytes())
    (tmp_path / name).write_bytes(BOM + content[name].encode())
    assert load_recording(tmp_path / name).duration == 0.4


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32"])
def test_other_encodings_are_refused_by_name(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(text_of([0, 10], [1, 1]).encode(encoding))
    with pytest.raises(FormatError, match=r"a\.txt, line 1: .*(not UTF-8|not recognised)"):
        load_recording(path, variant="text")


def test_lines_are_counted_as_editors_do(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes("# a\u2028b\x85c\x0cd\r\n0 1 0 0\r10 1 x 0\n".encode())
    with pytest.raises(FormatError, match="line 3: x is 'x'"):
        load_recording(path)


def test_point_on_the_horizon_of_the_homography_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.vsp").write_text("1\n3\n0 0 0 90\n10 0 10 90\n-10 0 20 90\n")
    (tmp_path / "H.txt").write_text("1 0 0\n0 1 0\n0.1 0 1\n")
    with pytest.raises(FormatError, match=r"a\.vsp, line 5: the position \(-inf, nan\) m; expected coordinates within"):
        load_recording(tmp_path / "a.vsp")


@pytest.mark.parametrize("content", ["1e308 1e308 0\n1e308 -1e308 0\n0 0 1\n", "1e-200 0 0\n0 1e-200 0\n0 0 1e-200\n"])
def test_homography_beyond_floating_point_numbers_gives_an_error_or_finite_positions(
    content: str, tmp_path: Path
) -> None:
    (tmp_path / "a.vsp").write_text(VSP.format(0, 10))
    (tmp_path / "H.txt").write_text(content)
    with pytest.raises(FormatError, match=r"H\.txt: a singular matrix"):
        load_recording(tmp_path / "a.vsp")


@pytest.mark.parametrize("name", ["", "a\nb", "\x1b[31m", "a" * 101, "\udcff"])
def test_names_have_a_length_and_no_control_characters(name: str) -> None:
    tiny = load_recording(Path(__file__).parent / "data" / "tiny")
    with pytest.raises(ValueError, match="allowed: 1 to 100 printable characters"):
        Recording(
            name=name,
            variant=tiny.variant,
            frame_rate=tiny.frame_rate,
            ids=tiny.ids,
            times=tiny.times,
            positions=tiny.positions,
            checksum=tiny.checksum,
        )


def test_many_people_who_are_left_out_are_not_all_named(tmp_path: Path, caplog) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text_of([0, 10, *range(50)], [1, 1, *range(2, 52)]))
    load_recording(path)
    assert "left out 50 people with a single position: ids 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, ..." in caplog.text


@pytest.mark.slow
def test_fifty_thousand_people_take_less_than_a_gigabyte(tmp_path: Path) -> None:
    """A million lines; before, 5,000 people in 100,000 lines took 8 GB."""
    path = tmp_path / "a.txt"
    with path.open("w") as file:
        for person in range(50_000):
            file.writelines(
                f"{person * 3 + k * 10}\t{person + 1}\t{(person % 40) * 0.5:.6f}\t{k * 0.52:.6f}\n" for k in range(20)
            )
    code = f"""
import json, resource
from socialnav_mj.recordings import load_recording
recording = load_recording({str(path)!r})
loaded = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
recording.at([10.0])
used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([recording.n_people, loaded, used]))
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    people, loaded, used = json.loads(found.stdout)
    assert people == 50_000
    assert loaded < 1_000_000 and used < 1_000_000  # [kB]
