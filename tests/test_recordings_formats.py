"""Readers: the same tracks from every format, and mistakes named by file and line."""

import json
import logging
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.recordings import Reading, Recording, load_recording

TINY = Path(__file__).parent / "data" / "tiny"
# Diagonal scale and offset, and one that mixes axes and has perspective, as pixels -> metres.
HOMOGRAPHIES = {
    "scale": np.array([[0.02, 0.0, 7.5], [0.0, 0.025, 6.5], [0.0, 0.0, 1.0]]),
    "perspective": np.array([[-0.03, 0.002, 7.8], [0.001, 0.02, 5.5], [1e-4, -2e-4, 1.0]]),
}


def write_text(recording: Recording, path: Path) -> None:
    rows = [(round(t * 25), p, x, y) for p, t, x, y in rows_of(recording)]
    path.write_text("".join(f"{f}\t{p}.0\t{x!r}\t{y!r}\n" for f, p, x, y in sorted(rows)))


def write_obsmat(recording: Recording, path: Path) -> None:
    path.write_text("".join(f"{t * 25:e} {p:e} {x!r} 0 {y!r} 9 9 9\n" for p, t, x, y in rows_of(recording)))


def write_ndjson(recording: Recording, path: Path, *, fps: float = 2.5, step: int = 10) -> None:
    lines = [{"scene": {"id": 0, "p": 1, "s": 0, "e": 190, "fps": fps, "tag": 2}}]
    lines += [
        {"track": {"f": round(t / 0.4) * step, "p": p, "x": x, "y": y}} for p, t, x, y in reversed(rows_of(recording))
    ]
    path.write_text("\n".join(map(json.dumps, lines)))


def write_vsp(recording: Recording, folder: Path, homography: np.ndarray, *, axis_order: str) -> None:
    np.savetxt(folder / "H.txt", homography)
    inverse = np.linalg.inv(homography)
    lines = [f"{recording.n_people} - the number of splines"]
    for times, positions in zip(recording.times, recording.positions, strict=True):
        pixels = np.column_stack([positions, np.ones(len(positions))]) @ inverse.T
        pixels = pixels[:, :2] / pixels[:, 2:]
        if axis_order == "yx":
            pixels = pixels[:, ::-1]
        lines.append(f"{len(times)} - Num of control points")
        lines += [
            f"{x:.12f} {y:.12f} {round(t * 25)} 90.0 - (2D point, m_id)"
            for t, (x, y) in zip(times, pixels, strict=True)
        ]
    (folder / "annotation.vsp").write_bytes("\r\n".join([*lines, "2 - the number of obstacles", ""]).encode())


def rows_of(recording: Recording) -> list[tuple[int, float, float, float]]:
    return [
        (int(person), float(t), float(x), float(y))
        for person, times, positions in zip(recording.ids, recording.times, recording.positions, strict=True)
        for t, (x, y) in zip(times, positions, strict=True)
    ]


def assert_same_tracks(one: Recording, other: Recording) -> None:
    np.testing.assert_array_equal(one.ids, other.ids)
    for i in range(one.n_people):
        np.testing.assert_allclose(one.times[i], other.times[i], atol=1e-12)
        np.testing.assert_allclose(one.positions[i], other.positions[i], atol=1e-9)


def test_tiny_recording_is_what_its_remark_says() -> None:
    tiny = load_recording(TINY)
    assert (tiny.name, tiny.variant, tiny.n_people, tiny.frame_rate) == ("tiny", "text", 3, 25.0)
    assert tiny.duration == pytest.approx(19 * 0.4)
    np.testing.assert_allclose(tiny.start_time, [0.0, 0.0, 1.2])


@pytest.mark.parametrize("write", [write_text, write_obsmat, write_ndjson])
def test_tables_give_the_same_tracks(write, tmp_path: Path) -> None:
    variant = write.__name__.removeprefix("write_")
    path = tmp_path / {"text": "a.txt", "obsmat": "obsmat.txt", "ndjson": "a.ndjson"}[variant]
    tiny = load_recording(TINY)
    write(tiny, path)
    for found in (load_recording(path), load_recording(tmp_path), load_recording(path, variant=variant)):
        assert found.variant == variant
        assert_same_tracks(found, tiny)


@pytest.mark.parametrize("homography", HOMOGRAPHIES)
@pytest.mark.parametrize("axis_order", ["xy", "yx"])
def test_vsp_gives_the_same_tracks(homography: str, axis_order: str, tmp_path: Path) -> None:
    tiny = load_recording(TINY)
    write_vsp(tiny, tmp_path, HOMOGRAPHIES[homography], axis_order=axis_order)
    for path in (tmp_path, tmp_path / "annotation.vsp"):
        found = load_recording(path, reading=Reading(axis_order=axis_order))
        assert found.variant == "vsp"
        assert_same_tracks(found, tiny)


