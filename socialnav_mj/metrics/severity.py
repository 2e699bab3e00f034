"""How hard contacts with people were, against the limits of ISO/TS 15066 for the lower leg.

The bumper meets a person 0.10 m above the floor, at the lower leg. ISO/TS 15066:2016, table A.2, gives for lower legs
(shin, calf) 130 N in quasi-static contact and twice that in transient contact, which lasts at most 0.5 s and leaves
the leg free to recoil. The limits are pain thresholds of adults, not of injury, and there are pressure limits too
(220 and 210 N/cm^2), which need a contact area that a simulation of two smooth bodies does not know.

What the simulation's forces are, and are not: a replayed person is a mocap body, infinitely heavy and never pushed
back, behind a soft contact (`solref 0.05 1`: a critically damped spring with a time constant of 0.05 s, whatever the
mass). The robot is brought to the person's speed over about 0.1 s: without wheel forces the peak is m u / (0.05 s e),
59 N for 8 kg at u = 1 m/s. Flesh on bone is some ten times stiffer. So the *impulse* and the *closing speed* are
sound, the *peak force* is a lower bound for a free robot, and a robot clamped between two people is squeezed harder
than people would squeeze it. `flesh_force` is the specification's own estimate from the closing speed.
"""

from enum import IntEnum

import numpy as np

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


class Severity(IntEnum):
    """Class of a contact force against the limits for the lower leg."""

    UNDER_QUASI_STATIC = 0
    """At most 130 N: allowed however long it lasts."""
    UNDER_TRANSIENT = 1
    """At most 260 N, in a contact of at most 0.5 s."""
    OVER = 2
    """More than its kind of contact allows."""


def flesh_force(episode: Episode) -> Array:
    """Peak force that the closing speed would make on a real lower leg: v sqrt(mu k) (ISO/TS 15066 annex A.3).

    mu = 1 / (1 / robot mass + 1 / leg mass) is the reduced mass and k the leg's stiffness; both bodies free, no
    damping, the robot rigid: 659 N per m/s. An upper estimate, as a padded bumper and a yielding leg lessen it.

    Args:
        episode: The record.

    Returns:
        Shape (k,), >= 0; NaN for contacts with other agents [N].
    """
    reduced = 1.0 / (1.0 / ROBOT_MASS + 1.0 / LEG_MASS)
    force = np.maximum(episode.contact_closing_speed, 0.0) * np.sqrt(reduced * LEG_STIFFNESS)
    return np.where(episode.contact_partner_kind == Partner.PEDESTRIAN, force, np.nan)


def severity(force: Array, duration: Array) -> IntArray:
    """Class of each contact.

    A contact that lasted longer than 0.5 s is held against the quasi-static limit with its peak, although the peak may
    have come early: a strict reading, since the log keeps no force over time.

    Args:
        force: Peak force, shape (k,) [N].
        duration: Shape (k,) [s].

    Returns:
        Values of `Severity`, shape (k,); -1 where the force is NaN.
    """
    limit = np.where(duration > TRANSIENT_DURATION, QUASI_STATIC_FORCE, TRANSIENT_FORCE)
    classes = np.where(force > QUASI_STATIC_FORCE, Severity.UNDER_TRANSIENT, Severity.UNDER_QUASI_STATIC)
    classes = np.where(force > limit, Severity.OVER, classes)
    return np.where(np.isnan(force), -1, classes).astype(np.int64)
