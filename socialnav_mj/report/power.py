"""How many draws, and trainings, it takes to see a difference."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy.stats import t as student

from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import MEASURES, Columns, draw_means, groups, measured
from socialnav_mj.report.intervals import CONFIDENCE, LEAST, Components, reach

TARGETS = {col.SUCCESS: 0.05, col.TIME_UNDER_WAY: 1.0, col.INTRUSION_SHARE: 0.05, col.MINIMUM_DISTANCE: 0.05}
"""Measures and the differences that the report asks for, in the measure's unit."""
MOST_DRAWS = 100_000
MOST_TRAININGS = 1_000


def minimum_draws(
    spread: float, difference: float, *, confidence: float = CONFIDENCE, power: float = 0.5
) -> int | None:
    """Smallest number of draws that resolves a difference.

    The smallest n >= 2 with (t_a + t_b) spread / sqrt(n) <= difference, where t_a and t_b are Student's quantiles with
    n - 1 degrees of freedom at (1 + confidence) / 2 and at `power`. With power 0.5 (t_b = 0) it is the n whose interval
    reaches just `difference` to each side; a true difference of that size is then told from 0 in half of all studies.

    Args:
        spread: Standard deviation between draws of the draws' means, or of their paired differences, >= 0.
        difference: To be resolved, > 0, in the same unit.
        confidence: Of the interval, in (0, 1).
        power: Probability of telling a true difference of this size from 0, in [0.5, 1).

    Returns:
        Number of draws; None if more than `MOST_DRAWS` were needed.

    Raises:
        ValueError: If an argument is out of its range.
    """
    if not (spread >= 0.0 and np.isfinite(spread)):
        raise ValueError(f"spread = {spread} is not allowed; allowed: finite numbers >= 0")
    if not difference > 0.0:
        raise ValueError(f"difference = {difference} is not allowed; allowed: numbers > 0")
    if not (0.0 < confidence < 1.0 and 0.5 <= power < 1.0):
        raise ValueError(f"confidence = {confidence}, power = {power}; allowed: in (0, 1) and in [0.5, 1)")

    def reach(n: int) -> float:
        quantiles = student.ppf(0.5 * (1.0 + confidence), n - 1) + student.ppf(power, n - 1)
        return float(quantiles * spread / np.sqrt(n))

    low, high = 1, 2  # reach(n) falls with n: double, then halve the bracket
    while reach(high) > difference:
        low, high = high, 2 * high
        if high > MOST_DRAWS:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reach(middle) <= difference else (middle, high)
    return high


def sizes(most: int) -> NDArray[np.int64]:
    """Numbers of draws, or of trainings, that are tried.

    Args:
        most: The greatest, a power of ten >= 100.

    Returns:
        `intervals.LEAST` and all that follow to 100, then those of two digits and zeros.
    """
    digits, rounded = np.arange(11, 101), [10**k for k in range(1, round(np.log10(most)) - 1)]
    return np.concatenate([np.arange(LEAST, 101), *(digits * ten for ten in rounded)])


def resolved(components: Components, difference: float, *, trained: bool) -> NDArray[np.bool_]:
    """Whether studies of many sizes would tell a difference from 0, were it as large as the one at hand.

    Args:
        components: Of the study at hand.
        difference: Its mean, of either sign.
        trained: Whether there are trainings.

    Returns:
        For every one of `sizes(MOST_DRAWS)` (rows) and `sizes(MOST_TRAININGS)` (columns; one column if nothing learns)
        whether the interval is expected to leave out 0.
    """
    trainings = sizes(MOST_TRAININGS) if trained else np.ones(1, dtype=np.int64)
    return np.asarray(reach(components, sizes(MOST_DRAWS)[:, None], trainings) < abs(difference))


