"""Features that tell companions from strangers."""

from dataclasses import replace

import numpy as np

from socialnav_mj.elementary import exp
from socialnav_mj.features.continuous import SIGHT, Continuous
from socialnav_mj.features.view import View, sector_of
from socialnav_mj.geometry import Array


class Companions:
    """`Continuous` of strangers alone, and how near the nearest companion is in each of 12 sectors; 66 numbers.

    | index | feature | range |
    |---|---|---|
    | 0-53 | those of `Continuous`, of everybody who is no companion | |
    | 54 + k | proximity exp(-distance / 2 m) of the nearest companion in sector k, 0 if there is none | [0, 1] |

    An agent has no companions, so its last 12 numbers are 0.
    """

    name = "companions"
    strangers = Continuous()
    n_sectors = Continuous.n_sectors
    size = strangers.size + n_sectors

    def __call__(self, view: View) -> Array:
        """Describe what agents or people see by the 66 numbers of the class's table.

        Args:
            view: What n of them see.

        Returns:
            Shape (n, 66).
        """
        near = np.zeros((len(view.goal), self.n_sectors))
        companion = view.companion
        if companion is None:
            return np.concatenate([self.strangers(view), near], axis=1)
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        who, person = np.nonzero(view.present & companion & (distance < SIGHT))
        sector = sector_of(view.position[who, person], self.n_sectors)
        np.maximum.at(near, (who, sector), exp(-distance[who, person] / 2.0))
        return np.concatenate([self.strangers(replace(view, present=view.present & ~companion)), near], axis=1)

    def mirror(self, features: Array) -> Array:
        """What the scene would give with left and right exchanged.

        Args:
            features: Shape (..., 66).

        Returns:
            Shape (..., 66).
        """
        size, s = self.strangers.size, self.n_sectors
        near = features[..., size:][..., -np.arange(s) % s]
        return np.concatenate([self.strangers.mirror(features[..., :size]), near], axis=-1)
