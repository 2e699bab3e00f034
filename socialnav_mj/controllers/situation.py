"""What a learned switch knows of an agent's situation: a few numbers that are the same in the mirror."""

import numpy as np

from socialnav_mj.features import Continuous, View
from socialnav_mj.geometry import Array

NAMES = (
    "goal ahead",
    "goal aside",
    "goal distance",
    "goal near",
    "speed",
    "turning",
    "crowd",
    "nearest",
    "nearest ahead",
    "nearest aside",
    "nearest behind",
    "approach",
    "risk",
    "risk ahead",
    "risk in all",
)
"""Of the numbers that `situation` returns."""

_CONTINUOUS = Continuous()
_ROUND = np.arange(_CONTINUOUS.n_sectors)
_FROM_AHEAD = np.minimum(_ROUND, _CONTINUOUS.n_sectors - _ROUND)
_AHEAD, _ASIDE, _BEHIND = (
    np.flatnonzero((low <= _FROM_AHEAD) & (high >= _FROM_AHEAD)) for low, high in ((0, 1), (2, 4), (5, 6))
)


def situation(view: View) -> Array:
    """Summarise the features "continuous": goal and own motion, who is near where, who approaches, what risk there is.

    Args:
        view: What n agents see.

    Returns:
        (n, 15) numbers of about 1 in size, named by `NAMES`.
    """
    features = _CONTINUOUS(view)
    own, sectors = features[:, :6], features[:, 6:].reshape(len(features), 4, -1)
    near, closing, risk = sectors[:, 0], sectors[:, 1], sectors[:, 3]
    return np.stack(
        [
            own[:, 0],
            np.abs(own[:, 1]),
            own[:, 2],
            own[:, 3],
            own[:, 4],
            np.abs(own[:, 5]),
            _mean(near),
            near.max(axis=1),
            near[:, _AHEAD].max(axis=1),
            near[:, _ASIDE].max(axis=1),
            near[:, _BEHIND].max(axis=1),
            (near * np.maximum(closing, 0.0)).max(axis=1),
            risk.max(axis=1),
            risk[:, _AHEAD].max(axis=1),
            _mean(risk),
        ],
        axis=1,
    )


def _mean(values: Array) -> Array:
    """Of each row, added from its beginning: numpy's own sum adds in an order that depends on the layout."""
    total = np.zeros(len(values))
    for k in range(values.shape[1]):
        total = total + values[:, k]
    return total / values.shape[1]
