"""Figures of a crowd, and who walks together."""

import os
import tracemalloc
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.recordings.companions import companions
from socialnav_mj.recordings.facts import facts, facts_table

needs_ucy = pytest.mark.skipif(
    not os.environ.get("SOCIALNAV_MJ_DATA"), reason="needs the UCY recordings: SOCIALNAV_MJ_DATA is not set"
)


def crowd_of(tracks: list[tuple[list[float], list[tuple[float, float]]]]) -> Recording:
    return Recording(
        name="made",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(len(tracks)),
        times=tuple(np.array(t, dtype=float) for t, _ in tracks),
        positions=tuple(np.array(x, dtype=float) for _, x in tracks),
        checksum="",
    )


def walk(start: tuple[float, float], velocity: tuple[float, float], begin: float = 0.0, end: float = 10.0):
    length = end - begin
    return [begin, end], [start, (start[0] + velocity[0] * length, start[1] + velocity[1] * length)]


def transformed(recording: Recording, angle: float, shift: tuple[float, float], delay: float) -> Recording:
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return crowd_of(
        [(t + delay, x @ rotation.T + shift) for t, x in zip(recording.times, recording.positions, strict=True)]
    )


def test_two_walkers_side_by_side_have_the_figures_of_hand_calculation() -> None:
    # 10 s at 1 m/s, 0.3 m apart; the third stands 20 m away for 5 s. Samples: 51 + 51 + 26.
    found = facts(crowd_of([walk((0, 0), (1, 0)), walk((0, 0.3), (1, 0)), walk((0, 20), (0, 0), 0.0, 5.0)]))
    assert (found.n_people, found.duration, found.max_present) == (3, 10.0, 3)
    assert found.extent == pytest.approx((10.0, 20.0))
    assert found.mean_present == pytest.approx((51 + 51 + 26) / 51)
    assert found.standing_share == pytest.approx(26 / 128)
    assert found.speed[5] == 0.0 and found.speed[50] == pytest.approx(1.0)
    assert found.moving_speed[5] == pytest.approx(1.0)
    assert found.nearest_neighbour[50] == pytest.approx(0.3)
    assert found.neighbour_within == pytest.approx({1.2: 102 / 128, 2.0: 102 / 128})
    assert found.closer_than == pytest.approx({0.25: 0.0, 0.32: 2 / 3, 0.4: 2 / 3})
    assert (found.n_companion_pairs, found.n_companion_people, found.n_displaced_less_than_1m) == (1, 2, 1)


def test_facts_do_not_change_when_the_world_is_moved_and_turned() -> None:
    random = np.random.default_rng(0)
    tracks = []
    for _ in range(25):
        begin = random.uniform(0.0, 10.0)
        tracks.append(
            walk(
                tuple(random.uniform(-4, 4, 2)), tuple(random.normal(size=2) * 0.7), begin, begin + random.uniform(4, 9)
            )
        )
    tracks[0][0][0] = 0.0
    recording = crowd_of(tracks)
    # Straight walks, so that turning the axes does not change the curve between samples.
    before, after = facts(recording), facts(transformed(recording, 0.7, (30.0, -5.0), 0.0))
    for name in ("speed", "moving_speed", "nearest_neighbour", "neighbour_within", "closer_than"):
        assert getattr(after, name) == pytest.approx(getattr(before, name), abs=1e-9), name
    for name in ("n_people", "mean_present", "max_present", "standing_share", "n_companion_pairs"):
        assert getattr(after, name) == pytest.approx(getattr(before, name)), name


def test_figures_do_not_depend_on_when_the_recording_begins() -> None:
    tiny = load_recording(Path(__file__).parent / "data" / "tiny")
    assert facts(transformed(tiny, 0.0, (0.0, 0.0), 8.0)).mean_present == facts(tiny).mean_present


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (walk((0, 0.7), (1, 0)), 1),
        (walk((0, 0.7), (1, 0), 4.0, 14.0), 0),  # the same way, four metres behind
        (walk((0, 1.6), (1, 0)), 0),  # too far apart
        (walk((10, 0.7), (-1, 0)), 0),  # meets and passes
        (walk((-1, 0.7), (1.4, 0)), 0),  # overtakes
    ],
)
def test_companions_are_near_each_other_and_walk_the_same_way(other, expected: int) -> None:
    assert len(companions(crowd_of([walk((0, 0), (1, 0)), other]))) == expected


def test_people_who_stand_together_do_not_walk_together() -> None:
    assert companions(crowd_of([walk((0, 0), (0, 0)), walk((0, 0.7), (0, 0))])).shape == (0, 2)


def test_person_alone_has_no_neighbour() -> None:
    found = facts(crowd_of([walk((0, 0), (1, 0))]))
    assert np.isnan(found.nearest_neighbour[50])
    assert found.closer_than == {0.25: 0.0, 0.32: 0.0, 0.4: 0.0}


def test_a_long_recording_with_few_people_at_a_time_takes_little_memory() -> None:
    # 50 people over a day; a cell for everybody at every moment took 900 MB.
    recording = crowd_of([walk((0, 0), (1, 0), 1700.0 * k, 1700.0 * k + 10.0) for k in range(50)])
    tracemalloc.start()
    try:
        assert facts(recording).mean_present == pytest.approx(50 * 51 / 416_551, rel=1e-3)
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()


def test_table_has_a_column_per_recording_and_equal_rows() -> None:
    one = facts(crowd_of([walk((0, 0), (1, 0)), walk((0, 0.3), (1, 0))]))
    lines = facts_table({"a": one, "b": one}).splitlines()
    assert lines[0] == "| | a | b |"
    assert {line.count("|") for line in lines} == {4}


@needs_ucy
def test_students003_has_the_figures_measured_by_a_prototype() -> None:
    # An independent throw-away program: 434 people, 32.5 present on average and 51 at most, median speed .75, nearest
    # neighbour .44/.58/.74/1.08, 79 and 92 % of steps with somebody within 1.2 and 2 m, 7 people displaced < 1 m.
    found = facts(load_recording("students003"))
    assert (found.n_people, found.max_present, found.n_displaced_less_than_1m) == (434, 51, 7)
    assert found.duration == pytest.approx(216.16)
    assert found.extent == pytest.approx((15.5, 13.9), abs=0.05)
    assert found.mean_present == pytest.approx(32.5, abs=0.1)
    assert found.speed[50] == pytest.approx(0.75, abs=0.03)
    assert list(found.nearest_neighbour.values()) == pytest.approx([0.44, 0.58, 0.74, 1.08], abs=0.01)
    assert list(found.neighbour_within.values()) == pytest.approx([0.79, 0.92], abs=0.01)
    assert list(found.closer_than.values()) == pytest.approx([0.03, 0.10, 0.32], abs=0.02)
    assert found.n_companion_people == pytest.approx(211, rel=0.05)


@needs_ucy
@pytest.mark.parametrize(("name", "precision", "recall"), [("zara01", 0.98, 0.7), ("zara02", 0.95, 0.85)])
def test_companions_agree_with_the_groups_marked_by_hand(name: str, precision: float, recall: float) -> None:
    recording = load_recording(name, variant="obsmat")
    lines = (Path(os.environ["SOCIALNAV_MJ_DATA"]) / "ucy" / name / "groups.txt").read_text().splitlines()
    marked = {pair for line in lines for pair in combinations(sorted(map(int, line.split())), 2)}
    found = {tuple(recording.ids[pair].tolist()) for pair in companions(recording)}
    assert len(found & marked) >= precision * len(found)
    assert len(found & marked) >= recall * len(marked)
