"""Recordings of one's own: headers, columns, units, frame rates, and what looks wrong with them."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.recordings import Reading, Recording, load_recording
from socialnav_mj.recordings.fields import FormatError
from socialnav_mj.recordings.plausibility import doubts, nearest_neighbour, walking_speed

ROWS = [(0, 7, 1.0, 2.0), (10, 7, 1.5, 2.0), (0, 8, 4.0, 0.5), (10, 8, 4.0, 1.0)]


def load(tmp_path: Path, content: str, reading: Reading | None = None, name: str = "a.csv") -> Recording:
    path = tmp_path / name
    path.write_text(content)
    return load_recording(path, reading=reading or Reading())


def assert_read(recording: Recording) -> None:
    assert recording.variant == "text"
    assert recording.ids.tolist() == [7, 8]
    assert [t.tolist() for t in recording.times] == [[0.0, 0.4]] * 2
    assert [x.tolist() for x in recording.positions] == [[[1.0, 2.0], [1.5, 2.0]], [[4.0, 0.5], [4.0, 1.0]]]


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("frame,id,x,y", "{f},{i},{x},{y}"),
        ("Person ID;Frame ID;Y [m];X [m];kind", "{i};{f};{y};{x};adult"),
        ('"trackId", "frame", "class", "xCenter", "yCenter"', '{i}, {f}, "a, b", {x}, {y}'),
        ("ped_id\tframe_number\tpos_x\tpos_y\tnote", "{i}\t{f}\t{x}\t{y}\t"),
        ("y x id frame", "{y} {x} {i} {f}"),
        ("#ID\tFR\tX\tY\tZ", "{i}\t{f}\t{x}\t{y}\t0"),
        ("# id frame x/m y/m", "{i} {f} {x} {y}"),
        ("# frame, id, x, y and more about it", "{f} {i} {x} {y}"),
    ],
)
def test_table_with_a_header_is_read_by_its_names(header: str, row: str, tmp_path: Path) -> None:
    lines = [header, "", *(row.format(f=f, i=i, x=x, y=y) for f, i, x, y in ROWS), "# end"]
    recording = load(tmp_path, "\n".join(lines))
    assert_read(recording)
    assert recording.reading == {}
    assert_read(load_recording(tmp_path))


def test_columns_say_what_a_table_without_a_header_holds(tmp_path: Path) -> None:
    content = "".join(f"{i},{y},{f},,{x}\n" for f, i, x, y in ROWS)
    with pytest.raises(FormatError, match=r"line 1: '7,2\.0,0,,1\.0' is not recognised; expected one of\n.*--columns"):
        load(tmp_path, content)
    reading = Reading(columns=("id", "y", "frame", "-", "x"))
    recording = load(tmp_path, content, reading)
    assert_read(recording)
    assert recording.reading == {"columns": ["id", "y", "frame", "-", "x"]}
    assert Reading(max_gap=9.0).again(12.5, recording.reading) == dataclasses.replace(
        reading, frame_rate=12.5, max_gap=9.0
    )
    with pytest.raises(
        ValueError, match="setting 'max_gap' of a recording is unknown; known: axis_order, columns, since, un"
    ):
        reading.again(25.0, {"max_gap": 1e9})
    # The names of a header give way to those that are given.
    assert_read(load(tmp_path, "a,b,c,d,e\n" + content, reading))


def test_columns_belong_to_tables(tmp_path: Path) -> None:
    reading = Reading(columns=("id", "frame", "x", "y"))
    with pytest.raises(
        ValueError, match="columns = id frame x y is not allowed for the variant 'obsmat'; allowed: text"
    ):
        load_recording(Path(__file__).parent / "data" / "tiny", variant="obsmat", reading=reading)
    with pytest.raises(ValueError, match="columns = id frame x y is not allowed for a recording of the catalogue"):
        load_recording("plaza", reading=reading)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("frame,id,x,y\n0,1,0,0\n10,1,,0\n", "line 3: x is ''; expected a finite number"),
        ("frame,id,kind,x,y\n0,1,a,0,0\n10,1,0,0\n", "line 3: 4 fields; expected 5: frame id kind x y"),
        ('frame,id,x,y\n0,1,0,0\n10,"1,0,0\n', r"line 3: no table \(unexpected end of data\)"),
        ("frame,id,x\n0,1,0\n", "line 1: 'frame,id,x' is not recognised"),
        ("frame,id,id,x,y\n0,1,1,0,0\n", "line 1: 'frame,id,id,x,y' is not recognised"),
        ("# framerate: 0\n0 1 0 0\n1 1 0 0\n", "line 1: the frame rate is 0; expected a number > 0"),
    ],
)
def test_mistake_in_a_table_names_its_line(content: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=message):
        load(tmp_path, content)


@pytest.mark.parametrize(("units", "factor"), [("cm", 0.01), ("mm", 0.001), ("0.5", 0.5)])
def test_units_become_metres(units: str, factor: float, tmp_path: Path) -> None:
    recording = load(tmp_path, "0 1 100 200\n10 1 200 200\n", Reading(units=units))
    np.testing.assert_allclose(recording.positions[0], factor * np.array([[100.0, 200.0], [200.0, 200.0]]), rtol=1e-15)
    assert recording.reading == {"units": units}


def test_recording_says_where_its_frame_rate_comes_from(tmp_path: Path) -> None:
    rows = "0 1 0 0\n10 1 1 0\n"
    for content, given, expected in (
        (rows, None, (25.0, "assumed")),
        ("# description: a\n# framerate: 16.00\n" + rows, None, (16.0, "stated in the file")),
        ("# framerate: 16.00\n" + rows, 10.0, (10.0, "given")),
        ("# frame rate: unknown\n" + rows, None, (25.0, "assumed")),
    ):
        found = load(tmp_path, content, Reading(frame_rate=given))
        assert (found.frame_rate, found.frame_rate_origin) == expected
    plaza = load_recording("plaza")
    assert (plaza.frame_rate, plaza.frame_rate_origin) == (25.0, "catalogue")


def crowd(speed: float, apart: float = 1.0, n_people: int = 5) -> Recording:
    times = np.array([0.0, 4.0, 10.0])
    return Recording(
        name="made",
        variant="text",
        frame_rate=25.0,
        frame_rate_origin="assumed",
        ids=np.arange(n_people),
        times=(times,) * n_people,
        positions=tuple(np.column_stack([speed * times, np.full(3, apart * k)]) for k in range(n_people)),
        checksum="",
    )


def test_walking_speed_is_a_median_over_time_without_those_who_stand() -> None:
    assert walking_speed(crowd(1.3)) == pytest.approx(1.3)
    assert np.isnan(walking_speed(crowd(0.05)))
    # 4 s at 3 m/s, 6 s at 1 m/s.
    mixed = crowd(1.0)
    positions = tuple(np.array([[0.0, k], [12.0, k], [18.0, k]]) for k in range(5))
    one = Recording(**{**vars_of(mixed), "positions": positions})
    assert walking_speed(one) == pytest.approx(1.0)


def vars_of(recording: Recording) -> dict:
    names = ("name", "variant", "frame_rate", "ids", "times", "positions", "checksum")
    return {name: getattr(recording, name) for name in names}


def test_nearest_neighbour_is_that_of_people_who_are_there_together() -> None:
    assert nearest_neighbour(crowd(1.0, apart=24.0)) == pytest.approx(24.0)
    assert np.isnan(nearest_neighbour(crowd(1.0, n_people=1)))


def test_plausible_recordings_raise_no_doubt() -> None:
    for recording in (crowd(0.6), crowd(1.9), load_recording("plaza")):
        assert doubts(recording) == ()


def test_doubts_name_the_probable_cause() -> None:
    (speed,) = doubts(crowd(2.5))
    assert speed.startswith(
        "people walk at 2.5 m/s (median; usual are 0.5 to 2); probably the frame rate of 25 Hz (assum"
    )
    assert "--frame-rate" in speed and "pixels" in speed
    speed, distance = doubts(crowd(80.0, apart=24.0))
    assert "80 m/s" in speed and "probably the positions are pixels or no metres" in speed
    assert distance.startswith("the nearest neighbour is 24 m away") and "--units" in distance
    assert "nobody walks at 0.1 m/s or faster" in doubts(crowd(0.01))[0]


def test_wrong_frame_rate_of_a_recording_by_path_is_told(tmp_path: Path, caplog) -> None:
    # As ETH's seq_eth: 6 frames a row of .4 s, that is 15 Hz, taken for 25.
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{6 * k} {i} {1.4 * 0.4 * k} {i}\n" for k in range(20) for i in range(3)))
    with caplog.at_level(logging.WARNING):
        load_recording(path, warn=False)
        load_recording(path, reading=Reading(frame_rate=15.0))
        assert caplog.text == ""
        load_recording(path)
    assert "a.txt: people walk at 2.33 m/s" in caplog.text
