"""Means over draws and trainings, with bootstrap intervals for other draws and other trainings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from socialnav_mj.geometry import Array
from socialnav_mj.report.estimates import CONFIDENCE, MINIMUM_DRAWS

N_RESAMPLES = 4999


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A mean with its 95 % intervals; NaN where there is none."""

    mean: float
    low: float
    """For other draws and other trainings."""
    high: float
    low_given: float
    """For other draws of the trainings at hand."""
    high_given: float
    n_draws: int
    """Draws that have a value."""
    n_trainings: int
    """Trainings that have a value; 0 if nothing learns."""
    note: str
    """Why an interval is missing or special; else empty."""


def two_way_interval(cells: Array, *, trained: bool) -> Interval:
    """Mean of cells by draw and training, with bootstrap intervals clustered by both.

    Draws are resampled with replacement, and, apart from them, trainings. The deviations of both from the mean are
    stretched by sqrt(n / (n - 1)) t(n - 1) / z, so that a bootstrap over three trainings is not too narrow: a bootstrap
    of a mean of n values falls short of the unbiased variance by (n - 1) / n, and of Student's quantile t by the normal
    z (Hesterberg, The American Statistician 69 (2015) 371-386, widens percentile intervals for the same two reasons).
    Then they are added, which counts the interaction of draw and training twice: a little too wide, as every bootstrap
    of crossed factors is (Owen and Eckles 2012, doi 10.1214/12-AOAS547).

    Args:
        cells: Mean of each draw and training, shape (n_draws, n_trainings); NaN where there is none.
        trained: Whether the columns are trainings; else there is one column.

    Returns:
        The interval; the same for the same cells.
    """
    cells = cells[np.isfinite(cells).any(axis=1)][:, np.isfinite(cells).any(axis=0)]
    n_draws, n_trainings = cells.shape
    nan = float("nan")
    if not cells.size:
        return _without(nan, 0, 0, "no agent has a value")
    mean = float(np.nanmean(cells))
    counted = n_trainings if trained else 0
    if n_draws < MINIMUM_DRAWS:
        return _without(mean, n_draws, counted, f"{n_draws} draw(s); an interval needs {MINIMUM_DRAWS}")
    random = np.random.default_rng(0)
    by_draw = _deviations(cells, random)
    note, both = "", by_draw
    if trained and n_trainings > 1:
        both = by_draw + _deviations(cells.T, random)
    elif trained:
        note = "one training: the interval is for other draws alone"
    tails = (50.0 * (1.0 - CONFIDENCE), 50.0 * (1.0 + CONFIDENCE))
    low, high = mean + np.percentile(both, tails)
    low_given, high_given = mean + np.percentile(by_draw, tails)
    return Interval(
        mean=mean,
        low=float(low),
        high=float(high),
        low_given=float(low_given),
        high_given=float(high_given),
        n_draws=n_draws,
        n_trainings=counted,
        note=note,
    )


def _without(mean: float, n_draws: int, n_trainings: int, note: str) -> Interval:
    nan = float("nan")
    return Interval(
        mean=mean,
        low=nan,
        high=nan,
        low_given=nan,
        high_given=nan,
        n_draws=n_draws,
        n_trainings=n_trainings,
        note=note,
    )


def _deviations(cells: Array, random: np.random.Generator) -> Array:
    """How much the mean moves when rows are drawn with replacement, stretched; shape (N_RESAMPLES,)."""
    n = len(cells)
    weight: NDArray[np.float64] = random.multinomial(n, np.full(n, 1.0 / n), size=N_RESAMPLES).astype(float)
    heap, mass = weight @ np.nansum(cells, axis=1), weight @ np.isfinite(cells).sum(axis=1)
    stretch = np.sqrt(n / (n - 1)) * student.ppf(0.5 + 0.5 * CONFIDENCE, n - 1) / norm.ppf(0.5 + 0.5 * CONFIDENCE)
    return stretch * (heap / mass - np.nanmean(cells))
