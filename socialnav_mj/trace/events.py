"""Collisions, late spawns and ends of an episode as lines of text."""

import numpy as np

from socialnav_mj.episode import Episode, IntArray, Outcome, Partner
from socialnav_mj.metrics.contacts import partner_person
from socialnav_mj.metrics.severity import clamped, wedged


def touch_rows(episode: Episode) -> IntArray:
    """Contact rows with each touch once: a touch between two agents stands in two rows of an Episode.

    Args:
        episode: Whose contacts are counted.

    Returns:
        Indices of contact rows, ascending; of the two rows the one with the smaller agent index.
    """
    once = (episode.contact_partner_kind == Partner.PEDESTRIAN) | (episode.contact_agent < episode.contact_partner)
    return np.flatnonzero(once)


def partner_words(episode: Episode, rows: IntArray) -> list[str]:
    """Kinds of the partners: "person" or "robot".

    Args:
        episode: Whose contacts the rows are.
        rows: (k,) contact rows.

    Returns:
        k words: "person" for a pedestrian, "robot" for an agent.
    """
    kinds = episode.contact_partner_kind[rows]
    return ["person" if kind == Partner.PEDESTRIAN else "robot" for kind in kinds]


def severities(episode: Episode, rows: IntArray) -> list[str]:
    """Closing speed and force of the impact, the latter where it means something.

    Args:
        episode: Whose contacts the rows are.
        rows: (k,) contact rows.

    Returns:
        k texts such as "0.82 m/s, 154 N", "0.82 m/s, wedged", "0.82 m/s, clamped", or "0.82 m/s" where there was no
        physics.
    """
    speeds, forces = episode.contact_closing_speed[rows].tolist(), episode.contact_impact_force[rows].tolist()
    told = [f"{force:.0f} N" for force in forces]
    without = [np.isnan(forces), wedged(episode)[rows], clamped(episode)[rows]]
    words = np.select(without, ["", "wedged", "clamped"], told)
    return [f"{speed:.2f} m/s" + (f", {word}" if word else "") for speed, word in zip(speeds, words, strict=True)]


def events(episode: Episode) -> list[tuple[float, str, str]]:
    """Late spawns, collisions and ends of trips, for the log of a trace.

    Args:
        episode: With robots or, in the human row, people as agents.

    Returns:
        (time [s], level, text), in order of time. Collisions have level ERROR, delays and failures WARN, arrivals INFO.
    """
    rows = touch_rows(episode)
    partners = zip(partner_words(episode, rows), partner_person(episode, rows).tolist(), strict=True)
    robots = episode.agent_person[episode.contact_agent[rows]].tolist()
    result = [
        (time, "ERROR", f"robot {robot} and {kind} {person} touch: {severity}")
        for time, robot, (kind, person), severity in zip(
            episode.contact_time[rows].tolist(), robots, partners, severities(episode, rows), strict=True
        )
    ]
    for person, outcome, appear, spawn, end in zip(
        episode.agent_person.tolist(),
        episode.agent_outcome.tolist(),
        episode.agent_appear_time.tolist(),
        episode.agent_spawn_time.tolist(),
        episode.agent_end_time.tolist(),
        strict=True,
    ):
        if outcome == Outcome.NEVER_SPAWNED:
            result.append((float(episode.time[-1]), "WARN", f"robot {person} never spawned: its place was never free"))
            continue
        if spawn - appear > 1e-9:
            result.append((spawn, "WARN", f"robot {person} spawned {spawn - appear:.1f} s late"))
        level = "INFO" if outcome == Outcome.ARRIVED else "WARN"
        what = Outcome(outcome).name.lower().replace("_", " ")
        result.append((end, level, f"robot {person} {what} after {end - spawn:.1f} s"))
    return sorted(result)
