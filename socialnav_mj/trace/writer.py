"""An episode as a rerun recording: one file that shows, on the time line of the simulation, what happened.

| entity | what it holds |
|---|---|
| /run | the result, the key to the colours and the run's configuration, as text |
| /scene/floor, goals | the ground; the goal region of every robot under way |
| /scene/robots/driving, collided | one pose a robot and step; a robot changes over at its first touch |
| /scene/people/walking, touched | one pose a person and step; touched for 2 s at least |
| /scene/people/threads | one line a person who is off its recorded track, to where the recording has it |
| /scene/trails/robots, people | where each was at each step; the views show the past 3 s |
| /scene/touches/now, all | one row a touch: place, partner, severity; the views show the past 2 s, and all so far |
| /scene/chosen | number of each robot that is followed closely |
| /all/speed, nearest_human | (n_agents,) values a step, in the order of the Episode |
| /all/score/POLICY | the same, of what a policy would have cost, if the controller says so |
| /chosen/speed, nearest_human, score, state, policy | one entity for each robot followed closely |
| /limits/speed, nearest_human | lines to read the series against |
| /lanes/state, policy | every robot, one after the other in as few lanes as there is room in |
| /events | log of late spawns, touches and ends |

Everything is written by columns. Robots and people carry the ids of the recording.
"""

import json
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode, EpisodeError, IntArray, Outcome, Partner
from socialnav_mj.files import written_whole
from socialnav_mj.metrics.collisions import collisions
from socialnav_mj.metrics.outcomes import success
from socialnav_mj.metrics.proximity import INTIMATE_DISTANCE, nearest_pedestrian_distance
from socialnav_mj.recordings.known import crowd_of
from socialnav_mj.slots import share_slots
from socialnav_mj.trace import layout as look
from socialnav_mj.trace.events import events, touch_rows
from socialnav_mj.trace.lanes import Change, policy_changes, state_changes
from socialnav_mj.trace.scene import bounds, write_scene
from socialnav_mj.trace.sink import Sink


def write_trace(episode: Episode, path: str | Path) -> Path:
    """Write an episode as a rerun recording; the file appears whole or not at all.

    Two files of one episode mean the same, but differ in bytes: rerun numbers its rows by the clock.

    Args:
        episode: All that a trace shows comes from it.
        path: Target, usually ending in .rrd; folders are made.

    Returns:
        The path written.
    """
    with written_whole(path) as part:
        _write(episode, part)
    return Path(path)


def chosen_agents(episode: Episode) -> IntArray:
    """Robots to follow closely: the hardest collisions first, then time-outs, then the longest on the way.

    Args:
        episode: Whose contacts, outcomes and times give the order.

    Returns:
        At most as many agent indices as there are colours for them; only agents that spawned.
    """
    hardest = np.full(episode.n_agents, -np.inf)
    np.maximum.at(hardest, episode.contact_agent, episode.contact_closing_speed)
    late = episode.agent_outcome == Outcome.TIMED_OUT
    under_way = np.nan_to_num(episode.agent_end_time - episode.agent_spawn_time)
    order = np.lexsort((-under_way, ~late, -hardest))
    return order[np.isfinite(episode.agent_spawn_time[order])][: len(look.CHOSEN)]


def _write(episode: Episode, path: Path) -> None:
    chosen = chosen_agents(episode)
    metadata = episode.metadata
    name = f"{metadata['scenario_name']} {metadata['controller']} draw {metadata['draw']}"
    low, high = bounds(episode)
    windows = np.array([episode.time[episode.window(agent)][[0, -1]] for agent in chosen]).reshape(-1, 2)
    layout = look.layout(
        low,
        high,
        episode.time[[0, -1]],
        minute=look.minute_of(windows, episode.time[[0, -1]]),
        max_speed=metadata["scenario"]["robot"]["max_speed"],
        several_policies=len(episode.policies) > 1,
        scores=episode.agent_scores,
    )
    identity = uuid.uuid5(uuid.NAMESPACE_OID, f"{name} {metadata['state_hash']}")
    sink = Sink(path, name=name, recording_id=str(identity), blueprint=layout)
    try:
        _run(episode, sink, name, chosen)
        write_scene(episode, sink, chosen, low, high)
        _series(episode, sink, chosen)
        _limits(episode, sink)
        _scores(episode, sink, chosen)
        _lanes(episode, sink, "state", state_changes(episode, linger=look.TOUCH_SECONDS), look.STATES, chosen)
        if len(episode.policies) > 1:
            colours = dict(zip(episode.policies, look.policy_colours(episode.policies), strict=True))
            _lanes(episode, sink, "policy", policy_changes(episode), colours, chosen)
        if story := events(episode):
            times, levels, texts = (list(column) for column in zip(*story, strict=True))
            sink.columns("/events", times, rr.TextLog.columns(text=texts, level=levels))
    finally:
        sink.close()


