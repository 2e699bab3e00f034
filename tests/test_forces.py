"""Forces of a walker who goes into a standing robot, beside the momentum that two bodies exchange."""

import pytest
from forces import PAGE, SIDES, SPEEDS, WALKS, Case, cases, drive, flesh_of, run, with_table

from socialnav_mj.contact import IMPACT_DURATION
from socialnav_mj.people import PUSHING_FORCE


@pytest.fixture(scope="module")
def found() -> list[Case]:
    return cases()


def test_impact_has_the_two_body_impulse_within_a_factor_of_one_and_a_half(found: list[Case]) -> None:
    assert [(case.side, case.speed) for case in found] == [(side, speed) for side in SIDES for speed in SPEEDS]
    for case in found:
        assert 1 / 1.5 < case.touch.impact_impulse / case.estimate < 1.5, (case.side, case.speed)


def test_whole_contact_has_many_times_the_impulse_and_sideways_a_peak_that_comes_late(found: list[Case]) -> None:
    """Why the impact is told by itself."""
    assert all(case.impulse > 8.0 * case.estimate for case in found)
    assert all((case.touch.peak_time > 1.0) is (case.side == "side") for case in found)
    assert all(case.touch.push_duration > 3.5 for case in found)


def test_shove_is_the_motors_force_along_the_wheels_and_the_tyres_grip_across(found: list[Case]) -> None:
    for case in found:
        mean = case.touch.push_impulse / case.touch.push_duration
        assert mean == pytest.approx(32.0, rel=0.1) if case.side != "side" else 60.0 < mean < 85.0


@pytest.mark.parametrize("side", SIDES)
def test_impact_hardly_depends_on_the_physics_step(side: str) -> None:
    fine = run(side, 1.0, physics_timestep=0.0025)
    assert fine.touch.impact_impulse == pytest.approx(run(side, 1.0).touch.impact_impulse, rel=0.2)


def test_walker_who_yields_gives_the_momentum_of_two_bodies_and_is_held_back() -> None:
    """Motors that brake with 32 N add to it. The push is carried through: it takes less than the 130 N of a person."""
    for rigid, case in zip(cases(), cases("compliant"), strict=True):
        motors = 0.0 if case.side == "side" else 32.0 * IMPACT_DURATION
        assert 1 / 1.5 < case.touch.impact_impulse / (case.estimate + motors) < 1.5, (case.side, case.speed)
        assert 0.7 * rigid.moved < case.moved < rigid.moved
        assert case.touch.push_impulse / case.touch.push_duration < PUSHING_FORCE
        assert rigid.touch.held_back == 0.0 and 0.2 < case.touch.held_back < 0.5


def test_force_of_a_robot_that_drives_follows_the_closing_speed_only_where_people_yield() -> None:
    """To the solver a mocap body stands, so who walks ahead of the robot is struck as if it stood."""
    rigid = [drive(walk) for walk in WALKS]
    forces = [touch.impact_force for touch in rigid]
    assert max(forces) < 1.15 * min(forces) and forces[-1] > 2.0 * flesh_of(rigid[-1])
    for walk in WALKS:
        touch = drive(walk, pedestrian_body="compliant")
        assert touch.impact_force == pytest.approx(0.55 * flesh_of(touch), rel=0.05)


def test_page_shows_the_table_of_today() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_table(page), "docs/metrics.md is not up to date: `python tests/forces.py`"
