"""Collisions of each agent, by partner; a collision is one contact row: a touch that begins after being apart."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner

NOBODY = -1
"""Value of `first_partner` for agents that touched nobody."""

# Contact times count physics steps, end times control steps: the same instant may differ by rounding [s].
_SAME_TIME = 1e-6


def collisions(episode: Episode, partner: Partner | None = None) -> NDArray[np.int64]:
    """Number of touches that began before or at an agent's end.

    A touch between two agents counts once for each of them. Touches of one pair are several if it parted in between.

    Args:
        episode: The record.
        partner: Count touches with this kind of partner alone; with both if None.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    counted = counted_contacts(episode)
    if partner is not None:
        counted &= episode.contact_partner_kind == partner
    return np.bincount(episode.contact_agent[counted], minlength=episode.n_agents).astype(np.int64)


def first_partner(episode: Episode) -> NDArray[np.int64]:
    """Kind of the first partner each agent touched; at the same instant the pedestrian comes first.

    Args:
        episode: The record.

    Returns:
        Values of `Partner`, or -1 for agents that touched nobody, shape (n_agents,).
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
        episode: The record.

    Returns:
        Shape (k,).
    """
    return episode.contact_time <= episode.agent_end_time[episode.contact_agent] + _SAME_TIME
