"""Collisions of each agent, by partner; a collision is one contact row: a touch that begins after being apart."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Kind, Mean, Metric, Need
from socialnav_mj.metrics.missing import NEVER

NOBODY = -1
"""Value of `first_partner` for agents without a collision."""

# Contact times count physics steps, end times control steps: the same instant may differ by rounding [s].
_SAME_TIME = 1e-6


def collisions(episode: Episode, partner: Partner | None = None) -> NDArray[np.int64]:
    """Number of collisions that began before or at an agent's end.

    A collision of two agents counts once for each of them. A pair that parted and met again has several.

    Args:
        episode: Record whose contact log is counted, up to each agent's end.
        partner: Count collisions with this kind of partner alone; with both if None.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    counted = counted_contacts(episode)
    if partner is not None:
        counted &= episode.contact_partner_kind == partner
    return np.bincount(episode.contact_agent[counted], minlength=episode.n_agents).astype(np.int64)


def first_partner(episode: Episode) -> NDArray[np.int64]:
    """Kind of the partner of each agent's first collision; at the same instant the pedestrian comes first.

    Args:
        episode: Record whose contact log is read in the order of time.

    Returns:
        Values of `Partner`, or -1 for agents without a collision, shape (n_agents,).
    """
    result = np.full(episode.n_agents, NOBODY, dtype=np.int64)
    counted = np.flatnonzero(counted_contacts(episode))
    order = counted[np.lexsort((episode.contact_partner_kind[counted], episode.contact_time[counted]))]
    agents, first = np.unique(episode.contact_agent[order], return_index=True)
    result[agents] = episode.contact_partner_kind[order[first]]
    return result


def counted_contacts(episode: Episode) -> NDArray[np.bool_]:
    """Which contacts are collisions of their agent: those that began before or at its end.

    Args:
        episode: Record with k contacts; their times and the agents' ends are compared.

    Returns:
        True for those that count, shape (k,).
    """
    return episode.contact_time <= episode.agent_end_time[episode.contact_agent] + _SAME_TIME


def number_of(episode: Episode, which: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of an agent's collisions of some kind.

    Args:
        episode: Record with k contacts.
        which: Contacts of that kind, shape (k,).

    Returns:
        Shape (n_agents,).
    """
    counted = counted_contacts(episode) & which
    return np.bincount(episode.contact_agent[counted], minlength=episode.n_agents).astype(np.int64)


def largest_of(episode: Episode, values: Array) -> Array:
    """Largest value of an agent's collisions.

    Args:
        episode: Record with k contacts.
        values: Shape (k,); NaN for those that are left out.

    Returns:
        Shape (n_agents,); NaN for agents without a collision that has a value.
    """
    counted = counted_contacts(episode)
    result = np.full(episode.n_agents, np.nan)
    np.fmax.at(result, episode.contact_agent[counted], values[counted])
    return result


METRICS = (
    Metric(
        name="collisions_pedestrian",
        function=partial(collisions, partner=Partner.PEDESTRIAN),
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        formula="contacts with people: a pair that touches after having been apart for 0.2 s",
        source="HuNavSim: every step and person within 2 cm; contact *points* triple a flat touch",
    ),
    Metric(
        name="collisions_agent",
        function=partial(collisions, partner=Partner.AGENT),
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        formula="contacts with other agents; each of the two counts one",
    ),
    Metric(
        name="first_partner",
        function=first_partner,
        kind=Kind.NAME,
        names={int(partner): partner.name.lower() for partner in Partner},
        better=Better.NEITHER,
        missing=NEVER,
        needs=(Need.CONTACTS,),
        means=(
            Mean(
                name="first_hit_pedestrian",
                heading="first collision with a pedestrian",
                share_of="pedestrian",
                narrow="touched\na person",
            ),
            Mean(
                name="first_hit_agent",
                heading="first collision with an agent",
                share_of="agent",
                narrow="touched\nan agent",
            ),
        ),
        formula="kind of the first partner; -1: nobody",
    ),
)
