"""Means and intervals as text of table cells."""

from socialnav_mj.report.markdown import Sign, interval, number
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
