"""How alike two rankings are, with an interval over draws."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from socialnav_mj.geometry import Array
from socialnav_mj.report.intervals import LEAST, TAIL, told_apart

EXPLAINED = """\
*Kendall's tau*: how alike two rankings of the controllers are, 1 for the same, -1 for the reverse; in brackets what \
it is if all pairs that draws do not tell apart in both rankings (paired t, 95 %) have changed over, and if none has; \
then how many of the pairs that they tell apart in both have changed over.\
"""
"""How pages explain it."""


@dataclass(frozen=True, kw_only=True)
class Tau:
    """Kendall's rank correlation of two rankings of the same controllers."""

    mean: float
    """Of the means over all draws; NaN if all controllers are equal."""
    low: float
    """If all pairs that draws do not tell apart in both rankings have changed over; NaN with fewer than `LEAST`."""
    high: float
    """If none has."""
    told_apart: int
    """Pairs that draws tell apart in both rankings."""
    turned_over: tuple[tuple[int, int], ...]
    """Those of them that have changed over: who has more in the first ranking, who in the second."""


def kendall(one: Array, two: Array) -> Tau:
    """Kendall's tau-b of the means of two sets of draws, and what it can be in the light of how draws vary.

    Noise changes pairs over that lie close together, so that the tau of means is less than that of the rankings behind
    them, and resampled draws make it less again: their interval does not hold what it is to hold. The interval here is
    of pairs: draws tell a pair apart in a ranking by its paired t (95 %); all others can have any order. That is
    cautious (docs/results.md has its simulated coverage).

    Args:
        one: Means of each draw and controller, shape (n_draws, k).
        two: The same draws and controllers.

    Returns:
        The correlation; draws in which a controller has no value are left out.
    """
    kept = np.isfinite(one).all(axis=1) & np.isfinite(two).all(axis=1)
    one, two = one[kept], two[kept]
    if not len(one):
        return Tau(mean=np.nan, low=np.nan, high=np.nan, told_apart=0, turned_over=())
    mean = float(tau_b(one.mean(axis=0), two.mean(axis=0)))
    if len(one) < LEAST:
        return Tau(mean=mean, low=np.nan, high=np.nan, told_apart=0, turned_over=())
    first, second = _orders(one), _orders(two)
    pairs = zip(*np.triu_indices(one.shape[1], 1), first, second, strict=True)
    turned_over = tuple((int(i), int(j)) if a > 0 else (int(j), int(i)) for i, j, a, b in pairs if a * b < 0)
    n_told_apart = int(np.count_nonzero(first * second))
    same = n_told_apart - len(turned_over)
    return Tau(
        mean=mean,
        low=min(2.0 * same / first.size - 1.0, mean),
        high=max(1.0 - 2.0 * len(turned_over) / first.size, mean),
        told_apart=n_told_apart,
        turned_over=turned_over,
    )


def _orders(values: Array) -> NDArray[np.int64]:
    """Sign of each pair's difference, 0 where draws do not tell it from nothing; shape (k (k - 1) / 2,)."""
    i, j = np.triu_indices(values.shape[1], 1)
    gap, n = values[:, i] - values[:, j], len(values)
    spread = gap.std(axis=0, ddof=1) / np.sqrt(n)
    mean = gap.mean(axis=0)
    return np.where(told_apart(mean, spread, float(stdtrit(n - 1, TAIL))), np.sign(mean), 0.0).astype(np.int64)


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
