"""Collisions of each agent told apart: whose fault, first or repeated, struck while standing, how hard."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import counted_contacts
from socialnav_mj.metrics.contacts import Fault, fault, first_touch, standing
from socialnav_mj.metrics.severity import Severity, severity

Counts = NDArray[np.int64]


def collisions_by_fault(episode: Episode, partner: Partner, who: Fault) -> Counts:
    """Number of collisions with one kind of partner in which one party moved into the other.

    Over the values of `who` they add up to `collisions(episode, partner)`.

    Args:
        episode: The record.
        partner: Kind of partner.
        who: Whose fault.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return _count(episode, (episode.contact_partner_kind == partner) & (fault(episode) == who))


def repeated_collisions(episode: Episode) -> Counts:
    """Number of collisions with somebody the agent had touched before and parted from.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return _count(episode, ~first_touch(episode))


def struck_standing(episode: Episode) -> NDArray[np.bool_]:
    """Whether an agent was ever walked into while it stood still: partner's fault, own speed under 0.1 m/s.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); False for agents that never spawned.
    """
    return _count(episode, standing(episode) & (fault(episode) == Fault.PARTNER)) > 0


def largest_closing_speed(episode: Episode) -> Array:
    """Closing speed of the fastest collision, with whomever.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents without a collision [m/s].
    """
    return _largest(episode, episode.contact_closing_speed)


def largest_peak_force(episode: Episode) -> Array:
    """Peak normal force of the hardest collision, with whomever; see `severity` for what it is worth.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents without a collision and in the human row [N].
    """
    return _largest(episode, episode.contact_peak_force)


def collision_impulse(episode: Episode) -> Array:
    """Sum of the normal impulses of all collisions.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,), >= 0; 0 for agents without a collision, NaN where there was no physics [N s].
    """
    counted = counted_contacts(episode)
    return np.bincount(
        episode.contact_agent[counted], episode.contact_impulse[counted], minlength=episode.n_agents
    ).astype(float)


def collisions_over_limit(episode: Episode) -> Array:
    """Number of collisions with people whose simulated force exceeds ISO/TS 15066's limit for the lower leg.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,), whole numbers; NaN where there was no physics.
    """
    person = episode.contact_partner_kind == Partner.PEDESTRIAN
    over = severity(episode.contact_peak_force, episode.contact_duration) == Severity.OVER
    unknown = _count(episode, person & np.isnan(episode.contact_peak_force)) > 0
    return np.where(unknown, np.nan, _count(episode, person & over))


def _count(episode: Episode, which: NDArray[np.bool_]) -> Counts:
    counted = counted_contacts(episode) & which
    return np.bincount(episode.contact_agent[counted], minlength=episode.n_agents).astype(np.int64)


def _largest(episode: Episode, values: Array) -> Array:
    counted = counted_contacts(episode)
    result = np.full(episode.n_agents, np.nan)
    np.fmax.at(result, episode.contact_agent[counted], values[counted])
    return result
