"""Where people will be, fitted: what must come out for crowds whose motion is known, and what is shipped."""

import json
import os

import numpy as np
import pytest
from scenes import Walk, recording_of, stand, walk

from socialnav_mj.cli import main
from socialnav_mj.controllers.prediction import LAGS, STEP, constant_velocity, load_prediction, predictions_folder
from socialnav_mj.learning.prediction import RIDGES, STEPS, displacement_error, fit, fitted_card, samples


def swaying(seed, n=6, duration=20.0):
    """People whose velocity turns at a constant rate, each at its own speed."""
    random = np.random.default_rng(seed)
    times = np.arange(0.0, duration, 0.1)
    walks = []
    for _ in range(n):
        rate, phase, speed = random.uniform(0.3, 0.9), random.uniform(0.0, 6.0), random.uniform(0.5, 1.5)
        angle = phase + rate * times
        walks.append(Walk(times, speed / rate * np.stack([np.sin(angle), -np.cos(angle)], axis=1)))
    return recording_of(*walks)


def test_samples_have_the_oldest_velocity_at_a_tracks_begin_and_nan_after_its_end():
    velocity, moved = samples(recording_of(walk([(0.0, 0.0), (3.0, 0.0)], 1.0)), steps=3)
    assert velocity.shape == (16, len(LAGS), 2) and moved.shape == (16, 3, 2)
    np.testing.assert_allclose(velocity, np.broadcast_to([1.0, 0.0], velocity.shape), atol=1e-9)
    np.testing.assert_allclose(moved[0], [[0.2, 0.0], [0.4, 0.0], [0.6, 0.0]], atol=1e-9)
    assert np.isnan(moved[-2:, 1:]).all() and not np.isnan(moved[-2, 0]).any()


def test_people_who_keep_their_velocity_are_fitted_by_constant_velocity():
    crowd = recording_of(walk([(0.0, 0.0), (9.0, 3.0)], 1.2), walk([(0.0, 1.0), (0.0, 9.0)], 0.7), stand((3, 3), 0, 9))
    found = fit([crowd], ridge=1.0)
    np.testing.assert_allclose(displacement_error(found, crowd), 0.0, atol=1e-6)
    np.testing.assert_allclose(found.coefficients.sum(axis=1), STEP * np.arange(1, STEPS + 1), atol=1e-6)


def test_people_who_turn_are_predicted_better_than_by_constant_velocity():
    found, others = fit([swaying(0)], ridge=0.1), swaying(1)
    linear, plain = (displacement_error(own, others) for own in (found, constant_velocity(STEPS)))
    assert (linear < 0.7 * plain).all()


def test_a_large_ridge_leaves_constant_velocity():
    np.testing.assert_allclose(
        fit([swaying(0)], ridge=1e9).coefficients, constant_velocity(STEPS).coefficients, atol=1e-3
    )


def test_fit_prediction_writes_what_controllers_read(tmp_path, capsys):
    for seed in range(3):
        rows = [
            f"{round(25 * t)} {person + 1} {x:.6f} {y:.6f}"
            for person in range(4)
            for t, (x, y) in zip(swaying(seed).times[person], swaying(seed).positions[person], strict=True)
            if round(25 * t) % 5 == 0
        ]
        (tmp_path / f"crowd{seed}.txt").write_text("\n".join(sorted(rows, key=lambda row: int(row.split()[0]))) + "\n")
    one, two, three = (str(tmp_path / f"crowd{seed}.txt") for seed in range(3))
    out = tmp_path / "own.json"
    main(["fit-prediction", "--datasets", one, two, "--judged-on", three, "--out", str(out)])
    assert "crowd2: mean displacement error after 3.2 s" in capsys.readouterr().out
    card = json.loads(out.read_text())
    assert [own["name"] for own in card["recordings"]] == ["crowd0", "crowd1"] and card["ridge"] in RIDGES
    errors = card["held_out_error"]["crowd2"]
    assert len(errors["linear"]) == STEPS and errors["linear"][15] < errors["constant_velocity"][15]
    np.testing.assert_array_equal(load_prediction(str(out), steps=16).coefficients, card["coefficients"])
    with pytest.raises(ValueError, match="allowed: two or more"):
        fitted_card([one])


def test_shipped_prediction_is_what_the_command_fits():
    """`socialnav-mj fit-prediction --judged-on students003 --out assets/predictions/linear.json`."""
    if not os.environ.get("SOCIALNAV_MJ_DATA"):
        pytest.skip("needs zara01 and zara02; SOCIALNAV_MJ_DATA names the folder that has them")
    shipped = json.loads((predictions_folder() / "linear.json").read_text())
    again = fitted_card([own["name"] for own in shipped["recordings"]])
    np.testing.assert_allclose(again["coefficients"], shipped["coefficients"], atol=1e-6)
    assert again["recordings"] == shipped["recordings"]
    for name, errors in again["held_out_error"].items():
        assert errors == shipped["held_out_error"][name]
        assert errors["linear"][15] < errors["constant_velocity"][15]
