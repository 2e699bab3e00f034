"""How a trace looks when it is opened: colours, names of the entities, and the layout of the viewer's window."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from socialnav_mj.geometry import Array
from socialnav_mj.trace.sink import TIMELINE

Colour = tuple[int, int, int]

TRAIL_SECONDS = 3.0
"""How far back trails reach [s]."""
AROUND_SECONDS = 10.0
"""How far plots of all robots reach to both sides of the time cursor [s]."""
TOUCH_SECONDS = 2.0
"""How long a touch is announced in the scene, and an ended robot keeps its lane [s]."""

# Okabe & Ito's palette, made to be told apart with any kind of colour vision; brightened a little for a dark floor.
SKY, VERMILION, GREEN, PINK = (86, 180, 233), (240, 98, 30), (0, 176, 128), (214, 134, 178)
YELLOW, SAND, GREY, WHITE = (240, 228, 66), (205, 196, 180), (120, 124, 132), (245, 245, 245)
BACKGROUND, FLOOR, RING = (22, 24, 29), (40, 44, 52), (96, 128, 124)

STATES: dict[str, Colour] = {
    "waiting": GREY,
    "driving": SKY,
    "collided": VERMILION,
    "arrived": GREEN,
    "arrived after collision": (150, 90, 60),
    "timed out": PINK,
    "taken out": (150, 50, 20),
    "overturned": (120, 20, 90),
    "stopped": WHITE,
    "never spawned": GREY,
}
"""State of a robot -> colour."""

CHOSEN: tuple[Colour, ...] = (YELLOW, PINK, GREEN, (160, 140, 255), (230, 159, 0))
"""One colour for each robot that is followed closely; seen on a light viewer too."""

CHOSEN_NAMES = ("yellow", "pink", "green", "violet", "orange")
"""Names of these colours."""

KEY = """
| colour | means |
|---|---|
| blue | robot without a collision so far |
| vermilion | after a collision: robots for good, pedestrians for 2 s |
| balls | collisions, by closing speed; dots: earlier ones |
| trails | the past 3 s |
| sand | pedestrian |
| white thread | from a pedestrian to where the recording has it |
| ring | goal of a robot on its way |
"""
"""How to read the scene."""

POLICIES: tuple[Colour, ...] = (SKY, (230, 159, 0), GREEN, PINK, YELLOW, VERMILION)
"""One colour for each policy; they repeat if there are more."""


def policy_colours(policies: Sequence[str]) -> list[Colour]:
    """Colours of the lanes and lines of policies.

    Args:
        policies: Their names.

    Returns:
        One for each.
    """
    return [POLICIES[i % len(POLICIES)] for i in range(len(policies))]


TRAIL_RADIUS, NAME_RADIUS, THREAD_RADIUS = 0.025, 0.05, 0.015
THREAD_LENGTH, THREAD_HEIGHT = 0.02, 0.4
"""Shorter threads are not drawn; where they begin, at a person's knee [m]."""
NAME_HEIGHT, TOUCH_HEIGHT = 1.0, 0.25
"""[m]."""


def robot(radius: float, colour: Colour) -> list[rr.AsComponents]:
    """Shapes of a robot that stands at the origin and faces along x.

    Args:
        radius: Of its footprint [m].
        colour: Of its body.

    Returns:
        Archetypes for one entity.
    """
    return [
        rr.Cylinders3D(radii=radius, lengths=0.22, centers=[[0.0, 0.0, 0.14]], colors=colour, fill_mode="solid"),
        rr.Boxes3D(
            half_sizes=[[0.55 * radius, 0.2 * radius, 0.02]],
            centers=[[0.55 * radius, 0.0, 0.26]],
            colors=WHITE,
            fill_mode="solid",
        ),
    ]


def person(radius: float, colour: Colour) -> list[rr.AsComponents]:
    """Shapes of a person who stands at the origin and faces along x; shorter than life, to hide fewer robots.

    Args:
        radius: Of the body [m].
        colour: Of the body.

    Returns:
        Archetypes for one entity.
    """
    return [
        rr.Cylinders3D(radii=radius, lengths=0.95, centers=[[0.0, 0.0, 0.475]], colors=colour, fill_mode="solid"),
        rr.Ellipsoids3D(half_sizes=[[0.11, 0.11, 0.13]], centers=[[0.0, 0.0, 1.08]], colors=colour, fill_mode="solid"),
        rr.Boxes3D(half_sizes=[[0.06, 0.035, 0.03]], centers=[[0.13, 0.0, 1.08]], colors=BACKGROUND, fill_mode="solid"),
    ]


def goal(radius: float) -> rr.AsComponents:
    """Ring on the floor around the origin.

    Args:
        radius: Of the goal region [m].

    Returns:
        An archetype.
    """
    return rr.Cylinders3D(radii=radius, lengths=0.002, colors=RING, line_radii=0.01, fill_mode="majorwireframe")


def floor(low: Array, high: Array) -> rr.AsComponents:
    """Slab under a rectangle.

    Args:
        low: (2,) smallest x and y [m].
        high: (2,) largest [m].

    Returns:
        An archetype.
    """
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return rr.Boxes3D(centers=[[*middle, -0.03]], half_sizes=[[*half, 0.02]], colors=FLOOR, fill_mode="solid")


