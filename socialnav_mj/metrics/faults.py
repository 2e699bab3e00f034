"""Collisions of each agent told apart: whose fault, first or repeated, struck while standing, how hard."""

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import counted_contacts
from socialnav_mj.metrics.contacts import Fault, fault, first_touch, standing
from socialnav_mj.metrics.severity import Severity, clamped, severity, wedged

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
    """Peak normal force of the hardest collision that was not clamped; see `severity` for what it is worth.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); NaN for agents without such a collision and in the human row [N].
    """
    return _largest(episode, np.where(clamped(episode), np.nan, episode.contact_peak_force))


def wedged_collisions(episode: Episode) -> Counts:
    """Number of collisions in which a robot was held between bodies that did not yield; see `severity.wedged`.

    Args:
        episode: The record.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return _count(episode, wedged(episode))


def collisions_by_severity(episode: Episode, what: Severity) -> Array:
    """Number of collisions with people of one class against ISO/TS 15066, by the simulated peak force.

    Over the values of `what` they add up to `collisions(episode, Partner.PEDESTRIAN)`.

    Args:
        episode: The record.
        what: The class.

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
