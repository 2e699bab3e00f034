"""Left and right exchanged in many states at once."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.features import N_FLAGS, FeatureSet, mirror_state


class Mirror:
    """Exchange of left and right in the states of a feature set."""

    def __init__(self, features: FeatureSet) -> None:
        """Find where each value of a mirrored state comes from, and with which sign.

        Args:
            features: Of the states.
        """
        of_each = mirror_state(features, np.eye(features.size + N_FLAGS))
        self._index = np.abs(of_each).argmax(axis=0)
        self._sign = of_each[self._index, np.arange(len(self._index))].astype(np.float32)

    def __call__(self, state: NDArray[Any], which: NDArray[np.bool_]) -> NDArray[np.float32]:
        """States of which some are mirrored.

        Args:
            state: Shape (n, size).
            which: Shape (n,).

        Returns:
            Shape (n, size).
        """
        result = np.array(state, dtype=np.float32)
        result[which] = result[which][:, self._index] * self._sign
        return result
