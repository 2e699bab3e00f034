"""Contact truth by hand: who moved into whom, where, how often, how hard."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line
from hypothesis import given
from hypothesis import strategies as st

from socialnav_mj import metrics
from socialnav_mj.config import Robot
from socialnav_mj.contact import FORCE_COLUMNS
from socialnav_mj.episode import Partner
from socialnav_mj.metrics import contacts, severity
from socialnav_mj.metrics.contacts import Fault
from socialnav_mj.metrics.severity import Severity
from socialnav_mj.resources import assets_folder


def meeting(agent_speed, person_speed, *, side=0.0, **touch):
    """The agent at the origin facing east, the person 0.3 m east of it, each with a speed along x; one touch."""
    agent = Agent(positions=line((0, 0), (agent_speed, side), 5), goal=(9, 9))
    person = Pedestrian(positions=line((0.3, 0), (0.3 + person_speed, 0), 5))
    return build_episode([agent], [person], [Touch(agent=0, partner=0, step=0, **touch)])


@pytest.mark.parametrize(
    ("agent_speed", "person_speed", "who"),
    [
        (1.0, 0.0, Fault.AGENT),  # drives into somebody standing
        (1.0, 0.5, Fault.AGENT),  # runs into somebody who walks away more slowly
        (0.0, -1.0, Fault.PARTNER),  # is walked into
        (-0.5, -1.0, Fault.PARTNER),  # is caught up from ahead while backing off
        (1.0, -1.0, Fault.BOTH),
        (0.05, -0.05, Fault.NEITHER),
        (0.0999, -0.1001, Fault.PARTNER),  # the threshold is 0.1 m/s
    ],
)
def test_fault_is_who_moved_towards_the_other(agent_speed, person_speed, who):
    episode = meeting(agent_speed, person_speed)
    assert contacts.fault(episode).tolist() == [who]
    own, other = contacts.approach_speeds(episode)
    assert (own[0], other[0]) == pytest.approx((agent_speed, -person_speed))
    assert own + other == pytest.approx(episode.contact_closing_speed)
    counts = [metrics.collisions_by_fault(episode, Partner.PEDESTRIAN, f)[0] for f in Fault]
    assert counts == [int(f == who) for f in Fault]


def test_what_is_fault_of_one_agent_is_the_other_ones_partners():
    agents = [Agent(positions=line((0, 0), (1, 0), 5)), Agent(positions=np.tile((0.3, 0), (6, 1)), goal=(3, 0))]
    episode = build_episode(agents, touches=[Touch(agent=0, partner=1, step=1, kind=Partner.AGENT)])
    assert contacts.fault(episode).tolist() == [Fault.AGENT, Fault.PARTNER]
    assert metrics.collisions_by_fault(episode, Partner.AGENT, Fault.AGENT).tolist() == [1, 0]
    assert metrics.collisions_by_fault(episode, Partner.AGENT, Fault.PARTNER).tolist() == [0, 1]
    assert metrics.struck_standing(episode).tolist() == [False, True]


@pytest.mark.parametrize(
    ("where", "angle"), [((1, 0), 0), ((0, 1), math.pi / 2), ((0, -1), -math.pi / 2), ((-1, 0), -math.pi)]
)
def test_bearing_is_zero_ahead_and_positive_on_the_left(where, angle):
    way = line((0, 0), (0, 1), 5)  # north
    turned = (where[1] * -0.3, where[0] * 0.3)
    person = Pedestrian(positions=np.tile(turned, (6, 1)))
    episode = build_episode([Agent(positions=way)], [person], [Touch(agent=0, partner=0, step=0)])
    found = float(contacts.bearing(episode)[0])
    assert math.cos(found) == pytest.approx(math.cos(angle)) and math.sin(found) == pytest.approx(math.sin(angle))


def test_second_touch_of_a_pair_is_repeated_and_the_first_of_another_is_not():
    people = [Pedestrian(positions=np.tile((2, 0), (21, 1))), Pedestrian(positions=np.tile((3, 0), (21, 1)))]
    agents = [Agent(positions=line((0, 0), (4, 0), 20)), Agent(positions=line((0, 5), (4, 5), 20))]
    touches = [Touch(agent=0, partner=j, step=step) for j, step in ((0, 8), (0, 9), (1, 12), (0, 13))]
    episode = build_episode(agents, people, [*touches, Touch(agent=1, partner=0, step=15)])
    assert contacts.first_touch(episode).tolist() == [True, False, True, False, True]
    assert metrics.repeated_collisions(episode).tolist() == [2, 0]


def test_partners_are_told_by_the_person_that_they_are_or_replace():
    people = [Pedestrian(positions=np.tile((2, 0), (6, 1))), Pedestrian(positions=np.tile((3, 0), (6, 1)))]
    agents = [Agent(positions=line((0, 0), (4, 0), 5)), Agent(positions=line((0, 5), (4, 5), 5))]
    touches = [Touch(agent=0, partner=1, step=1), Touch(agent=0, partner=1, step=2, kind=Partner.AGENT)]
    episode = build_episode(agents, people, touches)
    # In order of time: agent 0 with person 1, then both sides of the touch between the agents.
    expected = [episode.pedestrian_person[1], episode.agent_person[1], episode.agent_person[0]]
    assert contacts.partner_person(episode, np.arange(3)).tolist() == expected
    assert contacts.partner_person(episode, np.array([2, 0])).tolist() == [expected[2], expected[0]]
    assert len(set(expected)) == 3


def test_agent_that_drives_is_not_struck_standing_and_neither_is_one_that_nobody_walked_into():
    assert metrics.struck_standing(meeting(0.05, -1.0)).tolist() == [True]
    assert metrics.struck_standing(meeting(-0.5, -1.0)).tolist() == [False]
    assert metrics.struck_standing(meeting(0.05, -0.05)).tolist() == [False]
    # standing is speed in any direction: here 0.5 m/s sideways
    assert metrics.struck_standing(meeting(0.0, -1.0, side=0.5)).tolist() == [False]


@pytest.mark.parametrize(
    ("force", "duration", "push", "what"),
    [
        (130.0, 9.0, 0.0, Severity.UNDER_QUASI_STATIC),
        (131.0, 0.5, 0.0, Severity.UNDER_TRANSIENT),
        (260.0, 9.0, 130.0, Severity.UNDER_TRANSIENT),  # the impact alone is held against 260 N
        (261.0, 0.05, 0.0, Severity.OVER),
        (20.0, 0.6, 131.0, Severity.OVER),  # a push of 0.5 s at 131 N
        (20.0, 0.5, 131.0, Severity.UNDER_QUASI_STATIC),  # not longer than 0.5 s
    ],
)
def test_impact_is_held_against_260_newtons_and_a_lasting_push_against_130(force, duration, push, what):
    pushed = max(duration - 0.1, 0.0)
    touch = {"impact_force": force, "duration": duration, "push_impulse": push * pushed, "push_force": 9000.0}
    episode = meeting(0.0, -1.0, **touch)
    assert severity.pushing_force(episode) == pytest.approx([push])
    assert severity.severity(episode, episode.contact_impact_force).tolist() == [what]
    assert metrics.collisions_by_severity(episode, what).tolist() == [1.0]
    assert metrics.largest_impact_force(episode).tolist() == [force]
    wedged = meeting(0.0, -1.0, **touch, squeeze=601.0)
    assert severity.severity(wedged, wedged.contact_impact_force)[0] == (
        Severity.OVER if force > 260 else Severity.UNDER_TRANSIENT if force > 130 else Severity.UNDER_QUASI_STATIC
    )


def test_contact_is_clamped_if_another_body_is_touched_during_its_impact():
    people = [Pedestrian(positions=np.tile((x, 0), (21, 1))) for x in (0.3, -0.3)]
    agent = Agent(positions=np.zeros((21, 2)), goal=(3, 0))
    # From 1.0 s the first, whom the second joins after 0.2 s, when the impact of the first is over; another at 1.8 s.
    held = [Touch(agent=0, partner=0, step=5, duration=0.4, impact_force=90), Touch(agent=0, partner=1, step=6)]
    episode = build_episode([agent], people, [*held, Touch(agent=0, partner=0, step=9, impact_force=50)])
    assert severity.clamped(episode).tolist() == [False, True, False]
    assert metrics.largest_impact_force(episode).tolist() == [90.0]
    assert [metrics.collisions_by_severity(episode, what)[0] for what in Severity] == [2, 0, 0, 1]
    together = [held[0], replace(held[1], step=5.4)]
    episode = build_episode([agent], people, together)
    assert severity.clamped(episode).tolist() == [True, True]
    assert np.isnan(metrics.largest_impact_force(episode)).all()


def test_push_is_summed_over_collisions_and_wedged_ones_have_no_impulse():
    agents = [Agent(positions=np.zeros((21, 2)), goal=(3, 0)), Agent(positions=np.full((21, 2), 5.0), goal=(9, 9))]
    people = [Pedestrian(positions=np.tile((0.3, 0), (21, 1)))]
    touches = [
        Touch(agent=0, partner=0, step=2, duration=0.5, push_impulse=10.0),
        Touch(agent=0, partner=0, step=8, duration=0.7, push_duration=0.3, push_impulse=9e3, squeeze=1e4),
    ]
    episode = build_episode(agents, people, touches)
    assert metrics.push_duration(episode) == pytest.approx([0.4 + 0.3, 0.0])
    assert metrics.push_impulse(episode).tolist() == [10.0, 0.0]


@pytest.mark.parametrize(("pushed", "shoved"), [(0.99, 0), (1.0, 1), (3.0, 1)])
def test_standing_agent_that_is_pushed_for_a_second_was_shoved(pushed, shoved):
    episode = meeting(0.0, -1.0, push_duration=pushed)
    assert metrics.shoved_standing(episode).tolist() == [shoved]
    assert metrics.time_shoved_standing(episode).tolist() == [pushed * shoved]
    for other in (meeting(0.5, -1.0, push_duration=pushed), meeting(0.0, 0.0, push_duration=pushed)):
        assert metrics.shoved_standing(other).tolist() == [0.0] == metrics.time_shoved_standing(other).tolist()
        assert metrics.push_duration(other).tolist() == [pushed]


def test_contact_of_a_robot_squeezed_by_more_than_mass_and_drive_explain_is_wedged():
    agent, people = Agent(positions=np.zeros((21, 2)), goal=(3, 0)), [Pedestrian(positions=np.tile((0.3, 0), (21, 1)))]
    touches = [Touch(agent=0, partner=0, step=k, squeeze=s) for k, s in ((3, 600.0), (6, 600.1), (9, math.nan))]
    episode = build_episode([agent], people, touches)
    assert severity.wedged(episode).tolist() == [False, True, False]
    assert metrics.wedged_collisions(episode).tolist() == [1]


def test_human_row_has_no_force_and_no_severity():
    episode = meeting(0.0, -1.0, **dict.fromkeys(FORCE_COLUMNS, math.nan))
    assert np.isnan(metrics.collisions_by_severity(episode, Severity.OVER)).all()
    for metric in (metrics.largest_impact_force, metrics.largest_impact_impulse, metrics.push_duration):
        assert np.isnan(metric(episode)).all()
    for metric in (metrics.push_impulse, metrics.shoved_standing, metrics.time_shoved_standing):
        assert np.isnan(metric(episode)).all()
    assert metrics.largest_closing_speed(episode) == pytest.approx([1.0])


@given(speed=st.floats(0.01, 3), way=st.floats(-math.pi, math.pi))
def test_impact_exchanges_the_momentum_and_flesh_holds_the_energy_of_two_bodies(speed, way):
    """ISO/TS 15066 A.3: F^2 / (2 k) = mu v^2 / 2; mu with the rotors' 2.52 kg for a push along the wheels."""
    # The robot looks along `way`, and the person comes from the east.
    agent = Agent(positions=line((0, 0), (math.cos(way) * 1e-9, math.sin(way) * 1e-9), 5), goal=(9, 9))
    person = Pedestrian(positions=line((0.3, 0), (0.3 - speed, 0), 5))
    episode = build_episode([agent], [person], [Touch(agent=0, partner=0, step=0)])
    inverse = math.cos(way) ** 2 / 10.5222 + math.sin(way) ** 2 / 8.0 + 1.0 / 75.0
    assert float(severity.impact_momentum(episode)[0]) == pytest.approx(speed / inverse, rel=1e-4)
    force = float(severity.flesh_force(episode)[0])
    assert force**2 / severity.LEG_STIFFNESS == pytest.approx(speed**2 / inverse, rel=1e-4)


