"""What a metric is: a pure function of an Episode, and all that tables, pages and tests have to know of it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from numpy.typing import NDArray

from socialnav_mj.episode import Episode
from socialnav_mj.metrics.missing import Missing


class Kind(Enum):
    """What a value is."""

    FLAG = "flag"
    """Yes or no: bool."""
    COUNT = "count"
    """A whole number >= 0: int64, or float64 if it can be missing."""
    NUMBER = "number"
    """float64."""
    NAME = "name"
    """One of few names: int64, a key of `Metric.names`; in tables the name."""


class Better(Enum):
    """Which values speak for a controller."""

    MORE = "more"
    LESS = "less"
    NEITHER = "-"
    """It describes the run, or the scene."""


class Need(Enum):
    """What a metric reads of an episode beyond who was under way when and how it ended."""

    GOAL = "starts and goals"
    POSITION = "agents' positions"
    HEADING = "agents' headings"
    VELOCITY = "agents' velocities"
    TILT = "agents' tilts"
    PEDESTRIANS = "pedestrians' tracks"
    DEVIATIONS = "pedestrians' deviations"
    DRIVE = "commands"
    """The human row has none."""
    CONTACTS = "contacts"
    FORCES = "forces of contacts"
    """The human row has none."""


@dataclass(frozen=True, kw_only=True)
class Mean:
    """A way of averaging a metric over the agents of a draw."""

    name: str = ""
    """In summaries; the metric's if empty."""
    heading: str = ""
    """Without the unit; the metric's if empty."""
    successes: bool = False
    """Over agents that succeeded alone; else over all that have a finite value."""
    share_of: str = ""
    """Of a metric of names: the share of all agents with this one."""
    weight: str = ""
    """Metric that weighs the agents; equally if empty."""
    narrow: str = ""
    """Heading for a terminal, in lines of at most 8 characters; `heading` if empty."""
    narrow_digits: int | None = None
    """Digits for a terminal; the metric's if None."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One number of each agent, declared in the module of its function; `registry` collects the declarations."""

    name: str
    """Of the column in tables: a Python identifier."""
    function: Callable[[Episode], NDArray[Any]]
    """Pure; shape (n_agents,)."""
    formula: str
    """What docs/metrics.md says it is, in Markdown and the page's symbols."""
    better: Better
    missing: Missing
    """Which agents have no value: NaN, and null in tables. A metric of names is null where its value has no name."""
    unit: str = ""
    """SI, or "steps"; empty for flags, names, shares, ratios and plain counts."""
    kind: Kind = Kind.NUMBER
    low: float = -math.inf
    """Least value; flags and counts begin at 0 without saying so."""
    high: float = math.inf
    """Greatest value; 1 for flags."""
    infinite: bool = False
    """Whether inf is a value; averages leave it out."""
    names: Mapping[int, str] = field(default_factory=dict)
    """Of a metric of names: by value."""
    needs: tuple[Need, ...] = ()
    heading: str = ""
    """In tables for readers, without the unit; the name in words if empty."""
    digits: int = 3
    """Behind the point in tables for readers."""
    source: str = ""
    """Where it comes from, and how others define the same name, in Markdown."""
    means: tuple[Mean, ...] = (Mean(),)
    """Measures that are made of it, in their order; empty if its mean says nothing."""
    paired: bool = False
    """Whether tables put the value of the person that an agent replaced beside the agent's, as `human_...`."""

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ValueError(f"name = {self.name!r} is not allowed; allowed: letters, digits and underscores")
        if (self.kind is Kind.NAME) != bool(self.names):
            raise ValueError(f"{self.name}: names = {dict(self.names)} do not go with {self.kind}; Kind.NAME has some")
        if unknown := {mean.share_of for mean in self.means} - {"", *self.names.values()}:
            raise ValueError(f"{self.name}: share_of = {sorted(unknown)} is not allowed; allowed: {self.names}")
        if not self.low <= self.high or self.digits < 0:
            raise ValueError(f"{self.name}: low = {self.low}, high = {self.high}, digits = {self.digits} make no sense")

    @property
    def limits(self) -> tuple[float, float]:
        """Least and greatest finite value, both allowed."""
        if self.kind is Kind.FLAG:
            return 0.0, 1.0
        return (max(self.low, 0.0) if self.kind is Kind.COUNT else self.low), self.high

    @property
    def label(self) -> str:
        """Heading without the unit."""
        return self.heading or self.name.replace("_", " ")
