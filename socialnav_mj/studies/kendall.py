"""How alike two rankings are, with an interval over draws."""

from dataclasses import dataclass

import numpy as np

from socialnav_mj.geometry import Array
from socialnav_mj.report.intervals import CONFIDENCE, LEAST

RESAMPLES = 2000
"""Of the draws."""


@dataclass(frozen=True, kw_only=True)
class Tau:
    """Kendall's rank correlation of two rankings of the same controllers."""

    mean: float
    """Of the means over all draws; NaN if all controllers are equal."""
    low: float
    """2.5 % of resampled draws; NaN with fewer than `LEAST` draws."""
    high: float


def kendall(one: Array, two: Array, *, seed: int = 0) -> Tau:
    """Kendall's tau-b of the means of two sets of draws, with the interval of a bootstrap over the draws.

    Args:
        one: Means of each draw and controller, shape (n_draws, k).
        two: The same draws and controllers.
        seed: Of the resamples, which take the same draws of both.

    Returns:
        The correlation; draws in which a controller has no value are left out.
    """
    kept = np.isfinite(one).all(axis=1) & np.isfinite(two).all(axis=1)
    one, two = one[kept], two[kept]
    n = len(one)
    if not n:
        return Tau(mean=np.nan, low=np.nan, high=np.nan)
    mean = float(tau_b(one.mean(axis=0), two.mean(axis=0)))
    if n < LEAST:
        return Tau(mean=mean, low=np.nan, high=np.nan)
    weights = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES)
    again = tau_b(weights @ one, weights @ two)
    again = again[np.isfinite(again)]
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = np.quantile(again, (tail, 1.0 - tail)) if again.size else (np.nan, np.nan)
    return Tau(mean=mean, low=float(low), high=float(high))


def tau_b(one: Array, two: Array) -> Array:
    """Kendall's tau-b of many pairs of lists at once (Kendall 1945, doi:10.1093/biomet/33.3.239).

    Args:
        one: Values, shape (..., k); those that differ by rounding alone are equal.
        two: As many.

    Returns:
        Shape (...); NaN where all values of one list are equal.
    """
    i, j = np.triu_indices(one.shape[-1], 1)
    first, second = (np.sign(values[..., i] - values[..., j]) for values in (one.round(9), two.round(9)))
    untied = np.count_nonzero(first, axis=-1) * np.count_nonzero(second, axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray((first * second).sum(axis=-1) / np.sqrt(untied))
