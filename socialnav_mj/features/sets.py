"""Feature sets by name."""

from typing import Protocol

from socialnav_mj.features.continuous import Continuous
from socialnav_mj.features.risk import Risk
from socialnav_mj.features.view import View
from socialnav_mj.geometry import Array


class FeatureSet(Protocol):
    """A fixed-size description of a view."""

    name: str
    size: int
    """Length of a feature vector, without flags."""

    def __call__(self, view: View) -> Array:
        """Features, shape (n, size)."""

    def mirror(self, features: Array) -> Array:
        """Features of the mirrored scene (left and right exchanged), shape (..., size)."""


FEATURE_SETS: dict[str, FeatureSet] = {"continuous": Continuous(), "risk": Risk()}


def feature_set(name: str) -> FeatureSet:
    """Feature set by name.

    Args:
        name: "continuous" or "risk".

    Returns:
        The feature set.

    Raises:
        ValueError: If there is none of this name.
    """
    if name not in FEATURE_SETS:
        raise ValueError(f"unknown feature set {name!r}; available: {', '.join(FEATURE_SETS)}")
    return FEATURE_SETS[name]
