"""Labels of slope charts do not overlap, and stay as near to their lines as they can."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialnav_mj.studies.looks import LOOKS, looks_of
from socialnav_mj.studies.panel import MIXED
from socialnav_mj.studies.slopes import spread_apart


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=15))
def test_labels_do_not_overlap_and_keep_the_order_of_their_lines(values: list[float]) -> None:
    places = spread_apart(np.array(values), 0.05, low=0.0, high=1.0)
    order = np.argsort(values, kind="stable")
    assert (np.diff(places[order]) >= 0.05 - 1e-9).all()
    assert places.min() >= -1e-9
    assert places.max() <= 1.0 + 1e-9


def test_labels_with_room_are_level_with_their_lines() -> None:
    assert spread_apart(np.array([0.7, 0.2, 0.4]), 0.1, low=0.0, high=1.0) == pytest.approx([0.7, 0.2, 0.4])


def test_two_lines_that_meet_have_their_labels_on_both_sides() -> None:
    assert spread_apart(np.array([0.5, 0.5]), 0.1, low=0.0, high=1.0) == pytest.approx([0.45, 0.55])
    assert spread_apart(np.array([1.0, 1.0]), 0.1, low=0.0, high=1.0) == pytest.approx([0.9, 1.0])


def test_the_papers_methods_look_the_same_in_all_figures_and_nobody_else_looks_like_them() -> None:
    looks = looks_of(["mpc", "hybrid", "orca", "replay_irl"])
    assert looks["hybrid"] == LOOKS[MIXED]
    assert looks["replay_irl"] == LOOKS["replay_irl"]
    assert len({(look.colour, look.marker, look.line) for look in looks.values()}) == 4
