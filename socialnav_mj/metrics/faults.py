"""Collisions of each agent told apart: whose fault, first or repeated, struck while standing, how hard."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import counted_contacts
from socialnav_mj.metrics.contacts import Fault, fault, first_touch, standing
from socialnav_mj.metrics.metric import Better, Kind, Metric, Need
from socialnav_mj.metrics.missing import NEVER, Missing
from socialnav_mj.metrics.severity import Severity, clamped, severity, wedged

Counts = NDArray[np.int64]


def collisions_by_fault(episode: Episode, partner: Partner, who: Fault) -> Counts:
    """Number of collisions with one kind of partner in which one party moved into the other.

    Over the values of `who` they add up to `collisions(episode, partner)`.

    Args:
        episode: Record whose contact log is counted.
        partner: Pedestrians or agents.
        who: The party that moved into the other.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return _count(episode, (episode.contact_partner_kind == partner) & (fault(episode) == who))


def repeated_collisions(episode: Episode) -> Counts:
    """Number of collisions with somebody the agent had collided with before.

    Args:
        episode: Record whose contact log is counted, agent and partner by agent and partner.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return _count(episode, ~first_touch(episode))


def struck_standing(episode: Episode) -> NDArray[np.bool_]:
    """Whether an agent was ever walked into while it stood still: partner's fault, own speed under 0.1 m/s.

    Args:
        episode: Record whose contacts have the velocities of both just before.

    Returns:
        Shape (n_agents,); False for agents that never spawned.
    """
    return _count(episode, standing(episode) & (fault(episode) == Fault.PARTNER)) > 0


def largest_closing_speed(episode: Episode) -> Array:
    """Closing speed of the fastest collision, with whomever.

    Args:
        episode: Record whose contacts have normal and velocities.

    Returns:
        Shape (n_agents,); NaN for agents without a collision [m/s].
    """
    return _largest(episode, episode.contact_closing_speed)


def largest_peak_force(episode: Episode) -> Array:
    """Peak normal force of the hardest collision that was not clamped; for a free robot a lower bound (see `severity`).

    Args:
        episode: Record whose contacts have peak force, time and duration.

    Returns:
        Shape (n_agents,); NaN for agents without such a collision and in the human row [N].
    """
    return _largest(episode, np.where(clamped(episode), np.nan, episode.contact_peak_force))


def wedged_collisions(episode: Episode) -> Counts:
    """Number of collisions in which a robot was held between bodies that did not yield; see `severity.wedged`.

    Args:
        episode: Record whose contacts have the squeeze.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return _count(episode, wedged(episode))


def collisions_by_severity(episode: Episode, what: Severity) -> Array:
    """Number of collisions with people of one class against ISO/TS 15066, by the simulated peak force.

    Over the values of `what` they add up to `collisions(episode, Partner.PEDESTRIAN)`.

    Args:
        episode: Record whose contacts have peak force, time and duration.
        what: The class that is counted; contacts that were clamped are one of their own.

    Returns:
        Shape (n_agents,), whole numbers; NaN for agents with a collision without physics (human row).
    """
    force = episode.contact_peak_force
    unknown = _count(episode, (episode.contact_partner_kind == Partner.PEDESTRIAN) & np.isnan(force)) > 0
    return np.where(unknown, np.nan, _count(episode, severity(episode, force) == what))


def _count(episode: Episode, which: NDArray[np.bool_]) -> Counts:
    counted = counted_contacts(episode) & which
    return np.bincount(episode.contact_agent[counted], minlength=episode.n_agents).astype(np.int64)


def _largest(episode: Episode, values: Array) -> Array:
    counted = counted_contacts(episode)
    result = np.full(episode.n_agents, np.nan)
    np.fmax.at(result, episode.contact_agent[counted], values[counted])
    return result


def _no_collision(episode: Episode) -> NDArray[np.bool_]:
    return _count(episode, np.ones(len(episode.contact_time), dtype=bool)) == 0


def _no_collision_with_a_force(episode: Episode) -> NDArray[np.bool_]:
    return _count(episode, np.isfinite(episode.contact_peak_force) & ~clamped(episode)) == 0


def _a_collision_without_force(episode: Episode) -> NDArray[np.bool_]:
    with_people = episode.contact_partner_kind == Partner.PEDESTRIAN
    return _count(episode, with_people & np.isnan(episode.contact_peak_force)) > 0


_WHO_MOVED = {
    Fault.AGENT: "only the agent moved towards the other at >= 0.1 m/s",
    Fault.PARTNER: "only the other did",
    Fault.BOTH: "both did",
    Fault.NEITHER: "neither did",
}
_HOW_HARD = {
    Severity.UNDER_QUASI_STATIC: "peak force <= 130 N",
    Severity.UNDER_TRANSIENT: "peak force <= 260 N, for at most 0.5 s",
    Severity.OVER: "more than that",
    Severity.CLAMPED: "while another body was touched too; force meaningless",
}

METRICS = (
    *(
        Metric(
            name=f"collisions_{kind.name.lower()}_by_{who.name.lower()}",
            function=partial(collisions_by_fault, partner=kind, who=who),
            kind=Kind.COUNT,
            better=Better.LESS,
            missing=NEVER,
            needs=(Need.CONTACTS,),
            means=(),
            formula=f"of `collisions_{kind.name.lower()}`: {_WHO_MOVED[who]}",
            source="below",
        )
        for kind in Partner
        for who in Fault
    ),
    *(
        Metric(
            name=f"collisions_{what.name.lower()}",
            function=partial(collisions_by_severity, what=what),
            kind=Kind.COUNT,
            better=Better.LESS,
            missing=Missing(rule="a collision without physics (human row)", where=_a_collision_without_force),
            needs=(Need.CONTACTS, Need.FORCES),
            means=(),
            formula=f"with people, {_HOW_HARD[what]}",
            source="ISO/TS 15066, below",
        )
        for what in Severity
    ),
    Metric(
        name="wedged_collisions",
        function=wedged_collisions,
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=NEVER,
        needs=(Need.CONTACTS, Need.FORCES),
        formula="a robot squeezed by more than 600 N; forces meaningless",
        source="below",
    ),
    Metric(
        name="repeated_collisions",
        function=repeated_collisions,
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        formula="with somebody it collided with before",
    ),
    Metric(
        name="struck_standing",
        function=struck_standing,
        kind=Kind.FLAG,
        better=Better.LESS,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        formula="somebody alone moved into the agent while |v| < 0.1 m/s",
    ),
    Metric(
        name="largest_closing_speed",
        function=largest_closing_speed,
        unit="m/s",
        better=Better.LESS,
        missing=Missing(rule="no collision", where=_no_collision),
        needs=(Need.CONTACTS,),
        formula="of all collisions, person's recorded velocity included",
    ),
    Metric(
        name="largest_peak_force",
        function=largest_peak_force,
        unit="N",
        low=0.0,
        digits=1,
        better=Better.LESS,
        missing=Missing(rule="no such collision, or no physics (human row)", where=_no_collision_with_a_force),
        needs=(Need.CONTACTS, Need.FORCES),
        formula="of all collisions that were not clamped",
        source="below",
    ),
)
