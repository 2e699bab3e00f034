"""How methods and scenarios look and are named in the figures and pages of all studies."""

from dataclasses import dataclass
from typing import Literal

from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.panel import CAPPED, MIXED, POTENTIAL_FIELD, REPLAY_IRL


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a method is drawn."""

    label: str
    colour: str
    hatch: str
    marker: str
    line: Literal["-", "--", "-.", ":"] | tuple[int, tuple[int, ...]]
    """As matplotlib's linestyle."""


# P. Tol's "high-contrast" scheme: distinct for every kind of colour vision, and light, middle, dark in greyscale; the
# capped field lies between two of them.
LOOKS: dict[str, Look] = {
    POTENTIAL_FIELD: Look(label="potential field", colour="#DDAA33", hatch="", marker="o", line="-"),
    CAPPED: Look(label="capped field", colour="#55AAAA", hatch="\\\\\\\\", marker="v", line=(0, (5, 1, 1, 1, 1, 1))),
    REPLAY_IRL: Look(label="ReplayIRL", colour="#004488", hatch="////", marker="s", line="--"),
    MIXED: Look(label="hybrid", colour="#BB5566", hatch="....", marker="D", line="-."),
    HUMAN: Look(label="human", colour="#000000", hatch="", marker="^", line=":"),
}
SHADES = ("#40004B", "#762A83", "#A477B7", "#CDB2D8")
"""Dark to light purple, for whatever is no method, and no method's colour; with MARKERS and LINES beside them."""
MARKERS = ("o", "s", "D", "^")
LINES = ("-", "--", "-.", ":")

SCENARIO_TITLES = {
    "scenario_1": "scenario 1: 10 % agents",
    "scenario_2": "scenario 2: 30 % agents",
    "scenario_3": "scenario 3: 70 % agents",
    "scenario_4": "scenario 4: 90 % agents",
}
"""Task: its number, and the share of people whom agents replace."""


def short_title(scenario: str, place: int) -> str:
    """Title of a sub-figure.

    Args:
        scenario: Name of a task.
        place: Of the sub-figure, from 0.

    Returns:
        As "(a) scenario 1: 10 %", the share being that of agents.
    """
    return f"({'abcdefgh'[place]}) {SCENARIO_TITLES.get(scenario, scenario).removesuffix(' agents')}"
