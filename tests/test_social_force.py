"""`social_force`: the forces beside PySocialForce's, and what the robot makes of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.controllers.social_force import SocialForce, interaction_force

REFERENCE = json.loads((Path(__file__).parent / "data" / "social_force_reference.json").read_text())
MOUSSAID = {"importance": 2.0, "reach": 0.35, "n": 2.0, "n_prime": 3.0}


def force_on(place, velocity, others, speeds, **changes):
    others, speeds = np.atleast_2d(others), np.atleast_2d(speeds)
    present = np.ones((1, len(others)), dtype=bool)
    kwargs = {"strength": 1.0, **MOUSSAID, **changes}
    return interaction_force((others - place)[None], (np.asarray(velocity) - speeds)[None], present, **kwargs)[0]


@pytest.mark.parametrize("case", REFERENCE["cases"])
def test_forces_are_those_of_pysocialforce(case):
    """Random walkers; made by tests/data/social_force_reference.py."""
    state = np.array(case["state"])
    found = force_on(state[0, :2], state[0, 2:], state[1:, :2], state[1:, 2:])
    np.testing.assert_allclose(found, case["force"], rtol=1e-6, atol=1e-9)


def test_head_on_walker_brakes_and_who_is_at_the_right_is_passed_at_the_left():
    """2 m apart, 1 m/s each: D = 2 (2, 0) + (1, 0), B = 0.35 * 5: exp(-2 / 1.75) backwards, and nothing aside."""
    np.testing.assert_allclose(force_on((0, 0), (1, 0), (2, 0), (-1, 0)), [-np.exp(-2.0 / 1.75), 0.0], atol=1e-12)
    brake, aside = force_on((0, 0), (1, 0), (2, -0.3), (-1, 0))
    assert brake < 0.0 < aside
    assert force_on((0, 0), (1, 0), (2, 0.3), (-1, 0))[1] == pytest.approx(-aside)


def test_angles_are_wrapped():
    """Who is left behind, seen across the cut of the angle at pi, pushes as in the world turned by a quarter."""
    one = force_on((0, 0), (-1, 0.1), (-1.5, -0.1), (0.0, 0.0))
    turned = force_on((0, 0), (-0.1, -1), (0.1, -1.5), (0.0, 0.0))
    np.testing.assert_allclose(turned, [-one[1], one[0]], atol=1e-12)


def test_nobody_pushes_nobody_and_the_same_place_is_no_error():
    assert not interaction_force(
        np.zeros((2, 0, 2)), np.zeros((2, 0, 2)), np.zeros((2, 0), bool), strength=1.0, **MOUSSAID
    ).any()
    assert np.isfinite(force_on((0, 0), (0, 0), (0, 0), (0, 0))).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"reach": 0.0}, "reach = 0.0 is not allowed; allowed: numbers > 0"),
        ({"relaxation_time": -1}, "relaxation_time = -1 is not allowed; allowed: numbers > 0"),
        ({"strength": float("nan")}, "strength = nan is not allowed; allowed: numbers >= 0"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError) as caught:
        SocialForce(**changes)
    assert message in str(caught.value)
