"""Levels as cells of the tables in Markdown."""

from math import isnan

from socialnav_mj.studies.levels import Level


def mean_cell(level: Level | None, digits: int) -> str:
    """A mean.

    Args:
        level: None if there is none.
        digits: Behind the point.

    Returns:
        "-" where there is nothing to tell.
    """
    return "-" if level is None or isnan(level.interval.mean) else f"{level.interval.mean:.{digits}f}"


def interval_cell(level: Level | None) -> str:
    """A mean, and its interval for other draws and other trainings as far as there is one.

    Args:
        level: None if there is none.

    Returns:
        Three digits behind the point.
    """
    if level is None or isnan(level.interval.low):
        return mean_cell(level, 3)
    return f"{mean_cell(level, 3)} ({level.interval.low:.3f} to {level.interval.high:.3f})"
