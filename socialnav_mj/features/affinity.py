"""Social affinity map: how many people there are in each cell around an agent, and how they move there."""

import numpy as np

from socialnav_mj.features.continuous import Continuous
from socialnav_mj.features.view import View, sector_of
from socialnav_mj.geometry import Array


class Affinity:
    """Goal, own motion, and a velocity-augmented social affinity map of 8 sectors in 3 rings; 78 numbers.

    Alahi et al. (2014, "Socially-aware large-scale crowd forecasting", CVPR) tell who is around a walker by occupied
    cells of a polar map; Fahad et al. (2018, "Learning how pedestrians navigate: a deep inverse reinforcement learning
    approach", IROS) learn a reward from such a map with motion in it. Cells, scales and the first six numbers are ours.

    | index | feature | range |
    |---|---|---|
    | 0-5 | goal and own motion, as in `Continuous` | |
    | 6 + k | c / (c + 1), c the number of people in sector k nearer than 1 m | [0, 1) |
    | 14 + k | the same between 1 and 2.5 m | [0, 1) |
    | 22 + k | the same between 2.5 and 6 m | [0, 1) |
    | 30 + k | their mean closing speed / 2 m/s, clipped, in sector k nearer than 1 m; 0 if there is nobody | [-1, 1] |
    | 38 + k | the same between 1 and 2.5 m | [-1, 1] |
    | 46 + k | the same between 2.5 and 6 m | [-1, 1] |
    | 54 + k | their mean tangential speed to the left / 2 m/s, clipped, in sector k nearer than 1 m | [-1, 1] |
    | 62 + k | the same between 1 and 2.5 m | [-1, 1] |
    | 70 + k | the same between 2.5 and 6 m | [-1, 1] |
    """

    name = "sam"
    n_sectors = 8
    rings = (1.0, 2.5, 6.0)
    """Outer radii of the rings [m]."""
    n_cells = n_sectors * len(rings)
    size = 6 + 3 * n_cells
    own = Continuous()

    def __call__(self, view: View) -> Array:
        """Describe what agents see by the 78 numbers of the class's table.

        Args:
            view: What n agents see.

        Returns:
            Shape (n, 78).
        """
        n = len(view.goal)
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        agent, person = np.nonzero(view.present & (distance < self.rings[-1]))
        position, velocity = view.position[agent, person], view.velocity[agent, person]
        distance = distance[agent, person]
        ahead = position / np.maximum(distance, 1e-9)[:, None]
        closing = -np.einsum("kd,kd->k", velocity, ahead)
        tangential = ahead[:, 0] * velocity[:, 1] - ahead[:, 1] * velocity[:, 0]
        cell = sector_of(position, self.n_sectors) + self.n_sectors * np.searchsorted(self.rings, distance, "right")
        # People are a set: their sums must not depend on who is counted first.
        order = np.lexsort((distance, closing, np.abs(tangential)))
        place = (agent[order], cell[order])
        count, sums = np.zeros((n, self.n_cells)), np.zeros((2, n, self.n_cells))
        np.add.at(count, place, 1.0)
        for total, values in zip(sums, (closing, tangential), strict=True):
            np.add.at(total, place, values[order])
        mean = np.clip(sums / np.maximum(count, 1.0) / 2.0, -1.0, 1.0)
        return np.concatenate([self.own.of_self(view), count / (count + 1.0), mean[0], mean[1]], axis=1)

    def mirror(self, features: Array) -> Array:
        """What the scene would give with left and right exchanged.

        Args:
            features: Shape (..., 78).

        Returns:
            Shape (..., 78): sectors in the other order; the goal's sine, yaw rate and tangential speeds change sign.
        """
        swap = -np.arange(self.n_sectors) % self.n_sectors
        rings = range(6, self.size, self.n_sectors)
        result = features[..., np.concatenate([np.arange(6), *(first + swap for first in rings)])].copy()
        result[..., [1, 5]] *= -1.0
        result[..., -self.n_cells :] *= -1.0
        return result