def _run(episode: Episode, sink: Sink, name: str, chosen: IntArray) -> None:
    metadata, recording = episode.metadata, episode.metadata["recording"]
    values = {
        "controller": metadata["controller"],
        "scenario": metadata["scenario_name"],
        "draw": metadata["draw"],
        "dataset": recording["name"],
        "dataset_variant": recording["variant"],
        "dataset_checksum": recording["checksum"],
        "state_hash": metadata["state_hash"],
        "success": float(np.mean(success(episode))) if episode.n_agents else float("nan"),
        "configuration": json.dumps(metadata, sort_keys=True),
    }
    sink.recording.send_property("run", rr.AnyValues(**values))
    sink.static("/run", rr.TextDocument(_summary(episode, name, chosen), media_type="text/markdown"))


def _summary(episode: Episode, name: str, chosen: IntArray) -> str:
    metadata, recording = episode.metadata, episode.metadata["recording"]
    touches = touch_rows(episode)
    with_people = int((episode.contact_partner_kind[touches] == Partner.PEDESTRIAN).sum())
    counts = {outcome: int((episode.agent_outcome == outcome).sum()) for outcome in Outcome}
    followed = ", ".join(
        f"{person} ({colour})" for person, colour in zip(episode.agent_person[chosen], look.CHOSEN_NAMES, strict=False)
    )
    return "\n".join(
        [
            f"# {name}",
            f"**{int(success(episode).sum())} of {episode.n_agents} agents succeeded**: arrived without a collision.",
            "",
            f"- {counts[Outcome.ARRIVED]} arrived, {counts[Outcome.TIMED_OUT]} timed out, "
            f"{counts[Outcome.OVERTURNED]} overturned, {counts[Outcome.NEVER_SPAWNED]} never spawned",
            f"- {int((collisions(episode) > 0).sum())} collided: {with_people} collisions with pedestrians, "
            f"{len(touches) - with_people} between agents",
            f"- {crowd_of(recording['name'], recording['variant'])}, {episode.n_pedestrians} people replayed, "
            f"{episode.time[-1] - episode.time[0]:.0f} s",
            "",
            look.KEY,
            "",
            f"Followed closely, hardest collisions first: robots {followed or 'none'}.",
            "",
            "## Configuration",
            f"state `{metadata['state_hash'][:16]}`, recording `{str(recording['checksum'])[:16]}`",
            "```json",
            json.dumps(metadata, indent=1, sort_keys=True),
            "```",
        ]
    )


def _series(episode: Episode, sink: Sink, chosen: IntArray) -> None:
    nearest = nearest_pedestrian_distance(episode)
    speed = np.hypot(episode.agent_velocity[..., 0], episode.agent_velocity[..., 1])
    n, people = episode.n_agents, episode.agent_person
    names = [f"robot {person}" for person in people]
    for quantity, values in (("speed", speed), ("nearest_human", np.where(np.isinf(nearest), np.nan, nearest))):
        if n:
            sink.static(f"/all/{quantity}", rr.SeriesLines(names=names, widths=[0.7] * n, colors=[look.SKY] * n))
            sink.columns(f"/all/{quantity}", episode.time, rr.Scalars.columns(scalars=values))
        for agent, colour in zip(chosen, look.CHOSEN, strict=False):
            window, entity = episode.window(agent), f"/chosen/{quantity}/robot_{people[agent]}"
            sink.static(entity, rr.SeriesLines(names=names[agent], colors=colour, widths=2.0))
            sink.columns(entity, episode.time[window], rr.Scalars.columns(scalars=values[window, agent]))


