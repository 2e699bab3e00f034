"""What an agent costs the people around it, if they react: metres off their recorded tracks, and seconds of delay."""

import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.metric import Better, Metric, Need
from socialnav_mj.metrics.missing import NO_STEP
from socialnav_mj.metrics.pairs import pairs

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
