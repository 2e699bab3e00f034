"""The one interval: by hand on small tables, in its limits, and as often over the truth as it says."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interval_coverage import BEGIN, CASES, END, PAGE, TRAININGS, coverage, markdown
from scipy.stats import norm
from scipy.stats import t as student

from socialnav_mj.report.intervals import LEAST, Components, combined, components_of, interval_of, reach
from socialnav_mj.report.power import MOST_DRAWS, MOST_TRAININGS, fewest, minimum_draws, resolved, sizes, told_size

CROSSED = np.array([[1.0, 2.0, 6.0], [2.0, 5.0, 5.0], [3.0, 2.0, 1.0], [6.0, 7.0, 8.0]])
"""Means of rows 3, 4, 2, 7 and of columns 3, 4, 5 around 4."""


def test_interval_of_one_column_is_students():
    values = np.random.default_rng(3).standard_normal(12)
    interval = interval_of(values[:, None])
    half = 2.200985 * values.std(ddof=1) / np.sqrt(12)  # Student's 97.5 % quantile with 11 degrees of freedom
    assert interval.mean == pytest.approx(values.mean())
    assert (interval.low, interval.high) == pytest.approx((interval.mean - half, interval.mean + half))
    assert (interval.low, interval.high) == (interval.low_given, interval.high_given)


def test_three_draws_get_an_honest_interval():
    """Student's t with 2 degrees of freedom is 4.303; a bootstrap reaches no further than the extremes."""
    interval = interval_of(np.array([[0.0], [1.0], [2.0]]))
    assert interval.high - interval.mean == pytest.approx(4.302653 / math.sqrt(3.0))


def test_interval_of_crossed_draws_and_trainings_by_hand():
    """Rows vary by 14 / 3, columns by 1; the squared rests, by row 6, 2, 8 and 0, are 16 with 6 degrees of freedom."""
    of_cells = 16.0 / 6.0 / 12.0
    of_draws, of_trainings = 14.0 / 3.0 / 4.0, 1.0 / 3.0
    variance = of_draws + of_trainings - of_cells
    assert variance > max(of_draws, of_trainings)
    freedom = variance**2 / (of_draws**2 / 3 + of_trainings**2 / 2 + of_cells**2 / 6)
    half = student.ppf(0.975, freedom) * math.sqrt(variance)
    interval = interval_of(CROSSED, trained=True)
    assert (interval.low, interval.high) == pytest.approx((4.0 - half, 4.0 + half))
    given_half = student.ppf(0.975, 3) * math.sqrt(of_draws)
    assert (interval.low_given, interval.high_given) == pytest.approx((4.0 - given_half, 4.0 + given_half))
    assert (interval.n_draws, interval.n_trainings, interval.note) == (4, 3, "")


def test_variance_of_the_mean_counts_the_interaction_once():
    """10 x 5 cells of variance 1 and nothing else: the mean has variance 1 / 50; counted twice it would be 2 / 50."""
    cells = np.random.default_rng(1).standard_normal((4000, 10, 5))
    found = []
    for one in cells:
        parts = components_of(one)
        of_cells = parts.cell / 50
        rows, columns = one.mean(axis=1).var(ddof=1) / 10, one.mean(axis=0).var(ddof=1) / 5
        found.append((rows + columns - of_cells, float(combined(rows, columns, of_cells, 10, 5)[0])))
    unbiased, used = np.mean(found, axis=0)
    assert unbiased == pytest.approx(1 / 50, rel=0.05)
    assert 1 / 50 < used < 1.4 / 50  # never less than either part


def test_draws_and_trainings_may_be_exchanged():
    one, other = interval_of(CROSSED, trained=True), interval_of(CROSSED.T, trained=True)
    assert (one.low, one.high) == pytest.approx((other.low, other.high))


