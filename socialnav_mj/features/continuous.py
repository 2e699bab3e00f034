"""Features that change smoothly: proximity, relative motion and risk by sector."""

import numpy as np

from socialnav_mj.elementary import exp
from socialnav_mj.features.view import HORIZON, View, closest_approach, sector_of
from socialnav_mj.geometry import Array

SIGHT = 6.0
"""People farther away are not seen [m]."""


class Continuous:
    """Goal, own motion, and the nearest person in each of 12 sectors up to 6 m; 54 numbers.

    | index | feature | range |
    |---|---|---|
    | 0, 1 | cosine and sine of the goal's bearing | [-1, 1] |
    | 2 | min(d, 10 m) / 10 m, d the distance to the goal | [0, 1] |
    | 3 | exp(-d / 1 m) | (0, 1] |
    | 4 | forward speed / 1 m/s | about [0, 1] |
    | 5 | yaw rate / 2.618 rad/s | about [-1, 1] |
    | 6 + k | proximity exp(-distance / 2 m) of the nearest person in sector k, 0 if there is none | [0, 1] |
    | 18 + k | its closing speed / 2 m/s, clipped | [-1, 1] |
    | 30 + k | its tangential speed to the left / 2 m/s, clipped | [-1, 1] |
    | 42 + k | greatest risk in the sector, exp(-t / 2 s) exp(-miss distance / 0.5 m), encounters within 4 s | [0, 1] |
    """

    name = "continuous"
    n_sectors = 12
    size = 6 + 4 * n_sectors

    def __call__(self, view: View) -> Array:
        """Describe what agents see by the 54 numbers of the class's table.

        Args:
            view: What n agents see.

        Returns:
            Shape (n, 54).
        """
        n, s = len(view.goal), self.n_sectors
        result = np.zeros((n, self.size))
        result[:, :6] = self.of_self(view)
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        seen = view.present & (distance < SIGHT)
        agent, person = np.nonzero(seen)
        position, velocity = view.position[agent, person], view.velocity[agent, person]
        distance = distance[agent, person]
        sector = sector_of(position, s)
        ahead = position / np.maximum(distance, 1e-9)[:, None]
        closing = -np.einsum("kd,kd->k", velocity, ahead)
        tangential = ahead[:, 0] * velocity[:, 1] - ahead[:, 1] * velocity[:, 0]
        time, miss = closest_approach(position, velocity)
        risk = np.where((closing > 0.0) & (time < HORIZON), exp(-time / 2.0 - miss / 0.5), 0.0)
        np.maximum.at(result, (agent, 6 + 3 * s + sector), risk)
        # The nearest is written last and stays.
        order = np.argsort(-distance, kind="stable")
        agent, sector = agent[order], sector[order]
        result[agent, 6 + sector] = exp(-distance[order] / 2.0)
        result[agent, 6 + s + sector] = np.clip(closing[order] / 2.0, -1.0, 1.0)
        result[agent, 6 + 2 * s + sector] = np.clip(tangential[order] / 2.0, -1.0, 1.0)
        return result

    def of_self(self, view: View) -> Array:
        """The first six numbers of the class's table.

        Args:
            view: What n agents see.

        Returns:
            Shape (n, 6).
        """
        distance = np.hypot(view.goal[:, 0], view.goal[:, 1])
        bearing = view.goal / np.maximum(distance, 1e-9)[:, None]
        nearness = [np.minimum(distance, 10.0) / 10.0, exp(-distance)]
        return np.stack([*bearing.T, *nearness, view.twist[:, 0], view.twist[:, 1] / 2.618], axis=1)

    def mirror(self, features: Array) -> Array:
        """What the scene would give with left and right exchanged.

        Args:
            features: Shape (..., 54).

        Returns:
            Shape (..., 54): sectors in the other order; the goal's sine, yaw rate and tangential speed change sign.
        """
        s = self.n_sectors
        swap = -np.arange(s) % s
        index = np.concatenate([np.arange(6), *(6 + block * s + swap for block in range(4))])
        result = features[..., index].copy()
        result[..., [1, 5]] *= -1.0
        result[..., 6 + 2 * s : 6 + 3 * s] *= -1.0
        return result
