"""Fits where people will be to recordings: displacements as linear functions of lagged velocities."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.controllers.prediction import LAGS, STEP, Prediction, constant_velocity
from socialnav_mj.files import write_json
from socialnav_mj.geometry import Array
from socialnav_mj.provenance import PACKAGES, package_versions, recording_metadata
from socialnav_mj.recordings import Recording, load_recording

STEPS = 24
"""How many steps ahead a fitted prediction reaches: 4.8 s, what the literature predicts."""
RIDGES = (0.01, 0.1, 1.0, 10.0, 100.0)
"""Weights of the distance from constant velocity that are tried [m^2/s^2]."""


def samples(recording: Recording, *, steps: int = STEPS) -> tuple[Array, Array]:
    """What everybody's velocities had been and how far they went, at every control step of their tracks.

    Args:
        recording: A crowd.
        steps: How many steps ahead.

    Returns:
        Velocities of `LAGS`, (n, lags, 2), for the first steps of a track the oldest there is, as a controller has it
        [m/s]; displacements after each step, (n, steps, 2), NaN after the end of a track [m].
    """
    velocities, moves = [], []
    for index in range(recording.n_people):
        first = np.ceil(recording.start_time[index] / STEP - 1e-6)
        last = np.floor(recording.end_time[index] / STEP + 1e-6)
        position, velocity, _ = recording.person(index).at(STEP * np.arange(first, last + 1))
        now = np.arange(len(position))[:, None]
        velocities.append(velocity[np.maximum(now - np.array(LAGS), 0)])
        ahead = now + np.arange(1, steps + 1)
        moved = position[np.minimum(ahead, len(position) - 1)] - position[:, None]
        moves.append(np.where((ahead < len(position))[..., None], moved, np.nan))
    return np.concatenate(velocities), np.concatenate(moves)


def fit(recordings: Sequence[Recording], *, steps: int = STEPS, ridge: float) -> Prediction:
    """Least squares for each step ahead, drawn towards constant velocity (Hoerl and Kennard 1970).

    With velocities V, displacements D and c_0 for constant velocity: c = c_0 + (V'V + ridge)^-1 V'(D - V c_0), both
    coordinates being samples of their own.

    Args:
        recordings: Whose people are learned from.
        steps: How many steps ahead.
        ridge: > 0, added to V'V: 1 is the weight of one second of a walker at 0.45 m/s [m^2/s^2].

    Returns:
        The prediction.
    """
    made = [samples(recording, steps=steps) for recording in recordings]
    velocity = np.concatenate([own for own, _ in made]).swapaxes(1, 2).reshape(-1, len(LAGS))
    moved = np.concatenate([own for _, own in made]).swapaxes(1, 2).reshape(-1, steps)
    coefficients = constant_velocity(steps).coefficients.copy()
    for k in range(steps):
        known = ~np.isnan(moved[:, k])
        v = velocity[known]
        rest = moved[known, k] - v @ coefficients[k]
        coefficients[k] += np.linalg.solve(v.T @ v + ridge * np.eye(len(LAGS)), v.T @ rest)
    return Prediction(coefficients=coefficients)


def displacement_error(prediction: Prediction, recording: Recording) -> Array:
    """Mean distance between predicted and true places.

    Args:
        prediction: To be judged.
        recording: Whose people are predicted at every control step of their tracks.

    Returns:
        (steps,) over everybody who is still there [m].
    """
    steps = len(prediction.coefficients)
    velocity, moved = samples(recording, steps=steps)
    return np.nanmean(np.linalg.norm(prediction(velocity, steps=steps) - moved, axis=-1), axis=0)


def fitted_card(
    datasets: Sequence[str], judged_on: Sequence[str] = (), *, data_dir: str | None = None
) -> dict[str, Any]:
    """Fit a prediction, with the ridge that errs least on each recording when the others are learned from.

    Args:
        datasets: Two or more recordings to learn from: names in the catalogue, or paths.
        judged_on: Others on which the prediction is judged, and from which nothing is taken.
        data_dir: Where recordings are looked for first.

    Returns:
        JSON values: what `load_prediction` reads, where it comes from, and the mean displacement error after each step
        on each recording, always without having learned from it, beside that of constant velocity.

    Raises:
        ValueError: If fewer than two recordings are given.
    """
    if len(datasets) < 2:
        raise ValueError(f"datasets = {list(datasets)} is not allowed; allowed: two or more, one is always held out")
    recordings = [load_recording(name, data_dir=data_dir) for name in datasets]
    held_out = {
        ridge: [
            displacement_error(fit([other for other in recordings if other is not own], ridge=ridge), own)
            for own in recordings
        ]
        for ridge in RIDGES
    }
    mean = {ridge: float(np.mean(errors)) for ridge, errors in held_out.items()}
    ridge = min(mean, key=lambda ridge: mean[ridge])
    prediction = fit(recordings, ridge=ridge)
    strangers = [load_recording(name, data_dir=data_dir) for name in judged_on]
    errors = dict(zip((own.name for own in recordings), held_out[ridge], strict=True))
    errors |= {own.name: displacement_error(prediction, own) for own in strangers}
    plain = constant_velocity(STEPS)
    return {
        "step": STEP,
        "lags": list(LAGS),
        "coefficients": prediction.coefficients.tolist(),
        "ridge": ridge,
        "held_out_error_by_ridge": {str(ridge): round(error, 5) for ridge, error in mean.items()},
        "recordings": [recording_metadata(own) for own in recordings],
        "versions": package_versions(PACKAGES),
        "held_out_error": {
            own.name: {
                "linear": errors[own.name].round(4).tolist(),
                "constant_velocity": displacement_error(plain, own).round(4).tolist(),
            }
            for own in (*recordings, *strangers)
        },
    }


def fit_prediction(
    datasets: Sequence[str], path: Path, *, judged_on: Sequence[str] = (), data_dir: str | None = None
) -> dict[str, Any]:
    """Fit a prediction and write it to a file that `load_prediction` takes.

    Args:
        datasets: As `fitted_card` takes them.
        path: JSON file to write.
        judged_on: As `fitted_card` takes them.
        data_dir: Where recordings are looked for first.

    Returns:
        What was written.
    """
    card = fitted_card(datasets, judged_on, data_dir=data_dir)
    write_json(path, card)
    return card