@given(shift=st.floats(-5, 5), factor=st.floats(0.1, 10))
def test_interval_moves_and_stretches_with_the_cells(shift, factor):
    one, other = interval_of(CROSSED, trained=True), interval_of(shift + factor * CROSSED, trained=True)
    assert (other.low, other.high) == pytest.approx((shift + factor * one.low, shift + factor * one.high))


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_share_of_nobody_or_everybody_gets_wilsons_bound_and_no_zero_width(share):
    """Wilson: z^2 / (n + z^2) of n = 430 agents, 0.0089; the rule of three would say 3 / 430 = 0.0070 to one side."""
    interval = interval_of(np.full((10, 1), share), agents=430)
    bound = 1.959964**2 / (430 + 1.959964**2)
    assert (interval.low, interval.high) == pytest.approx((0.0, bound) if share == 0.0 else (1.0 - bound, 1.0))
    assert interval.note == "all draws are equal: Wilson's interval of 430 agents"
    trained = interval_of(np.full((10, 3), share), trained=True, agents=430)
    assert (trained.low, trained.high) == (trained.low_given, trained.high_given) == (interval.low, interval.high)


def test_interval_of_a_share_is_wilsons_with_the_number_that_the_spread_is_worth():
    means = np.array([0.6, 0.7, 0.9, 0.8])
    variance = means.var(ddof=1) / 4
    n, t = 0.75 * 0.25 / variance, student.ppf(0.975, 3)
    interval = interval_of(means[:, None], agents=4)
    for end in (interval.low, interval.high):  # Wilson's ends solve (share - p)^2 = t^2 p (1 - p) / n
        assert (0.75 - end) ** 2 == pytest.approx(t**2 * end * (1.0 - end) / n)
    assert interval.low < 0.75 < interval.high


@given(
    shares=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=8),
    trainings=st.integers(1, 4),
    agents=st.integers(1, 1000),
)
def test_interval_of_a_share_holds_it_and_ends_at_0_and_1(shares, trainings, agents):
    cells = np.resize(shares, (len(shares), trainings))
    interval = interval_of(cells, trained=True, agents=agents)
    for low, high in ((interval.low, interval.high), (interval.low_given, interval.high_given)):
        assert 0.0 <= low <= interval.mean + 1e-12 and interval.mean - 1e-12 <= high <= 1.0 and low < high


def test_equal_draws_that_are_no_share_have_no_interval():
    interval = interval_of(np.full((5, 3), 2.0), trained=True)
    assert interval.mean == 2.0 and math.isnan(interval.low) and interval.note == "all draws are equal"


def test_missing_cells_are_left_out():
    cells = CROSSED.copy()
    cells[1, 2] = np.nan
    cells = np.vstack([cells, np.full(3, np.nan)])
    interval = interval_of(cells, trained=True)
    assert interval.n_draws == 4 and interval.mean == pytest.approx((48.0 - 5.0) / 11.0)
    assert interval.low < interval.mean < interval.high


def test_interval_says_why_there_is_none():
    assert interval_of(np.ones((2, 3)), trained=True).note == "2 draws; an interval needs 3"
    assert interval_of(np.full((5, 3), np.nan), trained=True).note == "no agent has a value"
    for n, count in ((1, "one training"), (2, "2 trainings")):
        few = interval_of(np.arange(5.0 * n).reshape(5, n), trained=True)
        assert few.note == f"{count}: the interval is for other draws alone"
        assert (few.low, few.high) == (few.low_given, few.high_given) and np.isfinite(few.low)


def test_components_add_up_to_the_variance_of_the_mean():
    parts = components_of(CROSSED)
    interval = interval_of(CROSSED, trained=True)
    half = 0.5 * (interval.high - interval.low)
    assert reach(parts, np.array([4]), np.array([3])) == pytest.approx([half])
    assert components_of(np.arange(4.0)[:, None]) == Components(draw=pytest.approx(5.0 / 3.0), training=0.0, cell=0.0)


def test_expected_reach_without_trainings_is_the_one_of_the_draws_command():
    parts = Components(draw=0.08**2, training=0.0, cell=0.0)
    n = minimum_draws(0.08, 0.05)
    found = fewest(resolved(parts, 0.05, trained=False), draws=3, trainings=0)
    assert found == (n, 0) and told_size(found) == f"{n} draws"


