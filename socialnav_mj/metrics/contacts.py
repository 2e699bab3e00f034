"""The truth about every contact: where it struck, how fast, first or repeated, and who moved into whom."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, IntArray, Partner
from socialnav_mj.geometry import Array, wrap_angle
from socialnav_mj.metrics.kinematics import STANDING_SPEED
from socialnav_mj.metrics.pairs import pairs, radii

BoolArray = NDArray[np.bool_]


class Fault(IntEnum):
    """Who moved into whom: whose own velocity had a component towards the other of at least `STANDING_SPEED`."""

    AGENT = 0
    """The agent alone, be the partner standing, passing by or walking away."""
    PARTNER = 1
    """The partner alone."""
    BOTH = 2
    """Each moved towards the other."""
    NEITHER = 3
    """Neither: they crept or slid along each other."""


def approach_speeds(episode: Episode) -> tuple[Array, Array]:
    """Each party's own speed towards the other along the contact normal, just before they touch.

    Their sum is `Episode.contact_closing_speed`. A rigid pedestrian's velocity is the recorded one: to the solver its
    mocap body stands still.

    Args:
        episode: Record with k contacts; their normals and both velocities are used.

    Returns:
        The agents' and the partners', each of shape (k,); negative for who moves away [m/s].
    """
    own = np.einsum("kd,kd->k", episode.contact_agent_velocity, episode.contact_normal)
    return own, -np.einsum("kd,kd->k", episode.contact_partner_velocity, episode.contact_normal)


def fault(episode: Episode) -> IntArray:
    """Who moved into whom, contact by contact.

    This is a statement of kinematics, not of blame: whoever moves towards the other in the last physics step is
    responsible, whoever had the right of way.

    Args:
        episode: Record with k contacts, judged by `approach_speeds`.

    Returns:
        Values of `Fault`, shape (k,). Of the two rows of a contact between agents, AGENT in one is PARTNER in
        the other.
    """
    own, others = (speed >= STANDING_SPEED for speed in approach_speeds(episode))
    return np.select([own & others, own, others], [Fault.BOTH, Fault.AGENT, Fault.PARTNER], Fault.NEITHER).astype(
        np.int64
    )


def bearing(episode: Episode) -> Array:
    """Place of each contact on the robot: angle from its heading to the contact normal.

    Args:
        episode: Record with k contacts; their normals and the agents' headings are used.

    Returns:
        Shape (k,), in [-pi, pi): 0 ahead, pi / 2 on the left [rad].
    """
    normal = episode.contact_normal
    return wrap_angle(np.arctan2(normal[:, 1], normal[:, 0]) - episode.contact_agent_heading)


def partner_person(episode: Episode, rows: IntArray) -> IntArray:
    """Ids of the people the partners are, or replace.

    Args:
        episode: Record whose contacts name agents and pedestrians by index.
        rows: (j,) rows of the contact log.

    Returns:
        Ids as they stand in the recording, shape (j,).
    """
    result = np.zeros(len(rows), dtype=np.int64)
    for kind, ids in ((Partner.PEDESTRIAN, episode.pedestrian_person), (Partner.AGENT, episode.agent_person)):
        here = episode.contact_partner_kind[rows] == kind
        result[here] = ids[episode.contact_partner[rows][here]]
    return result


def first_touch(episode: Episode) -> BoolArray:
    """Whether a contact is the first of its agent and partner, and not one after they had parted.

    Args:
        episode: Record with k contacts in the order of time; agent and partner are compared.

    Returns:
        Shape (k,).
    """
    pair = np.stack([episode.contact_agent, episode.contact_partner_kind, episode.contact_partner])
    _, first = np.unique(pair, axis=1, return_index=True)
    result = np.zeros(pair.shape[1], dtype=bool)
    result[first] = True
    return result


def standing(episode: Episode) -> BoolArray:
    """Whether the agent stood still (slower than `STANDING_SPEED` in any direction) just before a contact.

    Args:
        episode: Record with k contacts; the agents' velocities are used.

    Returns:
        Shape (k,).
    """
    return np.linalg.norm(episode.contact_agent_velocity, axis=-1) < STANDING_SPEED


def geometric_contacts(episode: Episode) -> BoolArray:
    """Which agents and pedestrians overlap, from the logged poses alone: the oracle of the physics' contact log.

    Between two samples both bodies are taken to move straight, so that an overlap between samples is seen.

    Args:
        episode: Record whose tracks of agents and pedestrians are compared, and whose scenario gives the radii.

    Returns:
        Shape (n_agents, n_pedestrians): True for pairs whose centres come within the sum of their radii.
    """
    near = pairs(episode)
    m = max(episode.n_pedestrians, 1)
    place = near.agent * m + near.pedestrian
    order = np.lexsort((near.step, place))
    steps, place, offset = near.step[order], place[order], near.offset[order]
    together = (np.diff(place) == 0) & (np.diff(steps) == 1)
    gap = near.distance[order]
    between = np.where(together, _segment_distance(offset[:-1], offset[1:]), np.inf)
    touching = (gap <= sum(radii(episode))) | (np.append(between, np.inf)[: len(gap)] <= sum(radii(episode)))
    result = np.zeros((episode.n_agents, m), dtype=bool)
    result.reshape(-1)[place[touching]] = True
    return result[:, : episode.n_pedestrians]


def pedestrian_overlaps(episode: Episode) -> IntArray:
    """How many other replayed pedestrians each of them overlaps, at the distance at which the human row collides.

    Mocap bodies never touch each other, so this is geometry: centres nearer than the sum of a robot's and a
    pedestrian's radius, at the samples or on the straight line between two. It says how much of an agent's collisions
    is the crowd's own density: at this distance people touch who in truth walked past each other, or arm in arm.

    Args:
        episode: Record whose tracks of pedestrians are compared, and whose scenario gives the radii.

    Returns:
        Shape (n_pedestrians,).
    """
    limit, position = sum(radii(episode)), episode.pedestrian_position
    met = np.zeros((episode.n_pedestrians,) * 2, dtype=bool)
    for now, after in zip(position, [*position[1:], position[-1]], strict=True):
        here = np.flatnonzero(np.isfinite(now[:, 0]))
        begin = now[here][:, None] - now[here]
        end = after[here][:, None] - after[here]
        end = np.where(np.isnan(end), begin, end)
        met[np.ix_(here, here)] |= _segment_distance(begin, end) <= limit
    np.fill_diagonal(met, False)
    return met.sum(axis=1)


def _segment_distance(begin: Array, end: Array) -> Array:
    """Smallest distance of the origin to the segments from begin to end, both of shape (..., 2)."""
    way = end - begin
    squared = np.einsum("...d,...d->...", way, way)
    share = np.divide(-np.einsum("...d,...d->...", begin, way), squared, out=np.zeros_like(squared), where=squared > 0)
    return np.linalg.norm(begin + np.clip(share, 0.0, 1.0)[..., None] * way, axis=-1)
