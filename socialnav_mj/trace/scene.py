"""The part of a trace that lives in space: robots, people, goals, trails and collisions."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, IntArray, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.contacts import partner_person
from socialnav_mj.metrics.severity import clamped, wedged
from socialnav_mj.trace import layout as look
from socialnav_mj.trace.events import partner_words, severities, touch_rows
from socialnav_mj.trace.lanes import first_touch_time
from socialnav_mj.trace.sink import Sink

Mask = NDArray[np.bool_]


def bounds(episode: Episode) -> tuple[Array, Array]:
    """Rectangle around all agents, goals and pedestrians, with a margin of 0.5 m.

    Args:
        episode: With places of agents and pedestrians.

    Returns:
        Smallest and largest x and y, shapes (2,) [m].
    """
    fields = (episode.agent_start, episode.agent_goal, episode.agent_position, episode.pedestrian_position)
    places = np.concatenate([field[np.isfinite(field[..., 0])] for field in fields])
    places = places if len(places) else np.zeros((1, 2))
    return places.min(axis=0) - 0.5, places.max(axis=0) + 0.5


def write_scene(episode: Episode, sink: Sink, chosen: IntArray, low: Array, high: Array) -> None:
    """Write everything that the spatial views show.

    Args:
        episode: Drawn from its first sample to its last.
        sink: The open file.
        chosen: Indices of the agents that are followed closely.
        low: (2,) smallest x and y of `bounds` [m].
        high: (2,) largest [m].
    """
    sink.static("/scene/floor", look.floor(low, high))
    robots = np.isfinite(episode.agent_heading)
    collided = robots & (episode.time[:, None] >= first_touch_time(episode))
    people = np.isfinite(episode.pedestrian_heading)
    touched = people & _touched_people(episode)

    radius = float(episode.metadata["scenario"]["robot"]["radius"])
    for kind, mask, colour in (("driving", robots & ~collided, look.SKY), ("collided", collided, look.VERMILION)):
        sink.static(f"/scene/robots/{kind}", *look.robot(radius, colour))
        _poses(sink, f"/scene/robots/{kind}", episode.time, mask, episode.agent_position, episode.agent_heading)
    radius = float(episode.metadata["scenario"]["pedestrian_radius"])
    for kind, mask, colour in (("walking", people & ~touched, look.SAND), ("touched", touched, look.VERMILION)):
        sink.static(f"/scene/people/{kind}", *look.person(radius, colour))
        _poses(
            sink, f"/scene/people/{kind}", episode.time, mask, episode.pedestrian_position, episode.pedestrian_heading
        )
    for kind, mask, position, colour in (
        ("robots", robots, episode.agent_position, look.SKY),
        ("people", people, episode.pedestrian_position, look.SAND),
    ):
        sink.static(f"/scene/trails/{kind}", rr.Points3D.from_fields(colors=colour, radii=look.TRAIL_RADIUS))
        points = rr.Points3D.columns(positions=_in_space(position[mask], 0.01))
        sink.columns(f"/scene/trails/{kind}", episode.time, points.partition(mask.sum(axis=1)))
    _threads(episode, sink)
    _goals(episode, sink)
    _names(episode, sink, chosen)
    _touches(episode, sink)


def _poses(sink: Sink, entity: str, time: Array, mask: Mask, position: Array, heading: Array) -> None:
    """One pose for each True of mask; where there is none the shapes shrink to nothing.

    An empty list of poses would not do: the viewer then draws the shapes once, at the origin.
    """
    half = 0.5 * heading[mask]
    quaternions = np.zeros((len(half), 4), dtype=np.float32)
    quaternions[:, 2], quaternions[:, 3] = np.sin(half), np.cos(half)
    counts = mask.sum(axis=1)
    poses = rr.InstancePoses3D.columns(translations=_in_space(position[mask], 0.0), quaternions=quaternions)
    sink.columns(entity, time[counts > 0], poses.partition(counts[counts > 0]))
    _hide(sink, entity, time[(counts == 0) & (np.diff(counts, prepend=1) != 0)])


def _hide(sink: Sink, entity: str, time: Array) -> None:
    nothing = np.zeros((len(time), 3), dtype=np.float32)
    sink.columns(entity, time, rr.InstancePoses3D.columns(translations=nothing, scales=nothing))


def _touched_people(episode: Episode) -> Mask:
    result = np.zeros((len(episode.time), episode.n_pedestrians), dtype=bool)
    for row in np.flatnonzero(episode.contact_partner_kind == Partner.PEDESTRIAN):
        begin = episode.contact_time[row]
        end = begin + max(look.TOUCH_SECONDS, episode.contact_duration[row])
        first, last = np.searchsorted(episode.time, (begin, end))
        result[first:last, episode.contact_partner[row]] = True
    return result


def _threads(episode: Episode, sink: Sink) -> None:
    """A line from everybody who is off its recorded track to where the recording has it; nothing if nobody ever is."""
    off = episode.pedestrian_deviation
    if off is None:
        return
    drawn = np.nan_to_num(np.hypot(off[..., 0], off[..., 1])) > look.THREAD_LENGTH
    if not drawn.any():
        return
    counts = drawn.sum(axis=1)
    rows = np.flatnonzero((counts > 0) | (np.diff(counts, prepend=0) != 0))
    person = episode.pedestrian_position[drawn]
    strips = np.stack([_in_space(person, look.THREAD_HEIGHT), _in_space(person - off[drawn], 0.0)], axis=1)
    sink.static("/scene/people/threads", rr.LineStrips3D.from_fields(colors=look.WHITE, radii=look.THREAD_RADIUS))
    lines = rr.LineStrips3D.columns(strips=strips)
    sink.columns("/scene/people/threads", episode.time[rows], lines.partition(counts[rows]))


def _goals(episode: Episode, sink: Sink) -> None:
    """Goals of robots under way; a row where one comes or goes."""
    active = episode.agent_active
    rows = np.flatnonzero(np.diff(active, axis=0, prepend=~active[:1]).any(axis=1))
    counts = active[rows].sum(axis=1)
    _, agent = np.nonzero(active[rows])
    sink.static("/scene/goals", look.goal(float(episode.metadata["scenario"]["goal_radius"])))
    poses = rr.InstancePoses3D.columns(translations=_in_space(episode.agent_goal[agent], 0.0))
    sink.columns("/scene/goals", episode.time[rows[counts > 0]], poses.partition(counts[counts > 0]))
    _hide(sink, "/scene/goals", episode.time[rows[counts == 0]])


def _names(episode: Episode, sink: Sink, chosen: IntArray) -> None:
    present = np.isfinite(episode.agent_heading[:, chosen])
    _, item = np.nonzero(present)
    points = rr.Points3D.columns(
        positions=_in_space(episode.agent_position[:, chosen][present], look.NAME_HEIGHT),
        colors=np.array(look.CHOSEN, dtype=np.uint8)[item],
        labels=[f"robot {person}" for person in episode.agent_person[chosen][item]],
    )
    sink.static("/scene/chosen", rr.Points3D.from_fields(radii=look.NAME_RADIUS, show_labels=True))
    sink.columns("/scene/chosen", episode.time, points.partition(present.sum(axis=1)))


def _touches(episode: Episode, sink: Sink) -> None:
    """A big mark with the severity while a touch is fresh, and a small one for good."""
    rows = touch_rows(episode)
    closing = episode.contact_closing_speed[rows]
    place = _in_space(episode.contact_position[rows], look.TOUCH_HEIGHT)
    radii = np.clip(0.08 + 0.12 * np.abs(closing), 0.08, 0.32).astype(np.float32)
    details = rr.DynamicArchetype.columns(
        archetype="Touch",
        components={
            "robot": episode.agent_person[episode.contact_agent[rows]],
            "partner_kind": partner_words(episode, rows),
            "partner": partner_person(episode, rows),
            "closing_speed": closing,
            **_forces(episode, rows),
            "squeeze": episode.contact_squeeze[rows],
            "duration": episode.contact_duration[rows],
        },
    )
    sink.static("/scene/touches/now", rr.Points3D.from_fields(colors=look.VERMILION, show_labels=True))
    marks = rr.Points3D.columns(positions=place, radii=radii, labels=severities(episode, rows))
    sink.columns("/scene/touches/now", episode.contact_time[rows], marks)
    sink.static("/scene/touches/all", rr.Points3D.from_fields(colors=look.VERMILION))
    small = rr.Points3D.columns(positions=_in_space(episode.contact_position[rows], 0.0), radii=0.4 * radii)
    sink.columns("/scene/touches/all", episode.contact_time[rows], small, details)


def _forces(episode: Episode, rows: IntArray) -> dict[str, Array]:
    """Impact and push of touches; NaN where the robot was held between two bodies, so that they mean nothing."""
    held = wedged(episode)
    meaningless = {"impact": clamped(episode) | held, "push": held}
    return {
        name: np.where(meaningless[phase], np.nan, getattr(episode, f"contact_{name}"))[rows]
        for phase, names in (
            ("impact", ("impact_impulse", "impact_force")),
            ("push", ("push_impulse", "push_duration")),
        )
        for name in names
    }


def _in_space(position: Array, height: float) -> NDArray[np.float32]:
    result = np.full((len(position), 3), height, dtype=np.float32)
    result[:, :2] = position
    return result
