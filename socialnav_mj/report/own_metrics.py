"""Metrics of users: functions of an Episode that are named on the command line or offered by installed packages."""

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, EpisodeError
from socialnav_mj.metrics.metric import Better, Metric
from socialnav_mj.metrics.missing import NEVER
from socialnav_mj.metrics.registry import METRICS, check_metrics

ENTRY_POINT_GROUP = "socialnav_mj.metrics"


@dataclass(frozen=True)
class _Checked:
    """A user's function, with an error that says where it went wrong."""

    name: str
    function: Callable[[Episode], Any]

    def __call__(self, episode: Episode) -> NDArray[np.float64]:
        try:
            values = np.asarray(self.function(episode), dtype=float)
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{frame.filename}:{frame.lineno}"
            raise EpisodeError(f"metric {self.name!r} fails: {type(error).__name__}: {error} ({place})") from error
        if values.shape != (episode.n_agents,):
            raise EpisodeError(
                f"metric {self.name!r} gives shape {values.shape}; expected ({episode.n_agents},), a number for each "
                "agent, NaN where it has none"
            )
        return values


def is_offered(spec: str) -> bool:
    """Whether an installed package offers a metric of this name.

    Args:
        spec: As `own_metrics` takes it.

    Returns:
        False for a path as well.
    """
    return any(entry.name == spec for entry in entry_points(group=ENTRY_POINT_GROUP))


def own_metrics(specs: Sequence[str]) -> tuple[Metric, ...]:
    """Import metrics; this runs their modules' code.

    Args:
        specs: "package.module:function", or the name of an entry point of the group `socialnav_mj.metrics`. What is
            there is a function of an Episode that gives a number for each agent, or a `Metric` around one.

    Returns:
        In their order, with names of their own beside the project's.

    Raises:
        ValueError: If one cannot be imported, is neither, or has a name that there is already.
    """
    found = tuple(_own_metric(spec) for spec in specs)
    check_metrics((*METRICS, *found))
    return found


def _own_metric(spec: str) -> Metric:
    offered = {entry.name: entry.value for entry in entry_points(group=ENTRY_POINT_GROUP)}
    module, colon, attribute = offered.get(spec, spec).partition(":")
    if not colon:
        raise ValueError(
            f"unknown metric {spec!r}; expected package.module:function"
            + (f", or one of {', '.join(sorted(offered))}" if offered else "")
        )
    try:
        given = attrgetter(attribute)(import_module(module))
    except (ImportError, AttributeError, ValueError, SyntaxError) as error:
        raise ValueError(f"metric {spec!r} cannot be imported: {error}; expected package.module:function") from error
    if isinstance(given, Metric):
        return given
    if not callable(given):
        raise ValueError(f"metric {spec!r} is a {type(given).__name__}; expected a function of an Episode, or a Metric")
    name = attribute.rpartition(".")[2]
    formula = (getattr(given, "__doc__", None) or name).strip().splitlines()[0]
    return Metric(name=name, function=_Checked(name, given), formula=formula, better=Better.NEITHER, missing=NEVER)
