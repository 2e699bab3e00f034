"""Which ranks a controller can have: differences that stand together, clustered by draw and training."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from socialnav_mj.geometry import Array
from socialnav_mj.report.intervals import CONFIDENCE, LEAST, combined, told_apart, variance_parts

RESAMPLES = 4000
"""Of the draws, and simulated studies."""


@dataclass(frozen=True, kw_only=True)
class Ranks:
    """What draws say of the order of k controllers."""

    lowest: NDArray[np.int64]
    """(k,) best rank that a controller can have, 1 for the first."""
    highest: NDArray[np.int64]
    """(k,) worst rank. All ranks together lie between these in 95 % of studies."""
    better: NDArray[np.bool_]
    """(k, k) the controller of the row is distinguishably better than that of the column."""
    improvement: Array
    """(k, k) share of draws in which the row's mean is better than the column's, ties half."""
    at_most: Array
    """(k, k) share of resampled studies in which the controller of the row has rank 1, at most 2, ..."""


def rank(cells: Array, *, more_is_better: bool, seed: int = 0) -> Ranks:
    """Order controllers by their means over the same agents of the same draws.

    All pairs are compared at once, each by its own paired t: beyond the quantile of the largest t of all pairs when
    nobody is better than anybody (`critical`), pairs are distinguishable together. A rank set counts who is
    distinguishably better and who is not distinguishably worse, as any simultaneous intervals allow (Mogstad et al.
    2024, Inference for Ranks with Applications to Mobility across Neighbourhoods and Academic Achievement across
    Countries, doi 10.1093/restud/rdad006). A difference that is the same in every draw says nothing of how it varies,
    and tells nobody apart. The probability of improvement is that of Agarwal et al. 2021 (arXiv 2108.13264), by draw.

    Where one of a pair learns, trainings are a second sample: the variance of the difference is that of
    `intervals.interval_of`, and the quantile becomes that of Student's t of the same probability, with its degrees of
    freedom.

    Args:
        cells: Of each draw, training and controller, shape (n_draws, n_trainings, k); of one that learns nothing the
            same in all trainings, of one with fewer trainings NaN in the others.
        more_is_better: Whether the greatest mean has rank 1.
        seed: Of the resamples.

    Returns:
        The ranks; every rank is possible for all if there are fewer than `intervals.LEAST` draws.
    """
    signed = cells if more_is_better else -cells
    values = np.nanmean(signed, axis=1)
    n_draws, k = values.shape
    gap = values[:, :, None] - values[:, None, :]
    improvement = ((gap > 0.0) + 0.5 * (gap == 0.0)).mean(axis=0)
    better = np.zeros((k, k), dtype=bool)
    weights = np.random.default_rng(seed).multinomial(n_draws, np.full(n_draws, 1.0 / n_draws), size=RESAMPLES)
    if n_draws >= LEAST and k > 1:
        mean = gap.mean(axis=0)
        spread = gap.std(axis=0, ddof=1) / np.sqrt(n_draws)
        beyond = critical(n_draws, k)
        threshold = np.full((k, k), beyond)
        for i, j in zip(*np.triu_indices(k, 1), strict=True):
            variance, quantile = _over_trainings(signed[:, :, i] - signed[:, :, j], beyond)
            spread[i, j] = spread[j, i] = max(spread[i, j], np.sqrt(variance))
            threshold[i, j] = threshold[j, i] = max(beyond, quantile)
        better = told_apart(mean, spread, threshold) & (mean > 0.0)
    resampled = _resampled(signed, weights, np.random.default_rng(seed + 1))
    place = 1 + (resampled[:, None, :] > resampled[:, :, None] + 1e-12).sum(axis=2)
    return Ranks(
        lowest=1 + better.sum(axis=0),
        highest=k - better.sum(axis=1),
        better=better,
        improvement=improvement,
        at_most=(place[:, :, None] <= np.arange(1, k + 1)).mean(axis=0),
    )


@lru_cache(maxsize=64)
def critical(n_draws: int, k: int) -> float:
    """How large the largest paired t of all pairs is in 95 % of studies of k controllers that are all alike.

    From simulated studies: means of draws are normal and of the same variance, as those of dozens of agents nearly are,
    and independent but for what all have in common, which falls out of differences. It is Tukey's studentised range
    with a variance for each pair in the place of a common one (Hochberg and Tamhane 1987, Multiple Comparison
    Procedures, doi 10.1002/9780470316672), and hardly another if variances differ tenfold (docs/results.md).

    Args:
        n_draws: At least 2.
        k: Controllers, at least 2.

    Returns:
        The quantile, the same at each call.
    """
    random = np.random.default_rng(0)
    one, other = np.triu_indices(k, 1)
    largest = []
    for _ in range(RESAMPLES // 100):
        means = random.normal(size=(100, n_draws, k))
        centre = means.mean(axis=1)
        rest = means - centre[:, None]
        covariance = rest.transpose(0, 2, 1) @ rest / (n_draws - 1)
        own = np.diagonal(covariance, axis1=1, axis2=2)
        variance = own[:, one] + own[:, other] - 2.0 * covariance[:, one, other]
        largest.append(np.abs((centre[:, one] - centre[:, other]) / np.sqrt(variance / n_draws)).max(axis=1))
    return float(np.quantile(np.concatenate(largest), CONFIDENCE))


def _over_trainings(gap: Array, beyond: float) -> tuple[float, float]:
    """Variance of a mean difference, cells (n_draws, n_trainings), and the quantile of t with its own freedom."""
    n_draws = len(gap)
    gap = gap[:, np.isfinite(gap).all(axis=0)]
    if gap.shape[1] < 2 or np.ptp(gap, axis=1).max() == 0.0:
        return 0.0, 0.0
    variance, freedom = combined(*variance_parts(gap), *gap.shape)
    return float(variance), float(stdtrit(freedom, stdtr(n_draws - 1.0, beyond)))


def _resampled(signed: Array, weights: NDArray[np.int64], random: np.random.Generator) -> Array:
    """Means of resampled studies, (RESAMPLES, k): draws are drawn for all controllers, trainings for each."""
    n_draws, n_trainings, k = signed.shape
    of_draws = np.tensordot(weights, np.nan_to_num(signed), axes=1) / n_draws
    if n_trainings == 1:
        return of_draws[:, 0]
    result = np.empty((len(weights), k))
    for column in range(k):
        there = np.flatnonzero(np.isfinite(signed[:, :, column]).all(axis=0))
        drawn = random.multinomial(len(there), np.full(len(there), 1.0 / len(there)), size=len(weights)) / len(there)
        result[:, column] = (of_draws[:, there, column] * drawn).sum(axis=1)
    return result