def test_vsp_is_read_with_x_before_y_unless_told(tmp_path: Path) -> None:
    tiny = load_recording(TINY)
    write_vsp(tiny, tmp_path, HOMOGRAPHIES["scale"], axis_order="xy")
    assert_same_tracks(load_recording(tmp_path), tiny)
    with pytest.raises(ValueError, match="axis_order = 'zx' is not allowed; allowed: xy, yx"):
        Reading(axis_order="zx")


def test_folder_with_two_annotations_reads_the_vsp_unless_told(tmp_path: Path) -> None:
    tiny = load_recording(TINY)
    write_vsp(tiny, tmp_path, HOMOGRAPHIES["scale"], axis_order="xy")
    write_obsmat(tiny, tmp_path / "obsmat.txt")
    (tmp_path / "groups.txt").write_text("1 3\n")
    assert load_recording(tmp_path).variant == "vsp"
    assert load_recording(tmp_path, variant="obsmat").variant == "obsmat"


def test_frame_rate_scales_time_and_checksum_does_not_change() -> None:
    slow, fast = load_recording(TINY, reading=Reading(frame_rate=12.5)), load_recording(TINY)
    assert slow.duration == pytest.approx(2.0 * fast.duration)
    assert slow.checksum == fast.checksum and len(fast.checksum) == 64
    with pytest.raises(ValueError, match=r"frame_rate = 0\.0 is not allowed"):
        Reading(frame_rate=0.0)


def test_ndjson_states_its_own_frame_rate(tmp_path: Path) -> None:
    # fps counts rows: 2.5 rows a second with frames 7 apart are 17.5 frames a second.
    path = tmp_path / "a.ndjson"
    write_ndjson(load_recording(TINY), path, fps=2.5, step=7)
    found = load_recording(path)
    assert found.frame_rate == pytest.approx(17.5)
    assert_same_tracks(found, load_recording(TINY))


def test_first_frame_is_time_zero(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("107 4 0 0\n117 4 1 0\n132 9 0 0\n142 9 1 0\n")
    found = load_recording(path)
    np.testing.assert_allclose(found.start_time, [0.0, 1.0])


def test_person_with_one_position_is_left_out_with_a_warning(tmp_path: Path, caplog) -> None:
    path = tmp_path / "a.txt"
    path.write_text("0 1 0 0\n10 1 1 0\n10 7 5 5\n")
    with caplog.at_level(logging.WARNING):
        assert load_recording(path).ids.tolist() == [1]
    assert "left out 1 people with a single position: ids 7" in caplog.text


VSP_HEAD = "1 - the number of splines\n2 - Num of control points\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", "0 1 0 0\n10 1 0\n", r"a\.txt, line 2: 3 numbers; expected 4: frame id x y"),
        ("a.txt", "0 1 0 0\n1.5 1 0 0\n", r"a\.txt, line 2: frame is '1\.5'; expected a whole number"),
        ("a.txt", "0 1 0 0\n10 1 nan 0\n", r"a\.txt, line 2: x is 'nan'; expected a finite number"),
        ("a.txt", "0 1 0 0\n0 1 3 0\n", r"line 2: person 1 has a second position at frame 0 \(the first: line 1\)"),
        ("a.txt", "0 1 0 0\n0 2 3 0\n", r"2 people with at most one position; expected people with at least 2"),
        ("a.txt", "# nothing\n", r"a\.txt: nothing in it; expected one of"),
        ("a.txt", "a b c d\n", r"a\.txt, line 1: 'a b c d' is not recognised; expected one of\n  text: "),
        ("obsmat.txt", "0 1 0 0 0 0 0 0\n1 1 0 0 0 0 0\n", r"obsmat\.txt, line 2: 7 numbers; expected 8: frame id x z"),
        (
            "a.ndjson",
            '{"track": {"f": 0}}\n',
            r'line 1: {"track": {"f": 0}}; expected a track with the numbers f, p, x and y',
        ),
        ("a.ndjson", '{"track": {"f": 0, "p": 1, "x": 0, "y": 0}}\n{"f"\n', r"line 2: no JSON \("),
        ("a.ndjson", '{"person": 1}\n', r'line 1: {"person": 1}; expected an object with "track" or "scene"'),
        ("a.ndjson", '{"scene": {"fps": 2.5}}\n{"scene": {"fps": 5}}\n', r"line 2: fps is 5; expected 2\.5, the same"),
        (
            "a.ndjson",
            '{"track": {"f": 0, "p": 1, "x": 0, "y": 0, "prediction_number": 0}}\n',
            r"line 1: a predicted position; expected recorded positions only",
        ),
        ("a.vsp", "many\n", r"a\.vsp, line 1: the number of splines is 'many'; expected a finite number"),
        ("a.vsp", VSP_HEAD + "1 2 0 90\n", r"line 3: the file ends here; expected x y frame gaze of point 2 of 2 of"),
        ("a.vsp", VSP_HEAD + "1 2 0 90\n1 2 5\n", r"line 4: '1 2 5'; expected x y frame gaze of point 2 of 2"),
        ("a.vsp", VSP_HEAD + "1 2 5 90\n1 2 5 90\n", r"line 4: frame 5 after frame 5; expected frames that increase"),
        ("a.vsp", "-1 splines\n", r"line 1: the number of splines is -1; expected 0 or more"),
        ("a.vsp", "0 splines\n", r"a\.vsp: no positions; expected at least one"),
    ],
)
def test_mistake_in_a_file_names_file_line_and_what_was_expected(
    name: str, content: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content)
    if name.endswith(".vsp"):
        np.savetxt(tmp_path / "H.txt", np.eye(3))
    with pytest.raises(ValueError, match=message):
        load_recording(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1 0 0\n0 1\n0 0 1\n", r"H\.txt, line 2: 2 numbers; expected 3 numbers a line"),
        ("1 0 0\n0 1 0\n", r"H\.txt: 2 lines of numbers; expected 3 lines"),
        ("1 0 0\n2 0 0\n0 0 1\n", r"H\.txt: a singular matrix"),
    ],
)
def test_mistake_in_a_homography_is_named(content: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.vsp").write_text(VSP_HEAD + "1 2 5 90\n1 2 6 90\n")
    (tmp_path / "H.txt").write_text(content)
    with pytest.raises(ValueError, match=message):
        load_recording(tmp_path)


def test_missing_parts_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="holds no recording"):
        load_recording(tmp_path)
    (tmp_path / "a.vsp").write_text("0 splines\n")
    with pytest.raises(FileNotFoundError, match=r"a\.vsp needs its homography .* a file H\.txt beside it"):
        load_recording(tmp_path)
    (tmp_path / "b.vsp").write_text("0 splines\n")
    with pytest.raises(ValueError, match=r"holds 2 recordings \(a\.vsp, b\.vsp\); give the path of one"):
        load_recording(tmp_path)
    with pytest.raises(ValueError, match="unknown variant 'csv'; available: vsp, obsmat, text, ndjson"):
        load_recording(tmp_path, variant="csv")


