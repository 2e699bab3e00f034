"""How hard contacts with people were, against the limits of ISO/TS 15066 for the lower leg.

The bumper meets a person 0.10 m above the floor, at the lower leg. ISO/TS 15066:2016, table A.2, gives for lower legs
(shin, calf) 130 N in quasi-static contact and twice that in transient contact, which lasts at most 0.5 s and leaves
the leg free to recoil. The limits are pain thresholds of adults, not of injury, and there are pressure limits too
(220 and 210 N/cm^2), which need a contact area that a simulation of two smooth bodies does not know.

What the simulation's forces are, and are not: a replayed person is a mocap body, infinitely heavy and never pushed
back, behind a soft contact (`solref 0.05 1`: critically damped, time constant 0.05 s, whatever the mass). The robot is
brought to the person's speed over about 0.1 s, against its wheels' friction (up to 63 N sideways) and servo (32 N). In
students003 (three draws, four scenarios, potential_field and go_straight) no free robot felt more than 556 N; flesh on
bone would give 659 N per m/s (`flesh_force`). So *impulse* and *closing speed* are sound, and the *peak force* of a
free robot is a lower bound. Between two people the robot is *clamped*: neither yields, the softness of the two contacts
no longer lessens the force, and it reaches 83 000 N. That number means only that the people of the recording walked
where the robot was; such contacts are counted by themselves (`clamped`), without a force.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import Episode, IntArray, Partner
from socialnav_mj.geometry import Array

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

WEDGE_FORCE = 600.0
"""A robot that is squeezed harder is wedged. What its drive and its mass can explain is less: 10.5 kg (8 kg and 2.5 kg
of rotors along the wheels) stopped from a walker's 1.3 m/s by a critically damped contact with a time constant of
0.05 s, 2 m v / tau = 546 N, and 32 N of drive. Measured in students003: at most 350 N in a jam of robots that push on
without end (scenario 4, go_straight, 120 s, 530 contacts), 26 000 N between two people [N]."""


class Severity(IntEnum):
    """Class of a contact force against the limits for the lower leg."""

    UNDER_QUASI_STATIC = 0
    """At most 130 N: allowed however long it lasts."""
    UNDER_TRANSIENT = 1
    """At most 260 N, in a contact of at most 0.5 s."""
    OVER = 2
    """More than its kind of contact allows."""
    CLAMPED = 3
    """Between two bodies; the force has no meaning."""


def flesh_force(episode: Episode) -> Array:
    """Peak force that the closing speed would make on a real lower leg: v sqrt(mu k) (ISO/TS 15066 annex A.3).

    mu = 1 / (1 / robot mass + 1 / leg mass) is the reduced mass and k the leg's stiffness; both bodies free, no
    damping, the robot rigid: 659 N per m/s. An upper estimate, as a padded bumper and a yielding leg lessen it.

    Args:
        episode: Record with k contacts; closing speed and kind of partner are used.

    Returns:
        Shape (k,), >= 0; NaN for contacts with other agents [N].
    """
    reduced = 1.0 / (1.0 / ROBOT_MASS + 1.0 / LEG_MASS)
    force = np.maximum(episode.contact_closing_speed, 0.0) * np.sqrt(reduced * LEG_STIFFNESS)
    return np.where(episode.contact_partner_kind == Partner.PEDESTRIAN, force, np.nan)


def clamped(episode: Episode) -> NDArray[np.bool_]:
    """Whether the agent touched another body during the same contact.

    Args:
        episode: Record with k contacts; agent, time and duration are used.

    Returns:
        Shape (k,).
    """
    agent, begin = episode.contact_agent, episode.contact_time
    end = begin + episode.contact_duration
    together = (agent[:, None] == agent) & (begin[:, None] < end) & (begin < end[:, None])
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


def severity(episode: Episode, force: Array) -> IntArray:
    """Class of each contact with a person.

    A contact that lasted longer than 0.5 s is held against the quasi-static limit with its peak, although the peak may
    have come early: a strict reading, since the log keeps no force over time.

    Args:
        episode: Record with k contacts; kind of partner, time and duration are used.
        force: Peak forces to judge, `episode.contact_peak_force` or `flesh_force(episode)`, shape (k,) [N].

    Returns:
        Values of `Severity`, shape (k,); -1 for contacts with agents and where the force is NaN.
    """
    limit = np.where(episode.contact_duration > TRANSIENT_DURATION, QUASI_STATIC_FORCE, TRANSIENT_FORCE)
    classes = np.where(force > QUASI_STATIC_FORCE, Severity.UNDER_TRANSIENT, Severity.UNDER_QUASI_STATIC)
    classes = np.where(force > limit, Severity.OVER, classes)
    classes = np.where(clamped(episode), Severity.CLAMPED, classes)
    unknown = np.isnan(force) | (episode.contact_partner_kind != Partner.PEDESTRIAN)
    return np.where(unknown, -1, classes).astype(np.int64)
