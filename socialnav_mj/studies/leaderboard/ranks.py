"""Which ranks a controller can have: differences that stand together, clustered by draw and training."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from socialnav_mj.geometry import Array
from socialnav_mj.report.intervals import CONFIDENCE, LEAST, combined, variance_parts

RESAMPLES = 4000
"""Of the draws."""


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

    All pairs are compared at once: from resampled draws comes the quantile of the largest of all studentised
    differences, and pairs beyond it are distinguishable together (Mogstad et al. 2024, Inference for Ranks with
    Applications to Mobility across Neighbourhoods and Academic Achievement across Countries, doi
    10.1093/restud/rdad006). A rank set counts who is distinguishably better and who is not distinguishably worse. The
    probability of improvement is that of Agarwal et al. 2021 (arXiv 2108.13264), by draw.

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
    if n_draws >= LEAST:
        mean = gap.mean(axis=0)
        spread = np.maximum(gap.std(axis=0, ddof=1) / np.sqrt(n_draws), 1e-12)
        critical = _critical(gap, weights, mean)
        threshold = np.full((k, k), critical)
        for i, j in zip(*np.triu_indices(k, 1), strict=True):
            variance, quantile = _over_trainings(signed[:, :, i] - signed[:, :, j], critical)
            spread[i, j] = spread[j, i] = max(spread[i, j], np.sqrt(variance))
            threshold[i, j] = threshold[j, i] = max(critical, quantile)
        better = mean / spread > threshold
    resampled = _resampled(signed, weights, np.random.default_rng(seed + 1))
    place = 1 + (resampled[:, None, :] > resampled[:, :, None] + 1e-12).sum(axis=2)
    return Ranks(
        lowest=1 + better.sum(axis=0),
        highest=k - better.sum(axis=1),
        better=better,
        improvement=improvement,
        at_most=(place[:, :, None] <= np.arange(1, k + 1)).mean(axis=0),
    )


def _over_trainings(gap: Array, critical: float) -> tuple[float, float]:
    """Variance of a mean difference, cells (n_draws, n_trainings), and the quantile of t in place of the normal one."""
    gap = gap[:, np.isfinite(gap).all(axis=0)]
    if gap.shape[1] < 2 or np.ptp(gap, axis=1).max() == 0.0:
        return 0.0, 0.0
    variance, freedom = combined(*variance_parts(gap), *gap.shape)
    return float(variance), float(stdtrit(freedom, ndtr(critical)))


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


def _critical(gap: Array, weights: NDArray[np.int64], mean: Array) -> float:
    """Quantile of the largest studentised deviation of all pairs over resampled draws."""
    n_draws = len(gap)
    upper = np.triu_indices(gap.shape[1], 1)
    pairs = gap[:, upper[0], upper[1]]
    again = weights @ pairs / n_draws
    variance = np.maximum(weights @ pairs**2 / n_draws - again**2, 0.0) * n_draws / (n_draws - 1)
    spread = np.sqrt(variance / n_draws)
    # Resamples of few draws can be all alike: their spread is no smaller than a tenth of that of the draws.
    least = 0.1 * pairs.std(axis=0, ddof=1) / np.sqrt(n_draws)
    deviation = np.abs(again - mean[upper]) / np.maximum(np.maximum(spread, least), 1e-12)
    return float(np.quantile(deviation.max(axis=1, initial=0.0), CONFIDENCE))
