"""Means and intervals as text of table cells."""

from math import isnan

from socialnav_mj.report.markdown import Sign, interval, number
from socialnav_mj.studies.kendall import Tau
from socialnav_mj.studies.levels import Level


def mean_cell(level: Level | None, digits: int) -> str:
    """A mean with a given number of digits.

    Args:
        level: None if there is none.
        digits: Behind the point.

    Returns:
        Such as "0.681"; "-" if the level is None or its mean NaN.
    """
    return "-" if level is None else number(level.interval.mean, digits)


def interval_cell(level: Level | None, sign: Sign = "") -> str:
    """A mean, and its interval for other draws and other trainings as far as there is one.

    Args:
        level: None if there is none.
        sign: "+" to write the sign of what is positive too.

    Returns:
        Three digits behind the point; "-" where there is nothing to tell.
    """
    return "-" if level is None else interval(level.interval.mean, level.interval.low, level.interval.high, 3, sign)


def tau_cell(tau: Tau) -> str:
    """A rank correlation, its interval, and the pairs behind it.

    Args:
        tau: NaN if there is none.

    Returns:
        Such as "0.82 (0.37 to 1.00); 2 of 62"; without pairs where draws are too few for an interval.
    """
    cell = interval(tau.mean, tau.low, tau.high, 2)
    return cell if isnan(tau.low) else f"{cell}; {tau.turned_over} of {tau.told_apart}"
