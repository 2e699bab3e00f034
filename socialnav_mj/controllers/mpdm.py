"""`mpdm`: multi-policy decision making, the choice among policies by rolling each of them out.

Cunningham et al. 2015, doi 10.1109/ICRA.2015.7139412; for robots among people Mehta et al. 2016, doi
10.1109/IROS.2016.7759205.
"""

from copy import deepcopy
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.base import IS_CONTROLLER, Limits, Observation, TwistController
from socialnav_mj.controllers.planning.foresight import Ahead, Foresight
from socialnav_mj.controllers.planning.imagination import Imagination, clipped
from socialnav_mj.controllers.planning.loops import inside, lacking
from socialnav_mj.controllers.planning.terms import Terms, terms_of
from socialnav_mj.controllers.potential_field import PotentialFieldCapped
from socialnav_mj.controllers.prediction import Prediction, load_prediction
from socialnav_mj.controllers.replay_irl import ReplayIRL
from socialnav_mj.controllers.social_force import SocialForce
from socialnav_mj.controllers.stand_still import StandStill
from socialnav_mj.controllers.switching import SwitchingController, check_candidates
from socialnav_mj.geometry import Array

STEPS = 12
"""Of a roll-out, of 0.2 s each: 2.4 s; chosen on draws 0-9 of students003."""


def _default_candidates() -> tuple[TwistController, ...]:
    return PotentialFieldCapped(), ReplayIRL(), SocialForce(), StandStill()


@dataclass(kw_only=True)
class MPDM(SwitchingController):
    """Rolls each candidate out in closed loop, as if it drove alone from now on, and lets the best drive the next step.

    A roll-out sees the nearest others move as predicted; the candidate reacts to them, they do not react to it.
    Candidates are to have no memory: a roll-out begins with a fresh one.
    """

    candidates: tuple[TwistController, ...] = field(default_factory=_default_candidates, metadata={IS_CONTROLLER: True})
    """Policies to choose from, two or more."""
    clearance_weight: float = 4.0
    """Cost of the worst lack of clearance, >= 0 [m]."""
    zone_weight: float = 0.5
    """Cost of a second within 1.3 m of a person, >= 0 [m/s]."""
    bonus: float = 0.05
    """By which whoever drove last is cheaper, >= 0, so that equals do not alternate [m]."""
    prediction: str = "linear"
    """As `prediction.load_prediction` takes it."""
    name: str = "mpdm"
    _prediction: Prediction = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("clearance_weight", "zone_weight", "bonus"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} = {value!r} is not allowed; allowed: numbers >= 0")
        self.candidates = tuple(self.candidates)
        check_candidates(self.candidates)
        self._prediction = load_prediction(self.prediction, steps=STEPS + 1)

    @property
    def members(self) -> tuple[TwistController, ...]:
        """The candidates."""
        return self.candidates

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Reset all candidates for the episode to come, and those that drive in the imagination.

        Args:
            limits: What the robots of that episode can do.
            seed: Given to all.
        """
        super().reset(limits, seed=seed)
        self._terms: Terms = terms_of(limits, steps=STEPS)
        self._foresight = Foresight(self._prediction, limits, steps=STEPS + 1)
        self._imagined = [deepcopy(candidate) for candidate in self.candidates]
        self._seed, self._limits_ahead = seed, replace(limits, control_timestep=self._terms.step)
        self._person = np.zeros(0, dtype=np.int64)

    def choose(self, observation: Observation) -> NDArray[np.int64]:
        """Roll every candidate out; whoever acted at the step before is cheaper by the bonus.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            The candidate whose roll-out costs least, shape (n_agents,).
        """
        active = observation["active"]
        rows = np.flatnonzero(active)
        ahead = self._foresight.look(observation)
        costs = np.full((len(active), len(self.candidates)), np.nan)
        costs[rows] = self._costs(observation, rows, ahead)
        person = np.where(active, observation["person"], -1)
        if len(self._person) == len(person):
            again = np.flatnonzero(active & (self._person == person))
            costs[again, self._acting[again]] -= self.bonus
        self._person = person
        return self.cheapest(costs)

    def twist(self, observation: Observation) -> Array:
        """Twist of the candidate whose roll-out costs least.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            Shape (n_agents, 2) [m/s], [rad/s]; 0 for inactive slots.
        """
        return super().twist(observation) * observation["active"][:, None]

    def _costs(self, observation: Observation, rows: NDArray[np.int64], ahead: Ahead) -> Array:
        """Of the roll-outs of every candidate, (n, candidates) [m]; all are imagined at once, one after the other."""
        terms, count = self._terms, len(self._imagined)
        path, real, person = (_as_often(values, count) for values in (ahead.path, ahead.real, ahead.person))
        imagined = Imagination(
            observation, _as_often(rows, count), ahead._replace(path=path, real=real, person=person), terms
        )
        own = [slice(k * len(rows), (k + 1) * len(rows)) for k in range(count)]
        contact = np.where(imagined.person, self.limits.contact_distance, self.limits.agent_contact_distance)
        start = np.hypot(imagined.goal[:, 0], imagined.goal[:, 1])
        worst, zone = np.zeros(len(start)), np.zeros(len(start))
        arrived = np.zeros(len(start), dtype=bool)
        for candidate in self._imagined:
            candidate.reset(self._limits_ahead, seed=self._seed)
        for k in range(STEPS):
            seen = imagined.observation()
            twists = [
                candidate.twist({key: values[part] for key, values in seen.items()})
                for candidate, part in zip(self._imagined, own, strict=True)
            ]
            distance = imagined.drive(clipped(np.concatenate(twists), self.limits))
            lack = np.where(imagined.real, lacking(distance, contact, terms.margin[k], terms), 0.0)
            near = np.where(imagined.real & imagined.person, inside(distance, terms), 0.0)
            worst = np.where(arrived, worst, np.maximum(worst, terms.clearance_decay[k] * _greatest(lack)))
            zone = np.where(arrived, zone, zone + terms.step * _greatest(near))
            left = np.hypot(*(imagined.goal - imagined.position).T)
            arrived = arrived | (left <= terms.arrival_distance)
        left = np.where(arrived, np.minimum(left, terms.arrival_distance), left)
        costs: Array = self.clearance_weight * worst + self.zone_weight * zone - (start - left)
        return costs.reshape(count, len(rows)).T


def _as_often(values: NDArray[Any], count: int) -> NDArray[Any]:
    return np.concatenate([values] * count)


def _greatest(values: Array) -> Array:
    """Greatest value of each row, 0 where there is none."""
    greatest: Array = values.max(axis=1, initial=0.0)
    return greatest
