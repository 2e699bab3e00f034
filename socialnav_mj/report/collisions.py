"""Episode -> one row for every collision: all that is known about it."""

from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.contact import FORCE_COLUMNS
from socialnav_mj.episode import Episode, Partner
from socialnav_mj.metrics.collisions import counted_contacts
from socialnav_mj.metrics.contacts import (
    Fault,
    approach_speeds,
    bearing,
    fault,
    first_touch,
    partner_person,
    standing,
)
from socialnav_mj.metrics.forces import shoved
from socialnav_mj.metrics.severity import Severity, clamped, flesh_force, impact_momentum, severity, wedged

CONTACT_SCHEMA = pa.schema(
    [
        ("dataset", pa.string()),
        ("variant", pa.string()),
        ("scenario", pa.string()),
        ("controller", pa.string()),
        ("draw", pa.int64()),
        ("agent", pa.int64()),
        ("person", pa.int64()),
        ("time", pa.float64()),
        ("partner", pa.string()),
        ("partner_person", pa.int64()),
        ("first", pa.bool_()),
        ("fault", pa.string()),
        ("agent_standing", pa.bool_()),
        ("agent_approach_speed", pa.float64()),
        ("partner_approach_speed", pa.float64()),
        ("closing_speed", pa.float64()),
        ("bearing", pa.float64()),
        ("duration", pa.float64()),
        ("impact_impulse", pa.float64()),
        ("impact_momentum", pa.float64()),
        ("impact_force", pa.float64()),
        ("shoved", pa.bool_()),
        ("push_duration", pa.float64()),
        ("push_impulse", pa.float64()),
        ("push_force", pa.float64()),
        ("peak_time", pa.float64()),
        ("held_back", pa.float64()),
        ("squeeze", pa.float64()),
        ("clamped", pa.bool_()),
        ("wedged", pa.bool_()),
        ("severity", pa.string()),
        ("flesh_force", pa.float64()),
        ("flesh_severity", pa.string()),
        ("episode", pa.string()),
    ]
)
"""Columns of the collisions' table, in SI units; definitions in `socialnav_mj.metrics.contacts` and `.severity`. A
collision between two agents has two rows, one from each side. Null where there was no physics (human row)."""


def contacts_table(episode: Episode, *, labels: dict[str, Any], file: str = "") -> pa.Table:
    """Every collision that counts for its agent, in order of time.

    Args:
        episode: Of robots, or of the recorded people (`human`).
        labels: dataset, variant, scenario, controller, draw.
        file: Name of its file, for the column `episode`.

    Returns:
        Columns of `CONTACT_SCHEMA`.
    """
    rows = np.flatnonzero(counted_contacts(episode))
    own, others = approach_speeds(episode)
    flesh = flesh_force(episode)
    values: dict[str, Any] = {
        "agent": episode.contact_agent,
        "person": episode.agent_person[episode.contact_agent],
        "time": episode.contact_time,
        "partner": _names(Partner, episode.contact_partner_kind),
        "partner_person": partner_person(episode, np.arange(len(episode.contact_time))),
        "first": first_touch(episode),
        "fault": _names(Fault, fault(episode)),
        "agent_standing": standing(episode),
        "agent_approach_speed": own,
        "partner_approach_speed": others,
        "closing_speed": episode.contact_closing_speed,
        "bearing": bearing(episode),
        "duration": episode.contact_duration,
        "impact_momentum": impact_momentum(episode),
        **{name: getattr(episode, f"contact_{name}") for name in FORCE_COLUMNS},
        "clamped": clamped(episode),
        "shoved": shoved(episode),
        "wedged": wedged(episode),
        "severity": _names(Severity, severity(episode, episode.contact_impact_force)),
        "flesh_force": flesh,
        "flesh_severity": _names(Severity, severity(episode, flesh)),
    }
    constant = labels | {"episode": file}
    columns = [
        pa.array([constant[field.name]] * len(rows), field.type)
        if field.name in constant
        else pa.array(values[field.name][rows], from_pandas=True).cast(field.type)
        for field in CONTACT_SCHEMA
    ]
    return pa.table(columns, schema=CONTACT_SCHEMA)


def _names(kind: type[Partner] | type[Fault] | type[Severity], values: Any) -> Any:
    """Lower-case names of enumeration values, None for -1."""
    names = np.array([*(member.name.lower() for member in kind), None], dtype=object)
    return names[values]