def test_fewest_is_the_smallest_study_that_resolves_and_no_smaller_than_the_one_at_hand():
    parts = Components(draw=0.03**2, training=0.03**2, cell=0.05**2)
    resolves = resolved(parts, 0.03, trained=True)
    draws, trainings = fewest(resolves, draws=10, trainings=3)
    assert float(reach(parts, np.array(draws), np.array(trainings))) < 0.03
    for d in range(10, 200):
        for t in range(3, 60):
            if d * t < draws * trainings:
                assert float(reach(parts, np.array(d), np.array(t))) >= 0.03, (d, t)
    assert fewest(resolves, draws=60, trainings=30) == (60, 30)


def test_what_no_study_would_tell_is_told_as_such():
    parts = Components(draw=1.0, training=1.0, cell=0.0)
    assert fewest(resolved(parts, 1e-3, trained=True), draws=10, trainings=3) is None
    assert told_size(None) == "> 100,000 draws" and told_size((1200, 12)) == "1,200 draws x 12 trainings"
    for most in (MOST_DRAWS, MOST_TRAININGS):
        tried = sizes(most)
        assert tried[0] == LEAST and tried[-1] == most and np.all(np.diff(tried) > 0)


def test_truth_of_the_made_studies_is_what_they_say():
    from interval_coverage import studies_of

    for case in CASES:
        if case.seconds:
            continue
        cells = studies_of(case, 1, 3, 4000, np.random.default_rng(2))
        error = cells.mean(axis=2).std() / math.sqrt(4000)
        assert cells.mean() == pytest.approx(case.share - (case.less or 0.0), abs=4.0 * error)


def stated():
    """Case: coverage of each number of draws and trainings, as docs/results.md says."""
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0].splitlines()
    ]
    sizes_of_rows = [tuple(int(n) for n in row[0].split(" x ")) for row in rows[2:]]
    return {
        name: {size: float(row[k]) for size, row in zip(sizes_of_rows, rows[2:], strict=True)}
        for k, name in enumerate(rows[0][1:], start=1)
    }


def test_docs_state_a_coverage_that_is_neither_short_nor_wasteful():
    found = stated()
    means = np.array(list(found.pop("mean").values()))
    assert list(found) == [case.name for case in CASES]
    every = np.array([list(cells.values()) for cells in found.values()])
    assert every.min() >= 0.925 and means.min() >= 0.945 and 0.95 <= every.mean() <= 0.97
    assert markdown(found).splitlines()[0] in PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_interval_covers_as_often_as_the_docs_state(case):
    """300 studies of each size: within 3.5 standard errors of the stated share."""
    cells = stated()[case.name]
    for size, expected in cells.items():
        error = math.sqrt(expected * (1.0 - expected) * (1 / 300 + 1 / 2000))
        assert coverage(case, *size, 300) == pytest.approx(expected, abs=3.5 * max(error, 0.003)), size
    assert {trainings for _, trainings in cells} == set(TRAININGS)


@pytest.mark.parametrize(("by_draw", "by_training", "within"), [(1.0, 0.0, 0.3), (0.3, 1.0, 0.3), (1.0, 1.0, 1.0)])
def test_intervals_cover_the_truth_about_as_often_as_they_say(by_draw, by_training, within):
    """10 draws, 5 trainings, 1000 studies: 95 % with a standard error of 0.7 %."""
    random = np.random.default_rng(5)
    covered = covered_given = 0
    for _ in range(1000):
        trainings = by_training * random.standard_normal((1, 5))
        cells = by_draw * random.standard_normal((10, 1)) + trainings + within * random.standard_normal((10, 5))
        interval = interval_of(cells, trained=True)
        covered += interval.low <= 0.0 <= interval.high
        covered_given += interval.low_given <= trainings.mean() <= interval.high_given
    assert 0.93 <= covered / 1000 <= 0.975
    assert 0.93 <= covered_given / 1000 <= 0.97


def test_normal_quantile_is_the_limit_of_many_draws():
    values = np.random.default_rng(4).standard_normal(4000)
    interval = interval_of(values[:, None])
    assert interval.high - interval.mean == pytest.approx(norm.ppf(0.975) * values.std() / math.sqrt(4000), rel=1e-3)
