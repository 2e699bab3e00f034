"""Collisions of each agent told apart: whose fault, first or repeated, struck while standing, how fast."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import largest_of, number_of
from socialnav_mj.metrics.contacts import Fault, fault, first_touch, standing
from socialnav_mj.metrics.metric import Better, Kind, Metric, Need
from socialnav_mj.metrics.missing import NEVER, Missing

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
    return number_of(episode, (episode.contact_partner_kind == partner) & (fault(episode) == who))


def repeated_collisions(episode: Episode) -> Counts:
    """Number of collisions with somebody the agent had collided with before.

    Args:
        episode: Record whose contact log is counted, agent and partner by agent and partner.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return number_of(episode, ~first_touch(episode))


def struck_standing(episode: Episode) -> NDArray[np.bool_]:
    """Whether an agent was ever walked into while it stood still: partner's fault, own speed under 0.1 m/s.

    Args:
        episode: Record whose contacts have the velocities of both just before.

    Returns:
        Shape (n_agents,); False for agents that never spawned.
    """
    return number_of(episode, standing(episode) & (fault(episode) == Fault.PARTNER)) > 0


def largest_closing_speed(episode: Episode) -> Array:
    """Closing speed of the fastest collision, with whomever.

    Args:
        episode: Record whose contacts have normal and velocities.

    Returns:
        Shape (n_agents,); NaN for agents without a collision [m/s].
    """
    return largest_of(episode, episode.contact_closing_speed)


def _no_collision(episode: Episode) -> NDArray[np.bool_]:
    return number_of(episode, np.ones(len(episode.contact_time), dtype=bool)) == 0


_WHO_MOVED = {
    Fault.AGENT: "only the agent moved towards the other at >= 0.1 m/s",
    Fault.PARTNER: "only the other did",
    Fault.BOTH: "both did",
    Fault.NEITHER: "neither did",
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
            formula=f"of `collisions_{kind.name.lower()}`: {_WHO_MOVED[who]}",
            source="below",
        )
        for kind in Partner
        for who in Fault
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
)
