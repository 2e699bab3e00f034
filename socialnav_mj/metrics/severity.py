"""How hard contacts with people were: the impact, the push after it, and the limits of ISO/TS 15066 for the lower leg.

The bumper meets a person 0.10 m above the floor, at the lower leg. ISO/TS 15066:2016, table A.2, gives for lower legs
(shin, calf) 130 N in quasi-static contact and twice that in transient contact, which lasts at most 0.5 s and leaves
the leg free to recoil. The limits are pain thresholds of adults, not of injury, and there are pressure limits too
(220 and 210 N/cm^2), which need a contact area that a simulation of two smooth bodies does not know.

The *impact* is the first 0.1 s after the first touch. Its impulse is the momentum that the two bodies exchange
(`impact_momentum`), and sideways what the tyres hold against besides: within a factor of 1.5 in every case of
docs/metrics.md, "Forces". Its largest force is the simulation's, of a soft contact: `flesh_force` is what the same
closing speed would make on flesh and bone. The *push* is what follows: as long as somebody goes on walking into a robot
that brakes. Its impulse grows with the time and says nothing of a blow; sideways its force chatters as the robot hops.
Two bodies that hold a robot between them make forces without a limit; such contacts are *clamped*, and no force of
theirs is told.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.contact import IMPACT_DURATION
from socialnav_mj.episode import Episode, IntArray, Partner
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.contacts import bearing

QUASI_STATIC_FORCE = 130.0
"""Lower legs, ISO/TS 15066:2016 table A.2 [N]."""
TRANSIENT_FORCE = 260.0
"""Lower legs: twice the quasi-static one, same table [N]."""
TRANSIENT_DURATION = 0.5
"""A longer contact is quasi-static (ISO/TS 15066, 5.5.4 and annex A) [s]."""
LEG_STIFFNESS = 60_000.0
"""Effective spring constant of the lower leg, ISO/TS 15066 table A.3 [N/m]."""
LEG_MASS = 75.0
"""Effective mass behind it, the whole body, ISO/TS 15066 table A.3 [kg]."""
ROBOT_MASS = 8.0
"""assets/robot.xml, without the rotors that the wheels turn [kg]."""
ROTOR_MASS = 2.0 * (0.004 + 0.00054) / 0.06**2
"""What rotors and wheels add along the wheels: their inertia over the wheels' radius squared, assets/robot.xml [kg]."""

WEDGE_FORCE = 600.0
"""A robot that is squeezed harder is wedged. What its drive and its mass can explain is less: 10.5 kg (8 kg and 2.5 kg
of rotors along the wheels) stopped from a walker's 1.3 m/s by a critically damped contact with a time constant of
0.05 s, 2 m v / tau = 546 N, and 32 N of drive. Measured in students003: at most 350 N in a jam of robots that push on
without end (scenario 4, go_straight, 120 s, 530 contacts), 26 000 N between two people [N]."""


class Severity(IntEnum):
    """Class of a contact force against the limits for the lower leg."""

    UNDER_QUASI_STATIC = 0
    """An impact of at most 130 N, and a push of no more than that."""
    UNDER_TRANSIENT = 1
    """An impact of at most 260 N, and a push of at most 130 N."""
    OVER = 2
    """More than that."""
    CLAMPED = 3
    """Between two bodies; the force has no meaning, and is not told."""


def reduced_mass(bearing: Array) -> Array:
    """Mass of robot and person against each other, mu = 1 / (1 / robot mass + 1 / leg mass).

    A push along the wheels has to turn the rotors, one across them does not:
    1 / robot mass = cos^2 / (8 kg + 2.5 kg) + sin^2 / 8 kg of the angle between heading and normal.

    Args:
        bearing: Of the contact on the robot, see `contacts.bearing`, shape (k,) [rad].

    Returns:
        Shape (k,), from 7.2 kg sideways to 9.2 kg ahead [kg].
    """
    along, across = np.cos(bearing) ** 2, np.sin(bearing) ** 2
    return 1.0 / (along / (ROBOT_MASS + ROTOR_MASS) + across / ROBOT_MASS + 1.0 / LEG_MASS)


