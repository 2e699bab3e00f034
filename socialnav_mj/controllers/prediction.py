"""Where others will be: a linear function of the velocities that they had, or the velocity that they have."""

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from socialnav_mj.geometry import Array
from socialnav_mj.resources import assets_folder

STEP = 0.2
"""Between two predicted places, and the unit of lags [s]."""
LAGS = (0, 1, 2, 3, 5, 8)
"""How many steps back the velocities are that a prediction uses."""
CONSTANT_VELOCITY = "constant_velocity"
"""Name of the prediction that everybody keeps the present velocity."""


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """A displacement for each step to come, as a sum over the velocities of `LAGS`; the same for both coordinates.

    One matrix for both coordinates makes it the same in every frame: a turned crowd is predicted turned.
    """

    coefficients: Array
    """(steps, lags) by which the velocities count [s]."""

    def __post_init__(self) -> None:
        shape, lags = np.shape(self.coefficients), len(LAGS)
        if len(shape) != 2 or not shape[0] or shape[1] != lags or not np.isfinite(self.coefficients).all():
            raise ValueError(f"coefficients of shape {shape} are not allowed; allowed: (steps, {lags}), finite")

    def __call__(self, velocity: Array, *, steps: int) -> Array:
        """Predict how far others move.

        Args:
            velocity: (..., lags, 2) of each lag of `LAGS`, in any frame [m/s].
            steps: How many steps of `STEP` ahead, at most as many as there are coefficients.

        Returns:
            Displacement from the present place to that at the end of each step, (..., steps, 2), same axes [m].

        Raises:
            ValueError: If more steps are asked for than are known.
        """
        if steps > len(self.coefficients):
            raise ValueError(f"steps = {steps} is not allowed; allowed: at most {len(self.coefficients)}")
        # One sum after the other: a matrix product would leave their order to BLAS. The last axis is that of the steps,
        # since numpy is slow along short ones.
        along = np.zeros((*velocity.shape[:-2], 2, steps))
        for lag in np.flatnonzero(self.coefficients.any(axis=0)):
            along += velocity[..., lag, :, None] * self.coefficients[:steps, lag]
        return along.swapaxes(-1, -2)


def constant_velocity(steps: int) -> Prediction:
    """Everybody keeps the present velocity.

    Args:
        steps: How many steps ahead it reaches.

    Returns:
        A prediction that needs no history.
    """
    coefficients = np.zeros((steps, len(LAGS)))
    coefficients[:, 0] = STEP * np.arange(1, steps + 1)
    return Prediction(coefficients=coefficients)


def predictions_folder() -> Path:
    """Where the predictions are that come with the package.

    Returns:
        The folder of their JSON files.
    """
    return assets_folder() / "predictions"


@lru_cache(maxsize=16)
def load_prediction(name: str, *, steps: int) -> Prediction:
    """Find a prediction by its name.

    Args:
        name: `CONSTANT_VELOCITY`, name of a file in `predictions_folder` without .json, or path of such a file.
        steps: How many steps ahead it has to reach.

    Returns:
        The prediction; files are read once.

    Raises:
        ValueError: If there is none, its file is damaged, or it does not reach so far.
    """
    if name == CONSTANT_VELOCITY:
        return constant_velocity(steps)
    path = Path(name) if name.endswith(".json") else predictions_folder() / f"{name}.json"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in predictions_folder().glob("*.json")))
        raise ValueError(
            f"there is no prediction {name!r}; available: {CONSTANT_VELOCITY}, {known}, or the path of a .json file"
        )
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if (content["step"], content["lags"]) != (STEP, list(LAGS)):
            raise ValueError(f"it is made for steps of {content['step']} s and lags {content['lags']}")
        prediction = Prediction(coefficients=np.array(content["coefficients"], dtype=float))
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no prediction for steps of {STEP} s and lags {list(LAGS)}: {error!r}") from error
    if steps > len(prediction.coefficients):
        raise ValueError(f"{path} predicts {len(prediction.coefficients)} steps; expected at least {steps}")
    return prediction
