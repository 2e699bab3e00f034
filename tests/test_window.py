"""A part of a recording in time: who is in it, when, and where."""

import numpy as np
import pytest
from scenes import recording_of, stand, walk

from socialnav_mj.recordings import load_recording
from socialnav_mj.recordings.window import window


def crossing():
    """Three people over 10 s: one all the time, one from 1 to 5 s, one from 6 to 10 s."""
    return recording_of(
        walk([(0.0, 0.0), (10.0, 0.0)], 1.0),
        walk([(0.0, 1.0), (0.0, 5.0)], 1.0, begin=1.0),
        walk([(8.0, 2.0), (4.0, 2.0)], 1.0, begin=6.0),
    )


def test_window_shifts_time_and_cuts_people_at_its_edges():
    """From 2 to 7.5 s: one goes 2 -> 7.5 m, one 2 -> 5 m and leaves at 3 s, one comes at 4 s and gets to 6.5 m."""
    part = window(crossing(), 0.2, 0.75)
    assert part.ids.tolist() == [1, 2, 3]
    np.testing.assert_allclose(part.start_time, [0.0, 0.0, 4.0], atol=1e-12)
    np.testing.assert_allclose(part.end_time, [5.5, 3.0, 5.5], atol=1e-12)
    np.testing.assert_allclose(part.start, [[2.0, 0.0], [0.0, 2.0], [8.0, 2.0]], atol=1e-9)
    np.testing.assert_allclose(part.end, [[7.5, 0.0], [0.0, 5.0], [6.5, 2.0]], atol=1e-9)


def test_whole_window_is_the_recording():
    whole = crossing()
    part = window(whole, 0.0, 1.0)
    np.testing.assert_array_equal(part.ids, whole.ids)
    for name in ("times", "positions"):
        for given, expected in zip(getattr(part, name), getattr(whole, name), strict=True):
            np.testing.assert_allclose(given, expected, atol=1e-12)


def test_window_keeps_ids_and_leaves_out_whoever_is_not_there():
    """Up to 5.5 s the third is not there; from 5.5 s the second; who only touches an edge is gone as well."""
    assert window(crossing(), 0.0, 0.55).ids.tolist() == [1, 2]
    assert window(crossing(), 0.55, 1.0).ids.tolist() == [1, 3]
    assert window(crossing(), 0.5, 0.6).ids.tolist() == [1]


def test_window_names_itself_and_keeps_its_source():
    whole = crossing()
    part = window(whole, 0.0, 0.6)
    assert part.variant == "text[0-0.6]"
    assert (part.name, part.checksum, part.frame_rate) == (whole.name, whole.checksum, whole.frame_rate)


def test_windows_of_plaza_pass_through_the_whole_recordings_samples():
    """Neighbouring windows share no sample; each sample of the source is where the source has it."""
    whole = load_recording("plaza")
    parts = [window(whole, 0.0, 0.6), window(whole, 0.6, 0.7), window(whole, 0.7, 1.0)]
    for part, begin in zip(parts, (0.0, 0.6, 0.7), strict=True):
        shift = begin * whole.duration
        for person, times, positions in zip(part.ids, part.times, part.positions, strict=True):
            track = whole.person(int(np.flatnonzero(whole.ids == person)[0]))
            np.testing.assert_allclose(positions, track.at(times + shift)[0], atol=1e-6)
        assert part.start_time.min() == 0.0
    assert set().union(*(part.ids.tolist() for part in parts)) == set(whole.ids.tolist())
    time = sum(float((part.end_time - part.start_time).sum()) for part in parts)
    assert time == pytest.approx(float((whole.end_time - whole.start_time).sum()), abs=1.0)


def test_standing_people_stay_where_they_are():
    part = window(recording_of(stand((1.0, 2.0), 0.0, 10.0)), 0.25, 0.5)
    np.testing.assert_array_equal(part.positions[0], [[1.0, 2.0], [1.0, 2.0]])
    np.testing.assert_allclose(part.times[0], [0.0, 2.5])


@pytest.mark.parametrize(("begin", "end"), [(-0.1, 0.5), (0.5, 0.5), (0.7, 0.6), (0.0, 1.1), (float("nan"), 1.0)])
def test_window_refuses_shares_that_are_not_in_order(begin, end):
    with pytest.raises(ValueError, match="allowed: 0 <= begin < end <= 1"):
        window(crossing(), begin, end)
