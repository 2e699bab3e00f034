"""States of the learned reward: a feature vector followed by two flags, goal reached and collided.

Both are absorbing, and there all else is 0.
"""

import numpy as np

from socialnav_mj.features.sets import FeatureSet
from socialnav_mj.geometry import Array

N_FLAGS = 2
GOAL_FLAG, COLLISION_FLAG = -2, -1
"""Places of the two flags, counted from the end of a state."""


def running_state(features: Array) -> Array:
    """States of agents under way: features and lowered flags.

    Args:
        features: Shape (n, size).

    Returns:
        Shape (n, size + 2), the flags 0.
    """
    return np.concatenate([features, np.zeros((len(features), N_FLAGS))], axis=1)


def mirror_state(features: FeatureSet, state: Array) -> Array:
    """States with left and right exchanged; the flags stay.

    Args:
        features: The set that the states are made of.
        state: Shape (..., size + 2).

    Returns:
        Shape (..., size + 2).
    """
    return np.concatenate([features.mirror(state[..., :-N_FLAGS]), state[..., -N_FLAGS:]], axis=-1)


def absorbing_state(size: int, flag: int) -> Array:
    """The state of everybody who reached the goal, or of everybody who collided.

    Args:
        size: Length of the feature vector, without flags.
        flag: `GOAL_FLAG` or `COLLISION_FLAG`.

    Returns:
        Shape (size + 2,): 1 in the place of the flag, 0 elsewhere.
    """
    state = np.zeros(size + N_FLAGS)
    state[flag] = 1.0
    return state