def test_flesh_is_harder_along_the_wheels_than_across():
    assert severity.reduced_mass(np.array([0.0, math.pi / 2, math.pi])) == pytest.approx(
        [9.2276, 7.2289, 9.2276], rel=1e-4
    )
    assert float(severity.flesh_force(meeting(0.01, -0.99))[0]) == pytest.approx(744, abs=1)


def test_masses_are_the_models():
    text = (assets_folder() / "robot.xml").read_text()
    masses = re.findall(r'<inertial[^>]*?mass="([0-9.]+)"', text)
    assert sum(map(float, masses)) == pytest.approx(severity.ROBOT_MASS)
    (armature,), inertias = re.findall(r'armature="([0-9.]+)"', text), re.findall(r'2.9e-4 ([0-9.e-]+) 2.9e-4"', text)
    radius = Robot().wheel_radius
    assert len(inertias) == 2
    rotors = sum(float(armature) + float(inertia) for inertia in inertias) / radius**2
    assert rotors == pytest.approx(severity.ROTOR_MASS)


@pytest.mark.parametrize(("gap", "met"), [(0.31, True), (0.33, False)])
def test_pedestrians_overlap_between_samples_too(gap, met):
    """Two people pass each other at 2 m/s halfway between two samples, then 0.4 m apart."""
    there = Pedestrian(positions=line((-1.0, 0), (1.0, 0), 5))
    back = Pedestrian(positions=line((1.0, gap), (-1.0, gap), 5))
    aside = Pedestrian(positions=np.tile((0, 5), (6, 1)))
    episode = build_episode([Agent(positions=np.tile((9, 9), (6, 1)), goal=(0, 9))], [there, back, aside])
    assert contacts.pedestrian_overlaps(episode).tolist() == [int(met), int(met), 0]


def test_geometry_sees_an_overlap_between_samples():
    agent = Agent(positions=line((-1.0, 0), (1.0, 0), 5))
    person = Pedestrian(positions=line((1.0, 0.31), (-1.0, 0.31), 5))
    episode = build_episode([agent], [person, Pedestrian(positions=np.tile((0, 5), (6, 1)))])
    assert contacts.geometric_contacts(episode).tolist() == [[True, False]]
    apart = replace(episode, pedestrian_position=episode.pedestrian_position + np.array([0, 0.02]))
    assert not contacts.geometric_contacts(apart).any()


def test_episode_without_contacts_or_people_has_empty_truths():
    episode = build_episode([Agent(positions=line((0, 0), (4, 0), 20))])
    for truth in (contacts.fault, contacts.bearing, contacts.first_touch, contacts.standing, severity.clamped):
        assert truth(episode).shape == (0,)
    assert contacts.geometric_contacts(episode).shape == (1, 0)
    assert contacts.pedestrian_overlaps(episode).shape == (0,)
    assert np.isnan(metrics.minimum_time_to_collision(episode)).all()
