"""The feature sets that a policy's card can name, and what each of them has."""

from typing import Protocol

from socialnav_mj.features.affinity import Affinity
from socialnav_mj.features.companions import Companions
from socialnav_mj.features.continuous import Continuous
from socialnav_mj.features.people import People
from socialnav_mj.features.risk import Risk
from socialnav_mj.features.view import View
from socialnav_mj.geometry import Array


class FeatureSet(Protocol):
    """A function from what n agents see to `size` numbers each, and how these change in a mirror."""

    name: str
    size: int
    """Length of a feature vector, without flags."""

    def __call__(self, view: View) -> Array:
        """Features, shape (n, size)."""

    def mirror(self, features: Array) -> Array:
        """Features of the mirrored scene (left and right exchanged), shape (..., size)."""


FEATURE_SETS: dict[str, FeatureSet] = {
    features.name: features for features in (Continuous(), Companions(), Risk(), Affinity(), People())
}


def feature_set(name: str) -> FeatureSet:
    """The feature set that a policy's card or a training's configuration names.

    Args:
        name: A key of `FEATURE_SETS`.

    Returns:
        The one object of that set; it holds no state.

    Raises:
        ValueError: If there is none of this name.
    """
    if name not in FEATURE_SETS:
        raise ValueError(f"unknown feature set {name!r}; available: {', '.join(FEATURE_SETS)}")
    return FEATURE_SETS[name]