def layout(
    low: Array,
    high: Array,
    times: Array,
    *,
    minute: Array,
    max_speed: float,
    several_policies: bool,
    scores: NDArray[np.float32] | None,
) -> rrb.Blueprint:
    """The window: oblique and top-down view, time series, lanes of states, configuration and log of events.

    Args:
        low: (2,) smallest x and y of the scene [m].
        high: (2,) largest [m].
        times: (2,) first and last sample [s].
        minute: (2,) what the plots of the chosen robots open on, see `minute_of` [s].
        max_speed: What the robots' wheels can do [m/s].
        several_policies: Whether to show lanes of the policy in use.
        scores: What is shown of policies' costs, of any shape; None if nothing is.

    Returns:
        A blueprint.
    """
    x, y = 0.5 * (low + high)
    span = float(max(high - low))
    oblique = rrb.EyeControls3D(position=(x, y - 0.7 * span, 0.55 * span), look_target=(x, y - 0.08 * span, 0.0))
    above = rrb.EyeControls3D(position=(x, y - 1e-3, 0.93 * span), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0))
    axis, own = _axis(times), _axis(minute)
    chosen = [rrb.StateTimelineView(name="State: chosen robots", origin="/chosen/state", time_view=own)]
    every = [rrb.StateTimelineView(name="State: all robots", origin="/lanes/state", time_view=axis)]
    if several_policies:
        chosen.append(rrb.StateTimelineView(name="Policy: chosen robots", origin="/chosen/policy", time_view=own))
        every.append(rrb.StateTimelineView(name="Policy: all robots", origin="/lanes/policy", time_view=axis))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_spatial("Crowd", oblique), _spatial("From above", above), row_shares=[1.0, 1.15]),
            rrb.Vertical(
                rrb.Tabs(*_series("speed", "Speed [m/s]", (0.0, 1.25 * max_speed), own)),
                rrb.Tabs(*_series("nearest_human", "Nearest pedestrian [m]", (0.0, 4.0), own)),
                *_scores(scores, own),
                *(rrb.Tabs(*pair) for pair in zip(every, chosen, strict=True)),
            ),
            rrb.Vertical(
                rrb.TextDocumentView(name="Run", origin="/run"),
                rrb.TextLogView(
                    name="Events",
                    origin="/events",
                    columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
                ),
                row_shares=[1.4, 1.0],
            ),
            column_shares=[1.45, 1.15, 0.8],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
    )


def minute_of(windows: Array, times: Array) -> Array:
    """The time that shows the first of the chosen robots, and who else drives then.

    Args:
        windows: (k, 2) begin and end of the trip of each chosen robot, the most interesting one first [s].
        times: (2,) first and last sample of the episode [s].

    Returns:
        (2,) begin and end: a minute about the first robot's trip, or all of the trip if it is longer, as far as the
        episode goes; all of the episode if nobody is chosen [s].
    """
    if not len(windows):
        return times
    begin, end = windows[0]
    margin = max(0.0, 0.5 * (60.0 - (end - begin)))
    return np.array([max(times[0], begin - margin), min(times[1], end + margin)])


def _axis(times: Array) -> rrb.TimeAxis:
    """With room for the legend to the right."""
    boundary = rr.TimeRangeBoundary
    end = float(times[1] + 0.25 * (times[1] - times[0]))
    return rrb.TimeAxis(
        view_range=rr.TimeRange(start=boundary.absolute(seconds=float(times[0])), end=boundary.absolute(seconds=end))
    )


def _spatial(name: str, eye: rrb.EyeControls3D) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        name=name,
        origin="/scene",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=eye,
        overrides={
            "/scene/trails/robots": _past(TRAIL_SECONDS),
            "/scene/trails/people": _past(TRAIL_SECONDS),
            "/scene/touches/now": _past(TOUCH_SECONDS),
            "/scene/touches/all": _past(None),
        },
    )


def _past(seconds: float | None) -> rrb.VisibleTimeRanges:
    boundary = rr.TimeRangeBoundary
    start = boundary.infinite() if seconds is None else boundary.cursor_relative(seconds=-seconds)
    return rrb.VisibleTimeRanges(timeline=TIMELINE, start=start, end=boundary.cursor_relative(seconds=0.0))


def _scores(scores: NDArray[np.float32] | None, axis: rrb.TimeAxis) -> list[rrb.Tabs]:
    """From the least to what 19 of 20 do not exceed: a policy that runs into somebody costs many times the others."""
    if scores is None or np.isnan(scores).all():
        return []
    low, high = np.nanpercentile(scores, (0.0, 95.0))
    return [rrb.Tabs(*_series("score", "Cost of each policy", (float(low), float(high) + 1e-3), axis))]


def _series(quantity: str, title: str, span: tuple[float, float], axis: rrb.TimeAxis) -> list[rrb.TimeSeriesView]:
    """The chosen robots over their minute; all robots, too many for that, around the time cursor."""
    height = rrb.ScalarAxis(range=span)
    limits = f"/limits/{quantity}/**"
    boundary = rr.TimeRangeBoundary
    around = rr.TimeRange(
        start=boundary.cursor_relative(seconds=-AROUND_SECONDS), end=boundary.cursor_relative(seconds=AROUND_SECONDS)
    )
    return [
        rrb.TimeSeriesView(
            name=f"{title}: chosen robots",
            origin=f"/chosen/{quantity}",
            contents=["$origin/**", limits],
            plot_legend=rrb.PlotLegend(corner="righttop"),
            axis_x=axis,
            axis_y=height,
        ),
        rrb.TimeSeriesView(
            name=f"{title}: all robots",
            origin=f"/all/{quantity}",
            contents=["$origin/**", limits],
            plot_legend=rrb.PlotLegend(visible=False),
            axis_x=rrb.TimeAxis(view_range=around),
            axis_y=height,
        ),
    ]
