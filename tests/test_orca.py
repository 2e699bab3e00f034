"""`orca`: velocities beside pyrvo's, and what people who do nothing ask for."""

import json
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.controllers.orca import ORCA, Line, half_plane, permitted_velocity

REFERENCE = json.loads((Path(__file__).parent / "data" / "orca_reference.json").read_text())


def lines_of(place, velocity, others, speeds, *, share=0.5):
    order = np.argsort(np.hypot(*(others - place).T), kind="stable")
    return [
        half_plane(
            tuple(others[k] - place),
            tuple(velocity - speeds[k]),
            tuple(velocity),
            distance=2.0 * REFERENCE["radius"],
            horizon=REFERENCE["horizon"],
            time_step=REFERENCE["time_step"],
            share=share,
        )
        for k in order
    ]


@pytest.mark.parametrize("case", REFERENCE["cases"])
def test_velocities_are_those_of_pyrvo(case):
    """Crowds that are free, dense, and overlapping; pyrvo reckons in single precision."""
    position, velocity = np.array(case["position"]), np.array(case["velocity"])
    lines = lines_of(position[0], velocity[0], position[1:], velocity[1:])
    found = permitted_velocity(lines, tuple(case["wanted"]), REFERENCE["max_speed"])
    np.testing.assert_allclose(found, case["result"], atol=2e-4)


def test_references_hold_all_kinds_of_cases():
    cases = REFERENCE["cases"]
    changed = [np.abs(np.subtract(case["result"], case["wanted"])).max() > 0.05 for case in cases]
    touching = [np.hypot(*(np.array(c["position"][1:]) - c["position"][0]).T).min() < 0.34 for c in cases]
    assert any(changed) and not all(changed) and any(touching) and not all(touching)


@pytest.mark.parametrize("offset", [0.05, -0.3, 0.31])
def test_whoever_does_all_of_it_keeps_clear_of_somebody_who_does_nothing(offset):
    """Head on, 1 m/s each, 2.5 m apart: with the whole share the miss distance is the contact distance at least."""
    place, other = np.zeros(2), np.array([[2.5, offset]])
    velocity, speed = np.array([1.0, 0.0]), np.array([[-1.0, 0.0]])
    misses = []
    for share in (1.0, 0.5):
        lines = lines_of(place, velocity, other, speed, share=share)
        moved = np.array(permitted_velocity(lines, (1.0, 0.0), 1.0)) - speed[0]
        time = np.clip(other[0] @ moved / (moved @ moved), 0.0, 3.0)
        misses.append(np.hypot(*(other[0] - time * moved)))
    assert misses[0] >= 2.0 * REFERENCE["radius"] - 1e-6 > misses[1]


def test_the_least_forbidden_velocity_is_taken_where_none_is_permitted():
    """Three half-planes that leave out a triangle: its incentre, 1 m/s lacking in each, as of a grid."""
    angles = 2.0 * np.pi * np.arange(3) / 3.0
    lines = [Line(np.cos(a), np.sin(a), np.sin(a), -np.cos(a)) for a in angles]
    assert all(line.lacks(0.0, 0.0) == pytest.approx(1.0) for line in lines)
    np.testing.assert_allclose(permitted_velocity(lines, (0.4, 0.1), 0.9), [0.0, 0.0], atol=1e-9)


def test_nobody_leaves_the_wanted_velocity_within_the_limit():
    assert permitted_velocity([], (0.3, 0.4), 1.0) == (0.3, 0.4)
    np.testing.assert_allclose(permitted_velocity([], (3.0, 4.0), 1.0), (0.6, 0.8))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"horizon": 0.0}, "horizon = 0.0 is not allowed; allowed: numbers >= 0.001"),
        ({"agent_share": 1.5}, "agent_share = 1.5 is not allowed; allowed: numbers in [0, 1]"),
        ({"margin": float("inf")}, "margin = inf is not allowed; allowed: numbers >= 0"),
        ({"neighbours": 0}, "neighbours = 0 is not allowed; allowed: numbers >= 1"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError) as caught:
        ORCA(**changes)
    assert message in str(caught.value)
