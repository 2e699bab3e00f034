"""Binary features: risk, nearness and speed in bins."""

import numpy as np

from socialnav_mj.elementary import arctan2
from socialnav_mj.features.view import HORIZON, View, closest_approach, sector_of
from socialnav_mj.geometry import Array


class Risk:
    """Binary features of the ReplayIRL authors' kind, in metric form; 80 numbers of 0 or 1.

    | index | feature |
    |---|---|
    | 0-3 | size of the goal's bearing in [0, 1/8), [1/8, 1/4), [1/4, 1/2), [1/2, 1] pi |
    | 4-12 | the goal's bearing in one of 8 sectors; the ninth: it is nearer than 1 m |
    | 13-17 | yaw rate below -0.8, below -0.2, within, above 0.2, above 0.8 rad/s |
    | 18-65 | risk low, medium, high (one of three, if there is anybody) of 8 sectors in the ring below 0.8 m, \
then of 8 sectors in the ring from 0.8 to 1.3 m |
    | 66-73 | somebody nearer than 0.5 m in one of 8 sectors |
    | 74-79 | speed below 0.1, 0.3, 0.5, 0.7, 0.9 m/s, or above |

    The risk of a person is high if it approaches, is nearest within the next 4 s, and its true miss distance then is
    below 0.4 m, medium if that is below 0.8 m, else low; a cell takes the greatest of its people.
    """

    name = "risk"
    n_sectors = 8
    size = 80
    rings = (0.8, 1.3)
    """Outer radii of the two rings in which risk is told [m]."""
    intimate_distance = 0.5
    """Whoever is nearer raises one of features 66 to 73 [m]."""

    def __call__(self, view: View) -> Array:
        """Describe what agents see by the 80 numbers of the class's table.

        Args:
            view: What n agents see.

        Returns:
            Shape (n, 80).
        """
        n, s = len(view.goal), self.n_sectors
        result = np.zeros((n, self.size))
        every = np.arange(n)
        bearing = np.abs(arctan2(view.goal[:, 1], view.goal[:, 0])) / np.pi
        result[every, np.searchsorted([0.125, 0.25, 0.5], bearing, side="right")] = 1.0
        near = np.hypot(view.goal[:, 0], view.goal[:, 1]) < 1.0
        result[every, 4 + np.where(near, s, sector_of(view.goal, s))] = 1.0
        turn = view.twist[:, 1]
        level = (np.abs(turn) > 0.2).astype(np.int64) + (np.abs(turn) > 0.8)
        result[every, 15 + np.sign(turn).astype(np.int64) * level] = 1.0
        result[every, 74 + np.searchsorted([0.1, 0.3, 0.5, 0.7, 0.9], view.twist[:, 0], side="right")] = 1.0
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        agent, person = np.nonzero(view.present & (distance < self.rings[1]))
        position, velocity = view.position[agent, person], view.velocity[agent, person]
        distance = distance[agent, person]
        sector = sector_of(position, s)
        time, miss = closest_approach(position, velocity)
        danger = (time > 0.0) & (time < HORIZON)
        risk = np.where(danger & (miss < 0.4), 2, np.where(danger & (miss < 0.8), 1, 0))
        cell = sector + s * (distance >= self.rings[0])
        greatest = np.full((n, 2 * s), -1)
        np.maximum.at(greatest, (agent, cell), risk)
        rows, cells = np.nonzero(greatest >= 0)
        result[rows, 18 + 3 * cells + greatest[rows, cells]] = 1.0
        close = distance < self.intimate_distance
        result[agent[close], 66 + sector[close]] = 1.0
        return result

    def mirror(self, features: Array) -> Array:
        """What the scene would give with left and right exchanged.

        Args:
            features: Shape (..., 80).

        Returns:
            Shape (..., 80): sectors and bins of the yaw rate in the other order.
        """
        s = self.n_sectors
        swap = -np.arange(s) % s
        cells = np.concatenate([swap, s + swap])
        index = np.concatenate(
            [
                np.arange(4),
                4 + swap,
                [12],
                [17, 16, 15, 14, 13],
                (18 + 3 * cells[:, None] + np.arange(3)).ravel(),
                66 + swap,
                np.arange(74, 80),
            ]
        )
        mirrored: Array = features[..., index].copy()
        return mirrored
