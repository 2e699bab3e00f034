"""Figures that describe a recorded crowd."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.companions import companions_of, pairs_of, sample_times, steps_of
from socialnav_mj.recordings.curves import MOVING_SPEED
from socialnav_mj.recordings.recording import Recording

SPEED_PERCENTILES = (5, 25, 50, 75, 95)
NEIGHBOUR_PERCENTILES = (5, 25, 50, 75)
CLOSE_DISTANCES = (0.25, 0.32, 0.4)
"""Sums of two body radii for which the recorded people themselves are scored [m]."""
NEIGHBOURHOODS = (1.2, 2.0)
"""The paper's intimate and switch distances [m]."""


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Figures of a recording, sampled every 0.2 s; a person-step is one person present at one of these times."""

    n_people: int
    duration: float
    """Until the last person leaves [s]."""
    extent: tuple[float, float]
    """Of all samples in x and y [m]."""
    mean_present: float
    """People present at a time, on average."""
    max_present: int
    speed: Mapping[int, float]
    """Percentile of the speed over all person-steps [m/s]."""
    moving_speed: Mapping[int, float]
    """The same over the person-steps at 0.1 m/s or more [m/s]."""
    standing_share: float
    """Share of person-steps slower than 0.1 m/s."""
    nearest_neighbour: Mapping[int, float]
    """Percentile of the distance to the nearest other person, over person-steps with somebody else present [m]."""
    neighbour_within: Mapping[float, float]
    """Distance [m]: share of all person-steps with somebody nearer."""
    closer_than: Mapping[float, float]
    """Distance [m]: share of people who ever come closer to somebody."""
    n_companion_pairs: int
    """Pairs who walk together, by the rule of `companions.companions`."""
    n_companion_people: int
    """People in at least one of the pairs."""
    n_displaced_less_than_1m: int
    """People whose end is nearer than 1 m to their start; they are never replaced."""


def facts(recording: Recording) -> Facts:
    """Size, speeds, distances and companions of a recorded crowd.

    Args:
        recording: Sampled every 0.2 s from its first appearance to its end.

    Returns:
        One number or one set of percentiles each; percentiles of nothing (nobody ever meets) are NaN.
    """
    times = sample_times(recording)
    steps = steps_of(recording, times)
    pairs = pairs_of(steps)
    present = np.bincount(steps.row, minlength=len(times))
    speed = np.hypot(*steps.velocity.T)
    # Distance to the nearest other person at each person-step, and at all of a person; inf if it is always alone.
    nearest = np.full(len(steps.row), np.inf)
    closest = np.full(recording.n_people, np.inf)
    for one in (pairs.first, pairs.second):
        np.minimum.at(nearest, one, pairs.distance)
    np.minimum.at(closest, steps.person, nearest)
    together = companions_of(steps, pairs)
    x = np.concatenate(recording.positions)
    displacement = np.hypot(*(recording.end - recording.start).T)
    width, height = np.ptp(x, axis=0)
    return Facts(
        n_people=recording.n_people,
        duration=recording.duration,
        extent=(float(width), float(height)),
        mean_present=float(present.mean()),
        max_present=int(present.max()),
        speed=_percentiles(speed, SPEED_PERCENTILES),
        moving_speed=_percentiles(speed[speed >= MOVING_SPEED], SPEED_PERCENTILES),
        standing_share=float((speed < MOVING_SPEED).mean()),
        nearest_neighbour=_percentiles(nearest[np.isfinite(nearest)], NEIGHBOUR_PERCENTILES),
        neighbour_within={d: float((nearest < d).mean()) for d in NEIGHBOURHOODS},
        closer_than={d: float((closest < d).mean()) for d in CLOSE_DISTANCES},
        n_companion_pairs=len(together),
        n_companion_people=len(np.unique(together)),
        n_displaced_less_than_1m=int((displacement < 1.0).sum()),
    )


def facts_table(recordings: Mapping[str, Facts]) -> str:
    """Facts side by side as a Markdown table.

    Args:
        recordings: Column head: facts.

    Returns:
        A header, and one row a figure, percentiles on one row.
    """
    columns = [_cells(one) for one in recordings.values()]
    lines = ["| | " + " | ".join(recordings) + " |", "|---" * (len(columns) + 1) + "|"]
    lines += [f"| {head} | " + " | ".join(cells[head] for cells in columns) + " |" for head in columns[0]]
    return "\n".join(lines)


def _cells(f: Facts) -> dict[str, str]:
    def row(values: Mapping[int, float] | Mapping[float, float]) -> str:
        return " / ".join(f"{value:.2f}" for value in values.values())

    def percent(values: Mapping[float, float]) -> str:
        return " / ".join(f"{100.0 * value:.0f}" for value in values.values())

    def head(values: tuple[float, ...]) -> str:
        return "/".join(f"{value:g}" for value in values)

    return {
        "people": f"{f.n_people}",
        "duration [s]": f"{f.duration:.1f}",
        "extent [m]": f"{f.extent[0]:.1f} x {f.extent[1]:.1f}",
        "present at a time, mean": f"{f.mean_present:.1f}",
        "present at a time, most": f"{f.max_present}",
        f"speed, percentiles {head(SPEED_PERCENTILES)} [m/s]": row(f.speed),
        f"the same when moving (>= {MOVING_SPEED} m/s)": row(f.moving_speed),
        "person-steps slower than that [%]": f"{100.0 * f.standing_share:.0f}",
        f"nearest neighbour, percentiles {head(NEIGHBOUR_PERCENTILES)} [m]": row(f.nearest_neighbour),
        f"person-steps with somebody within {head(NEIGHBOURHOODS)} m [%]": percent(f.neighbour_within),
        f"people who come closer to somebody than {head(CLOSE_DISTANCES)} m [%]": percent(f.closer_than),
        "companions: pairs": f"{f.n_companion_pairs}",
        "companions: people": f"{f.n_companion_people}",
        "people displaced less than 1 m": f"{f.n_displaced_less_than_1m}",
    }


def _percentiles(values: Array, percentiles: tuple[int, ...]) -> dict[int, float]:
    if not values.size:
        return dict.fromkeys(percentiles, float("nan"))
    return {p: float(q) for p, q in zip(percentiles, np.percentile(values, percentiles), strict=True)}