def impact_momentum(episode: Episode) -> Array:
    """Momentum that an impact exchanges until both have one speed: mu times the closing speed, floor and motors aside.

    Args:
        episode: Record with k contacts; velocities, normal, heading and kind of partner are used.

    Returns:
        Shape (k,), >= 0; NaN for contacts with other agents [N s].
    """
    momentum = np.maximum(episode.contact_closing_speed, 0.0) * reduced_mass(bearing(episode))
    return np.where(episode.contact_partner_kind == Partner.PEDESTRIAN, momentum, np.nan)


def flesh_force(episode: Episode) -> Array:
    """Peak force that the closing speed would make on a real lower leg: v sqrt(mu k) (ISO/TS 15066 annex A.3).

    mu is `reduced_mass` and k the leg's stiffness; both bodies free, no damping, the robot rigid: 744 N per m/s along
    the wheels, 659 across. An upper estimate, as a padded bumper and a yielding leg lessen it.

    Args:
        episode: Record with k contacts; velocities, normal, heading and kind of partner are used.

    Returns:
        Shape (k,), >= 0; NaN for contacts with other agents [N].
    """
    force = np.maximum(episode.contact_closing_speed, 0.0) * np.sqrt(reduced_mass(bearing(episode)) * LEG_STIFFNESS)
    return np.where(episode.contact_partner_kind == Partner.PEDESTRIAN, force, np.nan)


def clamped(episode: Episode) -> NDArray[np.bool_]:
    """Whether the agent touched another body during the impact, so that its forces are not those of two bodies.

    Args:
        episode: Record with k contacts; agent, time and duration are used.

    Returns:
        Shape (k,).
    """
    agent, begin = episode.contact_agent, episode.contact_time
    end = begin + episode.contact_duration
    impact_end = np.minimum(end, begin + IMPACT_DURATION)
    together = (agent[:, None] == agent) & (begin[:, None] < end) & (begin < impact_end[:, None])
    np.fill_diagonal(together, False)
    return together.any(axis=1)


def wedged(episode: Episode) -> NDArray[np.bool_]:
    """Whether a robot of the contact was held between bodies that did not yield, so that its forces mean nothing.

    Robots push with what their motors and mass give; a replayed person is moved by nothing. So a robot between two
    people, or a row of robots between two, is squeezed without limit: by more than `WEDGE_FORCE`.

    Args:
        episode: Record with k contacts; their squeeze is used.

    Returns:
        Shape (k,); False in the human row.
    """
    return np.nan_to_num(episode.contact_squeeze) > WEDGE_FORCE


def pushing_force(episode: Episode) -> Array:
    """Mean force of the push that follows an impact: its impulse over the time in touch.

    Args:
        episode: Record with k contacts; the push's impulse and duration are used.

    Returns:
        Shape (k,); 0 without a push, NaN in the human row [N].
    """
    duration = episode.contact_push_duration
    return np.divide(episode.contact_push_impulse, duration, out=0.0 * duration, where=duration > 0.0)


def severity(episode: Episode, force: Array) -> IntArray:
    """Class of each contact with a person, of its impact by one force and of the push after it by its mean force.

    The impact is transient and is held against 260 N. If the contact lasts longer than 0.5 s, what goes on is
    quasi-static: its mean force is held against 130 N, unless the robot was wedged meanwhile.

    Args:
        episode: Record with k contacts; kind of partner, time, duration and push are used.
        force: Of the impacts, `episode.contact_impact_force` or `flesh_force(episode)`, shape (k,) [N].

    Returns:
        Values of `Severity`, shape (k,); -1 for contacts with agents and where the force is NaN.
    """
    lasting = (episode.contact_duration > TRANSIENT_DURATION) & ~wedged(episode)
    over = (force > TRANSIENT_FORCE) | (lasting & (pushing_force(episode) > QUASI_STATIC_FORCE))
    classes = np.where(force > QUASI_STATIC_FORCE, Severity.UNDER_TRANSIENT, Severity.UNDER_QUASI_STATIC)
    classes = np.where(over, Severity.OVER, classes)
    classes = np.where(clamped(episode), Severity.CLAMPED, classes)
    unknown = np.isnan(force) | (episode.contact_partner_kind != Partner.PEDESTRIAN)
    return np.where(unknown, -1, classes).astype(np.int64)
