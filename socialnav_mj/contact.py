"""One touch as an agent felt it, and the columns of an episode that hold many."""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.geometry import Array

IMPACT_DURATION = 0.1
"""How long after the first touch forces belong to the impact; what comes later is a push. Twice the contact's time
constant of 0.05 s, in which a struck robot takes on the speed of who struck it [s]."""


class Partner(IntEnum):
    """Whom an agent touched."""

    PEDESTRIAN = 0
    AGENT = 1


@dataclass(frozen=True, kw_only=True)
class Contact:
    """A row of an episode's contact log; each field becomes the column `contact_<field>`, described in `Episode`."""

    time: float
    agent: int
    partner_kind: Partner
    partner: int
    duration: float
    position: Array
    normal: Array
    agent_heading: float
    agent_velocity: Array
    partner_velocity: Array
    impact_impulse: float
    impact_force: float
    push_duration: float
    push_impulse: float
    push_force: float
    peak_time: float
    squeeze: float
    held_back: float

    def seen_by_partner(self, heading: float) -> "Contact":
        """The same touch from the other agent's side.

        Args:
            heading: The other agent's at first touch [rad].

        Returns:
            Agent and partner exchanged, the normal turned round.
        """
        return replace(
            self,
            agent=self.partner,
            partner=self.agent,
            normal=-self.normal,
            agent_heading=heading,
            agent_velocity=self.partner_velocity,
            partner_velocity=self.agent_velocity,
        )


INTEGER_COLUMNS = ("agent", "partner_kind", "partner")
"""Fields of `Contact` that are whole numbers."""
FORCE_COLUMNS = (
    "impact_impulse",
    "impact_force",
    "push_duration",
    "push_impulse",
    "push_force",
    "peak_time",
    "squeeze",
    "held_back",
)
"""Fields of `Contact` that only a simulation knows: NaN in the human row."""
PLANAR_COLUMNS = ("position", "normal", "agent_velocity", "partner_velocity")
"""Fields of `Contact` that have two coordinates."""


def contact_columns(contacts: Iterable[Contact]) -> dict[str, NDArray[Any]]:
    """The contact log of an episode.

    Args:
        contacts: In any order.

    Returns:
        Keyword arguments of `Episode`, rows ordered by time, agent, partner kind and partner.
    """
    rows = sorted(contacts, key=lambda row: (row.time, row.agent, row.partner_kind, row.partner))
    columns: dict[str, NDArray[Any]] = {}
    for field in fields(Contact):
        kind = np.int64 if field.name in INTEGER_COLUMNS else np.float64
        shape = (len(rows), 2) if field.name in PLANAR_COLUMNS else (len(rows),)
        columns[f"contact_{field.name}"] = np.array([getattr(row, field.name) for row in rows], dtype=kind).reshape(
            shape
        )
    return columns
