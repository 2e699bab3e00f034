"""How the file of a recording is read, where it does not say so itself, and what no recording is allowed to be."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any, Literal, get_args

AxisOrder = Literal["xy", "yx"]

COLUMNS = ("frame", "id", "x", "y")
"""What a table has to say of each position."""
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Length of named units [m]."""
FRAME_RATES = (1e-3, 1e6)
"""Lowest and highest frame rate; beyond them times lose their precision [Hz]."""
_SETTINGS = ("axis_order", "columns", "since", "units", "until")
LONGEST = 1e9
"""What the bounds on time can be lifted to; up to here a microsecond is told from the next [s]."""


def _require_number(name: str, given: Any, low: float, high: float) -> None:
    """Refuse what is no number in (0, high] of at least low."""
    is_number = isinstance(given, Real) and not isinstance(given, bool) and isfinite(given)
    if not (is_number and low <= given <= high and given > 0.0):
        allowed = f"numbers from {low:g} to {high:g}" if low else f"numbers > 0 up to {high:g}"
        raise ValueError(f"{name} = {given!r} is not allowed; allowed: {allowed}")


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How a recording is read where neither the catalogue nor its file says so, and bounds on what it may hold.

    Raises:
        ValueError: If a value is not allowed.
    """

    frame_rate: float | None = None
    """Frames a second; by default what the catalogue or the file states, else 25 [Hz]."""
    columns: tuple[str, ...] = ()
    """What the columns of a table are, such as: frame id x y. Any other word stands for a column that is not read. By
    default the table's header says it; without a header they are frame id x y."""
    units: str = "m"
    """Unit of the positions (of a vsp: of what its homography gives): m, cm, mm, or its length in metres."""
    axis_order: AxisOrder | None = None
    """Whether the homography of a vsp takes (x, y) or (y, x); by default what the catalogue states, else xy."""
    since: float | None = None
    """Read only what happens from then on, which becomes time 0; whoever is there then enters there; by default all
    [s]."""
    until: float | None = None
    """Read only what happens before; whoever is there then leaves there; by default all [s]."""
    max_duration: float = 86400.0
    """Longer recordings are refused: a wrong frame number makes one [s]."""
    max_gap: float = 300.0
    """Two successive positions of one person that lie farther apart in time are refused [s]."""

    def __post_init__(self) -> None:
        low, high = FRAME_RATES
        if self.frame_rate is not None:
            _require_number("frame_rate", self.frame_rate, low, high)
        if self.since is not None:
            _require_number("since", self.since, 0.0, LONGEST)
        if self.until is not None:
            _require_number("until", self.until, 0.0, LONGEST)
            if self.since is not None and self.until <= self.since:
                raise ValueError(f"until = {self.until:g} is not allowed; allowed: numbers > since = {self.since:g}")
        _require_number("max_duration", self.max_duration, 0.0, LONGEST)
        _require_number("max_gap", self.max_gap, 0.0, LONGEST)
        if self.axis_order not in (None, *get_args(AxisOrder)):
            allowed = ", ".join(get_args(AxisOrder))
            raise ValueError(f"axis_order = {self.axis_order!r} is not allowed; allowed: {allowed}")
        object.__setattr__(self, "columns", tuple(self.columns))  # a list, if it comes from JSON
        if self.columns and any(self.columns.count(name) != 1 for name in COLUMNS):
            raise ValueError(
                f"columns = {' '.join(map(str, self.columns))} is not allowed; allowed: {', '.join(COLUMNS)} once "
                "each, in the order of the file, and any other word for a column that is not read"
            )
        if self.units not in UNITS:
            try:
                _require_number("units", float(self.units), 1e-9, 1e9)
            except (TypeError, ValueError):
                raise ValueError(
                    f"units = {self.units!r} is not allowed; allowed: {', '.join(UNITS)}, or a length in metres"
                ) from None

    @property
    def unit(self) -> float:
        """Length of the unit of positions [m]."""
        return UNITS[self.units] if self.units in UNITS else float(self.units)

    def settings(self) -> dict[str, Any]:
        """What changes the positions or who they belong to, apart from the frame rate, where it is not the default.

        Returns:
            JSON values: some of axis_order, columns, since, units, until; `again` reads them back.
        """
        settings = {name: getattr(self, name) for name in _SETTINGS}
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in settings.items()
            if value != getattr(DEFAULT_READING, name)
        }

    def again(self, frame_rate: float, settings: Mapping[str, Any]) -> "Reading":
        """How a recording was read, within these bounds.

        Args:
            frame_rate: It was read with [Hz].
            settings: It was read with, as `settings` gives them.

        Returns:
            The reading; its bounds are this one's.

        Raises:
            ValueError: If a value is not allowed or there are other settings.
        """
        if unknown := set(settings) - set(_SETTINGS):
            raise ValueError(f"setting {min(unknown)!r} of a recording is unknown; known: {', '.join(_SETTINGS)}")
        return Reading(frame_rate=frame_rate, max_duration=self.max_duration, max_gap=self.max_gap, **settings)


DEFAULT_READING = Reading()
"""What a file does not say is as the fields of `Reading` say."""
