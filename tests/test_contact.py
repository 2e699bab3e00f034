"""A touch as a record: both sides of it, and the columns of many."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from socialnav_mj.contact import FORCE_COLUMNS, Contact, Partner, contact_columns
from socialnav_mj.episode import Episode

TOUCH = Contact(
    time=1.5,
    agent=2,
    partner_kind=Partner.AGENT,
    partner=5,
    duration=0.25,
    position=np.array([1.0, 2.0]),
    normal=np.array([0.6, 0.8]),
    agent_heading=0.3,
    agent_velocity=np.array([1.0, 0.0]),
    partner_velocity=np.array([0.0, -0.5]),
    impact_impulse=3.0,
    impact_force=90.0,
    push_duration=0.15,
    push_impulse=4.0,
    push_force=60.0,
    peak_time=0.02,
    squeeze=12.0,
    held_back=0.01,
)


def test_other_side_of_a_touch_exchanges_the_parties_and_keeps_what_they_share():
    other = TOUCH.seen_by_partner(heading=-2.0)
    assert (other.agent, other.partner, other.agent_heading) == (5, 2, -2.0)
    np.testing.assert_array_equal(other.normal, [-0.6, -0.8])
    np.testing.assert_array_equal(other.agent_velocity, TOUCH.partner_velocity)
    np.testing.assert_array_equal(other.partner_velocity, TOUCH.agent_velocity)
    for name in ("time", "duration", "position", *FORCE_COLUMNS):
        assert getattr(other, name) is getattr(TOUCH, name)
    with pytest.raises(FrozenInstanceError):
        other.time = 0.0


def test_columns_are_ordered_by_time_agent_kind_partner_and_have_the_episodes_names_and_types():
    person = {"partner_kind": Partner.PEDESTRIAN, "partner": 9}
    rows = [TOUCH, replace(TOUCH, **person), replace(TOUCH, agent=1), replace(TOUCH, time=0.5, agent=7)]
    for contacts in (rows, rows[::-1]):
        columns = contact_columns(contacts)
        found = [columns[f"contact_{name}"].tolist() for name in ("time", "agent", "partner_kind", "partner")]
        assert list(zip(*found, strict=True)) == [(0.5, 7, 1, 5), (1.5, 1, 1, 5), (1.5, 2, 0, 9), (1.5, 2, 1, 5)]
    empty = contact_columns([])
    assert list(columns) == list(empty) == [f"contact_{field.name}" for field in fields(Contact)]
    assert set(columns) == {field.name for field in fields(Episode) if field.name.startswith("contact_")}
    for name, column in columns.items():
        assert column.shape[1:] == empty[name].shape[1:] and column.dtype == empty[name].dtype
        assert len(column) == 4 and len(empty[name]) == 0
