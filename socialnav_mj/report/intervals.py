"""The one interval of all tables: for the mean of draws, and of draws crossed with trainings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from socialnav_mj.geometry import Array

CONFIDENCE = 0.95
LEAST = 3
"""Fewer draws give no interval, and fewer trainings none for other trainings."""
ONE_RECORDING = "All intervals are over draws of one recording: they say nothing about another crowd."
"""What every page with intervals says."""
TAIL = 0.5 * (1.0 + CONFIDENCE)
"""Probability below the upper end of an interval."""
_STILL = 1e-12


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


@dataclass(frozen=True, kw_only=True)
class Components:
    """Where the deviations of cells from their mean come from (two crossed random effects)."""

    draw: float
    """Variance of what all trainings have in common in a draw."""
    training: float
    """Variance of what a training has in common in all draws."""
    cell: float
    """Variance of the rest: one training in one draw."""


def interval_of(cells: Array, *, trained: bool = False, agents: int | None = None) -> Interval:
    """Mean of cells by draw and training, with its 95 % interval.

    Rows (draws) and columns (trainings) are crossed random effects. The variance of the mean is

        V = V_draw + V_training - V_cell,

    V_draw = var(row means) / n_draws, V_training = var(column means) / n_trainings, V_cell = mean square of the
    interaction / n_cells, which the other two both contain (Owen, The Annals of Applied Statistics 1 (2007) 386-411,
    shows why it must not count twice); never less than V_draw or V_training. The interval is mean +- t(df) sqrt(V) with
    Satterthwaite's df = V^2 / sum(V_i^2 / df_i). Of one column it is Student's interval of the draws' means.

    A share lies in [0, 1]: its interval is Wilson's, with the effective number p (1 - p) / V in place of the number of
    agents and the same t (Korn and Graubard, Survey Methodology 24 (1998) 193-201, do so for shares in clusters).
    Where all draws have the same share, as with 0 and 1, V says nothing and the number is that of the agents.

    docs/results.md has the simulated coverage.

    Args:
        cells: Mean of each draw and training, shape (n_draws, n_trainings); NaN where there is none.
        trained: Whether the columns are trainings; else there is one column.
        agents: If the cells are shares: agents that have a value, of all draws and one training.

    Returns:
        The interval. No interval if there are fewer than `LEAST` draws, or if all draws are equal and no share.
    """
    cells = cells[np.isfinite(cells).any(axis=1)][:, np.isfinite(cells).any(axis=0)]
    n_draws, n_trainings = cells.shape
    counted = n_trainings if trained else 0
    if not cells.size:
        return _without(float("nan"), 0, 0, "no agent has a value")
    mean = float(np.nanmean(cells))
    if n_draws < LEAST:
        count = f"{n_draws} draw{'s' if n_draws > 1 else ''}"
        return _without(mean, n_draws, counted, f"{count}; an interval needs {LEAST}")
    parts = variance_parts(cells)
    given = _ends(mean, *combined(parts[0], 0.0, 0.0, n_draws, 1), agents)
    both, note = given, ""
    if trained and n_trainings >= LEAST:
        both = _ends(mean, *combined(*parts, n_draws, n_trainings), agents)
    elif trained:
        count = "one training" if n_trainings == 1 else f"{n_trainings} trainings"
        note = f"{count}: the interval is for other draws alone"
    if parts[0] <= _nothing(mean):
        note = "all draws are equal" + ("" if agents is None else f": Wilson's interval of {agents} agents")
    return Interval(
        mean=mean,
        low=both[0],
        high=both[1],
        low_given=given[0],
        high_given=given[1],
        n_draws=n_draws,
        n_trainings=counted,
        note=note,
    )


def told_apart(difference: Array, spread: Array, quantile: Array | float) -> NDArray[np.bool_]:
    """Which differences draws tell from nothing; one that is the same in every draw says nothing of how it varies.

    Args:
        difference: Means, any shape.
        spread: Their standard errors, of that shape.
        quantile: Of t, beyond which they are told from nothing.

    Returns:
        Of that shape.
    """
    told: NDArray[np.bool_] = (spread > _STILL) & (np.abs(difference) > quantile * spread)
    return told


def combined(
    of_draws: Array | float,
    of_trainings: Array | float,
    of_cells: Array | float,
    n_draws: NDArray[np.int64] | int,
    n_trainings: NDArray[np.int64] | int,
) -> tuple[Array, Array]:
    """Variance of a mean and its degrees of freedom, from its parts.

    Args:
        of_draws: V_draw, see `interval_of`; any shape, as the others.
        of_trainings: V_training.
        of_cells: V_cell.
        n_draws: At least 2.
        n_trainings: 1 for no trainings: the other two parts are then left out.

    Returns:
        Variance and degrees of freedom, of the arguments' common shape.
    """
    crossed = np.asarray(n_trainings) > 1
    of_trainings, of_cells = np.where(crossed, of_trainings, 0.0), np.where(crossed, of_cells, 0.0)
    of_draws = np.asarray(of_draws, dtype=float)
    variance = np.maximum(of_draws + of_trainings - of_cells, np.maximum(of_draws, of_trainings))
    columns = np.maximum(n_trainings - 1.0, 1.0)
    uncertainty = of_draws**2 / (n_draws - 1.0) + of_trainings**2 / columns + of_cells**2 / ((n_draws - 1.0) * columns)
    least = np.where(crossed, np.minimum(n_draws - 1.0, columns), n_draws - 1.0)
    freedom = np.divide(variance**2, uncertainty, out=np.zeros(np.shape(variance)), where=uncertainty > 0.0)
    return variance, np.maximum(freedom, least)


def components_of(cells: Array) -> Components:
    """Variances of draws, trainings and the rest, estimated without bias but for the floor at 0.

    Args:
        cells: As `interval_of` takes them, with at least two draws that have a value.

    Returns:
        Variances in the unit of the cells squared; those of training and cell are 0 for one column.
    """
    cells = cells[np.isfinite(cells).any(axis=1)][:, np.isfinite(cells).any(axis=0)]
    n_draws, n_trainings = cells.shape
    of_draws, of_trainings, of_cells = variance_parts(cells)
    cell = of_cells * n_draws * n_trainings
    return Components(
        draw=max(of_draws * n_draws - cell / n_trainings, 0.0),
        training=max(of_trainings * n_trainings - cell / n_draws, 0.0),
        cell=cell,
    )


def reach(components: Components, n_draws: NDArray[np.int64], n_trainings: NDArray[np.int64]) -> Array:
    """How far the interval of a study of some size is expected to go to each side.

    Args:
        components: Of the study at hand.
        n_draws: Any shape.
        n_trainings: 1 for no trainings.

    Returns:
        t(df) sqrt(V) with the parts' expectations, of the arguments' common shape.
    """
    of_cells = components.cell / (n_draws * n_trainings)
    parts = (components.draw / n_draws + of_cells, components.training / n_trainings + of_cells, of_cells)
    variance, freedom = combined(*parts, n_draws, n_trainings)
    return np.asarray(stdtrit(freedom, TAIL) * np.sqrt(variance))


def variance_parts(cells: Array) -> tuple[float, float, float]:
    """V_draw, V_training and V_cell of `interval_of`.

    Args:
        cells: Mean of each draw and training, shape (n_draws, n_trainings), n_draws >= 2; NaN cells are left out.

    Returns:
        Variances; the latter two are 0 for one column.
    """
    n_draws, n_trainings = cells.shape
    rows, columns = np.nanmean(cells, axis=1), np.nanmean(cells, axis=0)
    of_draws = float(rows.var(ddof=1)) / n_draws
    if n_trainings < 2:
        return of_draws, 0.0, 0.0
    rest = cells - rows[:, None] - columns + np.nanmean(cells)
    n_cells = int(np.isfinite(cells).sum())
    freedom = n_cells - n_draws - n_trainings + 1
    of_cells = float(np.nansum(rest**2)) / freedom / n_cells if freedom > 0 else 0.0
    return of_draws, float(columns.var(ddof=1)) / n_trainings, of_cells


def _ends(mean: float, variance: Array, freedom: Array, agents: int | None) -> tuple[float, float]:
    if agents is not None:
        return _wilson(min(max(mean, 0.0), 1.0), float(variance), float(freedom), agents)
    if variance <= _nothing(mean):
        return float("nan"), float("nan")
    half = float(stdtrit(freedom, TAIL) * np.sqrt(variance))
    return mean - half, mean + half


def _wilson(share: float, variance: float, freedom: float, agents: int) -> tuple[float, float]:
    spread = share * (1.0 - share)
    known = spread > 0.0 and variance > _nothing(share)
    number = spread / variance if known else float(agents)
    quantile = float(stdtrit(freedom if known else np.inf, TAIL))
    middle = (share + quantile**2 / (2.0 * number)) / (1.0 + quantile**2 / number)
    half = quantile * np.sqrt(spread / number + (0.5 * quantile / number) ** 2) / (1.0 + quantile**2 / number)
    return max(0.0, float(middle - half)), min(1.0, float(middle + half))


def _nothing(mean: float) -> float:
    """A variance that is rounding and no spread."""
    return (1e-12 * max(1.0, abs(mean))) ** 2


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