def _scores(episode: Episode, sink: Sink, chosen: IntArray) -> None:
    """What each policy would have cost: a line a policy, in the colour of its lane."""
    if episode.agent_scores is None or not episode.n_agents:
        return
    people, colours = episode.agent_person, look.policy_colours(episode.policies)
    every, policies = [f"robot {person}" for person in people], episode.policies
    labels = [name if policies.count(name) == 1 else f"{name} {p}" for p, name in enumerate(policies)]
    for p, (policy, colour) in enumerate(zip(labels, colours, strict=True)):
        entity = f"/all/score/{rr.escape_entity_path_part(policy)}"
        sink.static(entity, rr.SeriesLines(names=every, widths=[0.7] * len(every), colors=[colour] * len(every)))
        sink.columns(entity, episode.time, rr.Scalars.columns(scalars=episode.agent_scores[..., p].astype(float)))
    for agent in chosen:
        window, entity = episode.window(agent), f"/chosen/score/robot_{people[agent]}"
        names = [f"robot {people[agent]} {policy}" for policy in labels]
        sink.static(entity, rr.SeriesLines(names=names, colors=colours, widths=[2.0] * len(names)))
        own = episode.agent_scores[window, agent].astype(float)
        sink.columns(entity, episode.time[window], rr.Scalars.columns(scalars=own))


def _limits(episode: Episode, sink: Sink) -> None:
    """Horizontal lines to read the series against."""
    scenario = Scenario.from_dict(episode.metadata["scenario"])
    for entity, text, value, colour in (
        ("speed/most", "most the wheels can do", scenario.robot.max_speed, look.GREY),
        ("nearest_human/intimate", f"{INTIMATE_DISTANCE} m: intrusion", INTIMATE_DISTANCE, look.GREY),
        ("nearest_human/touch", "contact", scenario.contact_distance, look.VERMILION),
    ):
        sink.static(f"/limits/{entity}", rr.SeriesLines(names=text, colors=colour, widths=1.0))
        sink.columns(f"/limits/{entity}", episode.time[[0, -1]], rr.Scalars.columns(scalars=[value, value]))


def _lanes(
    episode: Episode,
    sink: Sink,
    what: str,
    changes: Sequence[Sequence[Change]],
    colours: dict[str, look.Colour],
    chosen: IntArray,
) -> None:
    """The chosen agents in a lane each, and all agents packed, with their numbers as labels."""
    person = episode.agent_person
    for agent in chosen:
        _lane(sink, f"/chosen/{what}/robot_{person[agent]}", changes[agent], colours)
    shown = [i for i, own in enumerate(changes) if own]
    begin = np.array([changes[i][0].time for i in shown])
    lanes = share_slots(begin, np.array([changes[i][-1].time for i in shown]))
    for lane in range(lanes.max(initial=-1) + 1):
        members = np.flatnonzero(lanes == lane)
        agents = [shown[k] for k in members[np.argsort(begin[members], kind="stable")]]
        own = [
            Change(time=c.time, state=f"{person[i]} {c.state}" if c.state else "") for i in agents for c in changes[i]
        ]
        own_colours = {c.state: colours[c.state.partition(" ")[2]] for c in own if c.state}
        _lane(sink, f"/lanes/{what}/{lane:02d}", own, own_colours, [state.partition(" ")[0] for state in own_colours])


def _lane(
    sink: Sink,
    entity: str,
    changes: Sequence[Change],
    colours: dict[str, look.Colour],
    labels: list[str] | None = None,
) -> None:
    style = rr.StateConfiguration(values=list(colours), colors=list(colours.values()), labels=labels)
    sink.static(entity, style)
    states = rr.StateChange.columns(state=[c.state for c in changes])
    sink.columns(entity, [c.time for c in changes], states)


def read_metadata(path: str | Path) -> dict[str, Any]:
    """The metadata of the episode behind a trace, which the file carries as a property.

    Args:
        path: Of `write_trace`.

    Returns:
        `Episode.metadata`.

    Raises:
        EpisodeError: If the file is no trace of ours, or damaged.
    """
    try:
        for chunk in RrdReader(path).stream().to_chunks():
            batch = chunk.to_record_batch()
            if "configuration" in batch.schema.names:
                metadata: dict[str, Any] = json.loads(batch.column("configuration").to_pylist()[-1][0])
                return metadata
    except (RuntimeError, ValueError, TypeError, IndexError) as error:
        raise EpisodeError(f"{path} is not a readable trace: {error}") from error
    raise EpisodeError(f"{path} is no trace of ours: it carries no configuration")