def test_binary_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"0 1 0 0\n\xff\xfe\n")
    with pytest.raises(ValueError, match="byte 8 is not UTF-8"):
        load_recording(tmp_path / "a.txt")


def test_only_the_beginning_is_read_if_asked_for() -> None:
    whole = load_recording(TINY / "tiny.txt")
    cut = load_recording(TINY / "tiny.txt", reading=Reading(until=3.0))
    assert (cut.duration, cut.variant, cut.checksum) == (3.0, whole.variant, whole.checksum)
    assert cut.reading == {"until": 3.0} and cut.n_people == 3
    for index in range(3):
        np.testing.assert_allclose(cut.positions[index][-1], whole.person(index).at(np.array([3.0]))[0][0])
    assert load_recording(TINY / "tiny.txt", reading=Reading(until=99.0)).duration == whole.duration
    with pytest.raises(ValueError, match=r"until = -1\.0 is not allowed"):
        Reading(until=-1.0)


def test_only_a_part_is_read_if_asked_for_and_parts_hold_what_the_whole_does() -> None:
    whole = load_recording(TINY / "tiny.txt")
    edges = [None, 1.0, 2.5, None]
    times = np.arange(0.0, whole.duration, 0.1)
    for since, until in pairwise(edges):
        part = load_recording(TINY / "tiny.txt", reading=Reading(since=since, until=until))
        assert part.reading == {k: v for k, v in (("since", since), ("until", until)) if v is not None}
        begin, end = since or 0.0, until or whole.duration
        assert part.duration <= end - begin + 1e-9 and part.variant == whole.variant
        inside = times[(times > begin + 1e-6) & (times < end - 1e-6)]
        then, there = whole.at(inside), part.at(inside - begin)
        who = np.searchsorted(whole.ids, part.ids)
        np.testing.assert_array_equal(there.present, then.present[:, who])
        assert not np.delete(then.present, who, axis=1).any()
        # Cut tracks are interpolated anew: near an edge the cubic is another one.
        np.testing.assert_allclose(there.position, then.position[:, who], atol=0.05)
    with pytest.raises(ValueError, match=r"until = 2 is not allowed; allowed: numbers > since = 3"):
        Reading(since=3.0, until=2.0)
    with pytest.raises(ValueError, match=r"nobody is there after 99 s.*an earlier --since"):
        load_recording(TINY / "tiny.txt", reading=Reading(since=99.0))
