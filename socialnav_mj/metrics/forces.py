"""How hard an agent's collisions were: impact, push, and their classes against ISO/TS 15066; see `severity`."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.collisions import counted_contacts, largest_of, number_of
from socialnav_mj.metrics.contacts import Fault, fault, standing
from socialnav_mj.metrics.metric import Better, Kind, Metric, Need
from socialnav_mj.metrics.missing import NEVER, Missing
from socialnav_mj.metrics.severity import Severity, clamped, severity, wedged

SHOVE_DURATION = 1.0
"""A standing agent that is pushed at least this long was shoved, and not only struck [s]."""


def shoved(episode: Episode) -> NDArray[np.bool_]:
    """Whether an agent was walked into while it stood still, and then pushed on for `SHOVE_DURATION` or longer.

    Args:
        episode: Record with k contacts; the velocities of both just before and the push's duration are used.

    Returns:
        Shape (k,); False in the human row.
    """
    walked_into = standing(episode) & (fault(episode) == Fault.PARTNER)
    return walked_into & (episode.contact_push_duration >= SHOVE_DURATION - 1e-9)


def largest_impact_force(episode: Episode) -> Array:
    """Largest normal force within 0.1 s of the first touch, of the hardest collision that was not clamped.

    Args:
        episode: Record whose contacts have impact force, time and duration.

    Returns:
        Shape (n_agents,); NaN for agents without such a collision and in the human row [N].
    """
    return largest_of(episode, np.where(clamped(episode), np.nan, episode.contact_impact_force))


def largest_impact_impulse(episode: Episode) -> Array:
    """Impulse within 0.1 s of the first touch, of the collision with the largest one that was not clamped.

    Args:
        episode: Record whose contacts have impact impulse, time and duration.

    Returns:
        Shape (n_agents,); NaN for agents without such a collision and in the human row [N s].
    """
    return largest_of(episode, np.where(clamped(episode), np.nan, episode.contact_impact_impulse))


def push_duration(episode: Episode) -> Array:
    """Time that an agent's collisions went on after their first 0.1 s, whoever pushed whom.

    Args:
        episode: Record whose contacts have the push's duration.

    Returns:
        Shape (n_agents,), summed over its collisions; NaN for agents with a collision without physics [s].
    """
    return _sum(episode, episode.contact_push_duration)


def push_impulse(episode: Episode) -> Array:
    """Impulse of an agent's collisions after their first 0.1 s; wedged ones, whose forces mean nothing, are left out.

    Args:
        episode: Record whose contacts have the push's impulse and the squeeze.

    Returns:
        Shape (n_agents,), summed over its collisions; NaN for agents with a collision without physics [N s].
    """
    return _sum(episode, np.where(wedged(episode), 0.0, episode.contact_push_impulse))


def shoved_standing(episode: Episode) -> Array:
    """How often an agent was `shoved` while it stood.

    Args:
        episode: Record whose contacts have the velocities of both just before, and the push's duration.

    Returns:
        Shape (n_agents,), whole numbers; NaN for agents with a collision without physics.
    """
    return _sum(episode, shoved(episode).astype(float))


def time_shoved_standing(episode: Episode) -> Array:
    """How long an agent was pushed in the collisions that `shoved_standing` counts.

    Args:
        episode: Record whose contacts have the velocities of both just before, and the push's duration.

    Returns:
        Shape (n_agents,); NaN for agents with a collision without physics [s].
    """
    return _sum(episode, np.where(shoved(episode), episode.contact_push_duration, 0.0))


def largest_held_back(episode: Episode) -> Array:
    """How far a pedestrian that the agent collided with was held back from its recorded place during the collision.

    Args:
        episode: Record whose contacts have the distance by which a pedestrian fell behind.

    Returns:
        Shape (n_agents,), the largest of its collisions with people; 0 where people are rigid, NaN for agents without
        such a collision and in the human row [m].
    """
    return largest_of(episode, np.where(_with_people(episode), episode.contact_held_back, np.nan))


def wedged_collisions(episode: Episode) -> NDArray[np.int64]:
    """Number of collisions in which a robot was held between bodies that did not yield; see `severity.wedged`.

    Args:
        episode: Record whose contacts have the squeeze.

    Returns:
        Shape (n_agents,); 0 for agents that never spawned.
    """
    return number_of(episode, wedged(episode))


def collisions_by_severity(episode: Episode, what: Severity) -> Array:
    """Number of collisions with people of one class against ISO/TS 15066, by the simulated forces.

    Over the values of `what` they add up to `collisions(episode, Partner.PEDESTRIAN)`.

    Args:
        episode: Record whose contacts have time, duration, impact and push.
        what: The class that is counted; contacts that were clamped are one of their own.

    Returns:
        Shape (n_agents,), whole numbers; NaN for agents with a collision without physics (human row).
    """
    force = episode.contact_impact_force
    unknown = number_of(episode, _with_people(episode) & np.isnan(force)) > 0
    return np.where(unknown, np.nan, number_of(episode, severity(episode, force) == what))


def _sum(episode: Episode, values: Array) -> Array:
    """Sum of a force's property over each agent's collisions; NaN where there was no physics."""
    counted = counted_contacts(episode)
    values = np.where(np.isnan(episode.contact_push_duration), np.nan, values)
    result = np.zeros(episode.n_agents)
    np.add.at(result, episode.contact_agent[counted], values[counted])
    return result


def _with_people(episode: Episode) -> NDArray[np.bool_]:
    return episode.contact_partner_kind == Partner.PEDESTRIAN


def _no_collision_with_a_body_of_a_person(episode: Episode) -> NDArray[np.bool_]:
    return number_of(episode, _with_people(episode) & np.isfinite(episode.contact_held_back)) == 0


def _no_collision_with_a_force(episode: Episode) -> NDArray[np.bool_]:
    return number_of(episode, np.isfinite(episode.contact_impact_force) & ~clamped(episode)) == 0


def _a_collision_without_force(episode: Episode) -> NDArray[np.bool_]:
    return number_of(episode, _with_people(episode) & np.isnan(episode.contact_impact_force)) > 0


def _a_collision_without_physics(episode: Episode) -> NDArray[np.bool_]:
    return number_of(episode, np.isnan(episode.contact_push_duration)) > 0


_NO_PHYSICS = Missing(rule="a collision without physics (human row)", where=_a_collision_without_physics)
_HOW_HARD = {
    Severity.UNDER_QUASI_STATIC: "impact force and mean push <= 130 N",
    Severity.UNDER_TRANSIENT: "impact force <= 260 N, mean push <= 130 N",
    Severity.OVER: "more than that; a push counts in contacts longer than 0.5 s",
    Severity.CLAMPED: "another body was touched during the impact; force meaningless",
}

METRICS = (
    *(
        Metric(
            name=f"collisions_{what.name.lower()}",
            function=partial(collisions_by_severity, what=what),
            kind=Kind.COUNT,
            better=Better.LESS,
            missing=Missing(
                rule="a collision with people without physics (human row)", where=_a_collision_without_force
            ),
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
    *(
        Metric(
            name=name,
            function=function,
            unit=unit,
            low=0.0,
            digits=1,
            better=Better.LESS,
            missing=Missing(rule="no such collision, or no physics (human row)", where=_no_collision_with_a_force),
            needs=(Need.CONTACTS, Need.FORCES),
            formula=f"{what} in the first 0.1 s, of all collisions that were not clamped",
            source="below",
        )
        for name, function, unit, what in (
            ("largest_impact_force", largest_impact_force, "N", "largest force"),
            ("largest_impact_impulse", largest_impact_impulse, "N s", "impulse"),
        )
    ),
    *(
        Metric(
            name=name,
            function=function,
            unit=unit,
            low=0.0,
            digits=2,
            better=Better.LESS,
            missing=_NO_PHYSICS,
            needs=(Need.CONTACTS, Need.FORCES),
            formula=formula,
            source="below",
        )
        for name, function, unit, formula in (
            ("push_duration", push_duration, "s", "time in touch after the first 0.1 s, of all collisions"),
            ("push_impulse", push_impulse, "N s", "impulse in that time; wedged collisions left out"),
        )
    ),
    Metric(
        name="shoved_standing",
        function=shoved_standing,
        kind=Kind.COUNT,
        better=Better.LESS,
        missing=_NO_PHYSICS,
        needs=(Need.CONTACTS, Need.FORCES),
        formula="somebody alone moved into the agent while |v| < 0.1 m/s and pushed it for 1 s or longer",
        source="below",
    ),
    Metric(
        name="time_shoved_standing",
        function=time_shoved_standing,
        unit="s",
        low=0.0,
        digits=2,
        better=Better.LESS,
        missing=_NO_PHYSICS,
        needs=(Need.CONTACTS, Need.FORCES),
        formula="push duration of these collisions",
        source="below",
    ),
    Metric(
        name="largest_held_back",
        function=largest_held_back,
        unit="m",
        low=0.0,
        better=Better.LESS,
        missing=Missing(
            rule="no collision with people, or no physics (human row)", where=_no_collision_with_a_body_of_a_person
        ),
        needs=(Need.CONTACTS, Need.FORCES),
        formula="growth of a pedestrian's distance from its recorded place during a collision; 0 for rigid ones",
        source="ours; below",
    ),
)