def fewest(resolves: NDArray[np.bool_], *, draws: int, trainings: int) -> tuple[int, int] | None:
    """The size with the fewest episodes, draws times trainings, that does not fall short of the study at hand.

    Args:
        resolves: Of `resolved`, or of several together.
        draws: Of the study at hand.
        trainings: Likewise; 0 if nothing learns.

    Returns:
        Draws and trainings (0 if nothing learns); None if no size of the table will do.
    """
    rows = sizes(MOST_DRAWS)
    columns = sizes(MOST_TRAININGS) if trainings else np.ones(1, dtype=np.int64)
    allowed = resolves & (rows >= draws)[:, None] & (columns >= trainings)
    if not allowed.any():
        return None
    episodes = np.where(allowed, rows[:, None] * columns, np.inf)
    row, column = np.unravel_index(int(episodes.argmin()), episodes.shape)
    return int(rows[row]), int(columns[column]) if trainings else 0


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """What a run says about how many draws two controllers need to be told apart by one measure."""

    dataset: str
    variant: str
    scenario: str
    controllers: tuple[str, str]
    measure: str
    spread: float
    """Standard deviation between draws of the paired difference."""
    n_draws: int
    """Draws that both have, at least 2."""
    difference: float
    """That is to be resolved."""
    draws: int | None
    """Whose 95 % interval reaches just that far; None if more than `MOST_DRAWS`."""
    draws_for_power: int | None
    """With which a true difference of that size is found in 80 % of studies; None likewise."""


def told(draws: int | None) -> str:
    """A number of draws as text.

    Args:
        draws: Of `minimum_draws`.

    Returns:
        Such as "12", or "> 100,000".
    """
    return f"> {MOST_DRAWS:,}" if draws is None else str(draws)


def told_size(size: tuple[int, int] | None) -> str:
    """A number of draws and trainings as text.

    Args:
        size: Of `fewest`.

    Returns:
        Such as "40 draws x 12 trainings", or "> 100,000 draws".
    """
    if size is None:
        return f"{told(None)} draws"
    draws, trainings = size
    return f"{draws:,} draws" + (f" x {trainings:,} trainings" if trainings else "")


def resolutions(agents: pa.Table, targets: dict[str, float] | None = None) -> list[Resolution]:
    """How many draws each two controllers need, from the spread of their paired differences in this run.

    Args:
        agents: Columns of `agents.SCHEMA`.
        targets: Measure of `estimates.MEASURES`: difference to be resolved; `TARGETS` if None.

    Returns:
        One for each scenario, two controllers that share at least 2 draws, and measure.

    Raises:
        ValueError: If a measure is unknown.
    """
    targets = TARGETS if targets is None else targets
    if unknown := sorted(set(targets) - set(MEASURES)):
        raise ValueError(f"unknown measure {unknown[0]!r}; available: {', '.join(MEASURES)}")
    found = []
    for (one, a, _), (two, b, _) in combinations(groups(agents), 2):
        if [one[k] for k in _PLACE] != [two[k] for k in _PLACE]:
            continue
        for measure, difference in targets.items():
            means, others = _draw_means(a, measure), _draw_means(b, measure)
            shared = sorted(means.keys() & others.keys())
            if len(shared) < 2:
                continue
            spread = float(np.std([means[d] - others[d] for d in shared], ddof=1))
            found.append(
                Resolution(
                    **{k: one[k] for k in _PLACE},
                    controllers=(one["controller"], two["controller"]),
                    measure=measure,
                    spread=spread,
                    n_draws=len(shared),
                    difference=difference,
                    draws=minimum_draws(spread, difference),
                    draws_for_power=minimum_draws(spread, difference, power=0.8),
                )
            )
    return found


_PLACE: Sequence[str] = ("dataset", "variant", "scenario")


def _draw_means(columns: Columns, measure: str) -> dict[int, float]:
    unit, means = draw_means(*measured(columns, MEASURES[measure]), columns[col.DRAW])
    return dict(zip(unit.tolist(), means.tolist(), strict=True))
