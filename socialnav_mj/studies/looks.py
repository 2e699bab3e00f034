"""How methods and scenarios look and are named in the figures and pages of all studies."""

from collections.abc import Sequence
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
LINES: tuple[Literal["-", "--", "-.", ":"], ...] = ("-", "--", "-.", ":")

SCENARIO_TITLES = {
    "scenario_1": "scenario 1: 10 % agents",
    "scenario_2": "scenario 2: 30 % agents",
    "scenario_3": "scenario 3: 70 % agents",
    "scenario_4": "scenario 4: 90 % agents",
}
"""Task: its number, and the share of people whom agents replace."""


def looks_of(controllers: Sequence[str]) -> dict[str, Look]:
    """How controllers are drawn: the paper's methods as in all figures, the others in shades, markers and lines.

    Args:
        controllers: As `make_controller` takes them; `hybrid` is the paper's mixed policy.

    Returns:
        Of each controller.
    """
    methods = {controller: LOOKS.get(MIXED if controller == "hybrid" else controller) for controller in controllers}
    others = [controller for controller, method in methods.items() if method is None]
    return {controller: method or _shade(controller, others) for controller, method in methods.items()}


def _shade(label: str, others: Sequence[str]) -> Look:
    k = others.index(label)
    row = k // len(SHADES)
    return Look(
        label=label,
        colour=SHADES[k % len(SHADES)],
        hatch="",
        marker=MARKERS[row % len(MARKERS)],
        line=LINES[row % len(LINES)],
    )


def short_title(scenario: str, place: int) -> str:
    """Title of a sub-figure.

    Args:
        scenario: Name of a task.
        place: Of the sub-figure, from 0.

    Returns:
        As "(a) scenario 1: 10 %", the share being that of agents.
    """
    return f"({'abcdefgh'[place]}) {SCENARIO_TITLES.get(scenario, scenario).removesuffix(' agents')}"
