"""Intervals that share slots: as few as overlap, and never two at once."""

import numpy as np

from socialnav_mj.slots import share_slots


def test_slots_are_as_few_as_overlaps_allow() -> None:
    random = np.random.default_rng(1)
    begin = random.integers(0, 100, 60).astype(float)
    end = begin + random.integers(1, 12, 60).astype(float)
    slots = share_slots(begin, end)
    for slot in np.unique(slots):
        order = np.argsort(begin[slots == slot])
        assert np.all(begin[slots == slot][order][1:] > end[slots == slot][order][:-1])
    most = max(int(np.sum((begin <= t) & (t <= end))) for t in np.concatenate([begin, end]))
    assert len(np.unique(slots)) == slots.max() + 1 == most


def test_lowest_free_slot_is_taken_and_intervals_that_meet_are_apart() -> None:
    begin, end = np.array([0, 0, 3, 4, 4]), np.array([3, 9, 4, 5, 5])
    # The third begins where the first ends, so it needs a third slot; then 0 is free, and 2 is not.
    assert share_slots(begin, end).tolist() == [0, 1, 2, 0, 3]
    assert share_slots(np.array([], dtype=np.int64), np.array([], dtype=np.int64)).tolist() == []
