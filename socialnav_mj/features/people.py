"""The nearest people one by one, for networks that weigh them themselves."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.elementary import exp
from socialnav_mj.features.continuous import SIGHT, Continuous
from socialnav_mj.features.view import HORIZON, View, closest_approach
from socialnav_mj.geometry import Array


class People:
    """Goal, own motion, and seven numbers of each of the 10 nearest people up to 6 m, the nearest first; 76 numbers.

    What attention over people is given (Chen et al. 2019, doi 10.1109/ICRA.2019.8794134), in this package's scales.
    All numbers of person k are 0 if there are not so many.

    | index | feature | range |
    |---|---|---|
    | 0-5 | goal and own motion, as in `Continuous` | |
    | 6 + k | 1 if there is a person k | 0 or 1 |
    | 16 + k | its place ahead / 6 m | [-1, 1] |
    | 26 + k | its place to the left / 6 m | [-1, 1] |
    | 36 + k | its relative velocity ahead / 2 m/s, clipped | [-1, 1] |
    | 46 + k | its relative velocity to the left / 2 m/s, clipped | [-1, 1] |
    | 56 + k | proximity exp(-distance / 2 m) | [0, 1] |
    | 66 + k | risk exp(-t / 2 s) exp(-miss distance / 0.5 m), for an encounter within 4 s | [0, 1] |
    """

    name = "people"
    n_people = 10
    n_own = 6
    n_each = 7
    size = n_own + n_each * n_people
    own = Continuous()

    def __call__(self, view: View) -> Array:
        """Describe what agents see by the 76 numbers of the class's table.

        Args:
            view: What n agents see.

        Returns:
            Shape (n, 76).
        """
        distance = np.hypot(view.position[..., 0], view.position[..., 1])
        distance = np.where(view.present & (distance < SIGHT), distance, np.inf)
        order = np.argsort(distance, axis=1, kind="stable")[:, : self.n_people]
        distance = np.take_along_axis(distance, order, axis=1)
        there = np.isfinite(distance)
        position = np.where(there[..., None], np.take_along_axis(view.position, order[..., None], axis=1), 0.0)
        velocity = np.where(there[..., None], np.take_along_axis(view.velocity, order[..., None], axis=1), 0.0)
        agent, place = np.nonzero(there)
        time, miss = closest_approach(position[there], velocity[there])
        closing = np.einsum("kd,kd->k", position[there], velocity[there]) < 0.0
        risk = np.where(closing & (time < HORIZON), exp(-time / 2.0 - miss / 0.5), 0.0)
        result = np.zeros((len(view.goal), self.size))
        result[:, : self.n_own] = self.own.of_self(view)
        each = result[:, self.n_own :].reshape(-1, self.n_each, self.n_people)
        each[:, 0, : there.shape[1]] = there
        each[:, 1:3, : there.shape[1]] = position.swapaxes(1, 2) / SIGHT
        each[:, 3:5, : there.shape[1]] = np.clip(velocity.swapaxes(1, 2) / 2.0, -1.0, 1.0)
        each[agent, 5, place] = exp(-distance[there] / 2.0)
        each[agent, 6, place] = risk
        return result

    def mirror(self, features: Array) -> Array:
        """What the scene would give with left and right exchanged.

        Args:
            features: Shape (..., 76).

        Returns:
            Shape (..., 76): the goal's sine, the yaw rate, and all that is to the left change sign.
        """
        result = features.copy()
        result[..., [1, 5]] *= -1.0
        for quantity in (2, 4):
            first = self.n_own + quantity * self.n_people
            result[..., first : first + self.n_people] *= -1.0
        return result

    def split(self, features: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Own numbers and those of each person.

        Args:
            features: Shape (n, >= 76); what follows the table is left out.

        Returns:
            Shapes (n, 6) and (n, 10, 7).
        """
        each = features[:, self.n_own : self.size].reshape(len(features), self.n_each, self.n_people)
        return features[:, : self.n_own], each.swapaxes(1, 2)
