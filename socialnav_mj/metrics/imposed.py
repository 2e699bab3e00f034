"""What an agent costs the people around it: the braking it leaves to them and, if they react, way and time."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Kind, Metric, Need
from socialnav_mj.metrics.missing import NO_STEP
from socialnav_mj.metrics.pairs import pairs, radii
from socialnav_mj.metrics.time_to_collision import disc_contact_time

COMFORTABLE_BRAKING = 1.0
"""Braked with this, somebody who walks at 1.3 m/s stops within 0.85 m, a long step; harder is a start [m/s^2]."""
BRAKING_HORIZON = 4.0
"""Collisions farther ahead are nobody's concern yet [s]."""
SLOWEST_WALK = 0.5
"""Delays are told at this speed at least, so that who stands is not late without end [m/s]."""


def deviation_imposed(episode: Episode) -> Array:
    """Metres by which an agent made people leave their recorded tracks.

    Every growth of a person's distance from its recorded place, from one sample to the next, is charged to the agent
    under way that is nearest to it. Way back is not: who returns pays nothing again.

    Args:
        episode: Record with the deviations of people.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents without a step [m].
    """
    return _charged(episode, np.hypot(*np.moveaxis(_deviation(episode), -1, 0)))


def delay_imposed(episode: Episode) -> Array:
    """Seconds by which an agent held people back behind their recorded places.

    A person is late by the part of its deviation that is against its recorded heading, over its mean recorded speed,
    or `SLOWEST_WALK` if that is less. Growth is charged as in `deviation_imposed`.

    Args:
        episode: Record with deviations, tracks and headings of people.

    Returns:
        Shape (n_agents,), >= 0; NaN for agents without a step [s].
    """
    off, heading = _deviation(episode), episode.pedestrian_heading
    behind = np.maximum(-(off[..., 0] * np.cos(heading) + off[..., 1] * np.sin(heading)), 0.0)
    steps = np.linalg.norm(np.diff(episode.pedestrian_position - off, axis=0), axis=-1)
    count = np.isfinite(steps).sum(axis=0)
    speed = np.nansum(steps, axis=0) / np.maximum(count, 1) / episode.control_timestep
    return _charged(episode, behind / np.maximum(speed, SLOWEST_WALK))


def braking_imposed(episode: Episode) -> Array:
    """Active steps in which an agent leaves it to somebody to brake hard.

    Both keep their velocities, and their discs would touch within `BRAKING_HORIZON`. The person can take min(w, c) out
    of the approach, w being its own speed along the line of centres and c the speed at which the gap g closes, for
    which it has to brake with min(w, c)^2 / (2 g). A step counts once if that is more than `COMFORTABLE_BRAKING` for
    anybody, or if they touch while the person walks on towards the agent.

    Args:
        episode: Record with the tracks of agents and pedestrians; its scenario gives the radii.

    Returns:
        Shape (n_agents,); whole numbers, NaN for agents without an active step.
    """
    here, distance = pairs(episode), sum(radii(episode))
    away = here.offset / np.maximum(here.distance, 1e-9)[:, None]
    closing = -np.einsum("kd,kd->k", here.velocity, away)
    own = -np.einsum("kd,kd->k", episode.pedestrian_velocity[here.step, here.pedestrian], away)
    gap = here.distance - distance
    taken = np.maximum(np.minimum(own, closing), 0.0)
    hard = taken**2 > 2.0 * COMFORTABLE_BRAKING * np.maximum(gap, 0.0)
    hard &= here.active & (disc_contact_time(here.offset, here.velocity, distance) <= BRAKING_HORIZON)
    steps = np.zeros(episode.agent_active.shape, dtype=bool)
    steps[here.step[hard], here.agent[hard]] = True
    return np.where(episode.agent_active.any(axis=0), steps.sum(axis=0).astype(float), np.nan)


def _deviation(episode: Episode) -> Array:
    """(t, m, 2), zeros if everybody keeps to the recording."""
    off = episode.pedestrian_deviation
    return np.zeros_like(episode.pedestrian_position) if off is None else off


def _charged(episode: Episode, amount: Array) -> Array:
    """Growth of an amount of each person, (t, m), added up for the agents that are nearest to it."""
    total = np.zeros(episode.n_agents)
    growth = np.zeros_like(amount)
    if len(amount) > 1:
        growth[:-1] = np.maximum(np.nan_to_num(np.diff(amount, axis=0)), 0.0)
    near = pairs(episode)
    counted = np.flatnonzero(near.active & (growth[near.step, near.pedestrian] > 0.0))
    if counted.size:
        step, person = near.step[counted], near.pedestrian[counted]
        order = np.lexsort((near.agent[counted], near.distance[counted], person, step))
        first = np.ones(len(order), dtype=bool)
        first[1:] = (np.diff(step[order]) != 0) | (np.diff(person[order]) != 0)
        nearest = order[first]
        np.add.at(total, near.agent[counted][nearest], growth[step[nearest], person[nearest]])
    return np.where(episode.agent_active.any(axis=0), total, np.nan)


METRICS = (
    Metric(
        name="braking_imposed",
        function=braking_imposed,
        formula="steps (*rate*) with somebody on collision course within 4 s who would have to brake with more than "
        "1 m/s^2: min(w, c)^2 / (2 g), w the person's speed towards the agent, c the speed at which the gap g closes",
        better=Better.LESS,
        missing=NO_STEP,
        unit="steps",
        kind=Kind.COUNT,
        digits=1,
        needs=(Need.POSITION, Need.VELOCITY, Need.PEDESTRIANS),
        heading="imposed braking",
        source="ours, after the deceleration rate to avoid a crash (Almqvist, Hyden and Risser 1991); people who "
        "replay do not brake",
    ),
    Metric(
        name="deviation_imposed",
        function=deviation_imposed,
        formula="sum over people and steps of the growth of their distance from the recorded place, while this agent "
        "is the nearest one under way",
        better=Better.LESS,
        missing=NO_STEP,
        unit="m",
        low=0.0,
        needs=(Need.POSITION, Need.PEDESTRIANS, Need.DEVIATIONS),
        heading="imposed deviation",
        digits=2,
        source="ours; 0 unless people react or can be held back",
    ),
    Metric(
        name="delay_imposed",
        function=delay_imposed,
        formula="the same of the time by which they are behind: deviation against the recorded heading / "
        "max(mean recorded speed, 0.5 m/s)",
        better=Better.LESS,
        missing=NO_STEP,
        unit="s",
        low=0.0,
        needs=(Need.POSITION, Need.PEDESTRIANS, Need.DEVIATIONS),
        heading="imposed delay",
        digits=2,
        source="ours; as above",
    ),
)
