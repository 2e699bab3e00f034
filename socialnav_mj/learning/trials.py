"""Trials of policies in real episodes: one drawn evenly acts for a while, and what comes of it is its cost."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers import make_controller, with_policy_of
from socialnav_mj.controllers.base import IS_CONTROLLER, Limits, Observation, TwistController
from socialnav_mj.controllers.situation import situation
from socialnav_mj.controllers.switching import SwitchingController, check_candidates
from socialnav_mj.environment import make_environment
from socialnav_mj.episode import Episode
from socialnav_mj.features import view_of
from socialnav_mj.files import written_whole
from socialnav_mj.geometry import Array
from socialnav_mj.metrics.proximity import INTIMATE_DISTANCE, nearest_pedestrian_distance
from socialnav_mj.rollout import rollout

HOLD = 2.4
"""How long a trial lasts: as long as `mpdm` looks ahead [s]."""
COLLISION_COST = 8.0
"""Of a first collision in a trial, as calm `mpc` weighs touching a person [s]."""
NEARNESS_COST = 0.5
"""Of a second within 1.2 m of a pedestrian, about that of the planners' presets [1]."""


@dataclass(kw_only=True)
class Trials(SwitchingController):
    """Lets policies drawn at random act for `HOLD` seconds each, and keeps the situations in which they began."""

    candidates: tuple[TwistController, ...] = field(metadata={IS_CONTROLLER: True})
    """Policies that are drawn from, evenly."""
    name: str = "trials"
    log: list[tuple[int, NDArray[np.int64], NDArray[np.int64], Array]] = field(init=False, repr=False)
    """(control step, persons, candidates, situations) of the trials that began at a step."""

    def __post_init__(self) -> None:
        check_candidates(self.candidates)

    @property
    def members(self) -> tuple[TwistController, ...]:
        """The candidates."""
        return self.candidates

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Reset all candidates and forget the log.

        Args:
            limits: What the robots of that episode can do.
            seed: Of the draws, and given to all.
        """
        super().reset(limits, seed=seed)
        self._random, self._step = np.random.default_rng(seed), 0
        self._steps = round(HOLD / limits.control_timestep)
        self._person = self._left = np.zeros(0, dtype=np.int64)
        self.log = []

    def choose(self, observation: Observation) -> NDArray[np.int64]:
        """Draw anew for agents whose trial is over and for those that have just come.

        Args:
            observation: Keys as in `socialnav_mj.observation`.

        Returns:
            Who acts, shape (n_agents,).
        """
        active = observation["active"]
        person = np.where(active, observation["person"], -1)
        if len(self._person) != len(person):
            self._person, self._left = np.full(len(person), -1), np.zeros(len(person), dtype=np.int64)
            self._acting = np.zeros(len(person), dtype=np.int64)
        drawn = self._random.integers(len(self.candidates), size=len(person))
        begins = active & ((person != self._person) | (self._left == 0))
        acting = np.where(begins, drawn, self._acting)
        if rows := np.flatnonzero(begins).tolist():
            at = np.array(rows)
            self.log.append((self._step, person[at], acting[at], situation(view_of(observation, at))))
        self._left = np.where(begins, self._steps, self._left) - 1
        self._person, self._step = person, self._step + 1
        return np.where(active, acting, 0)


def outcomes(episode: Episode, log: Sequence[tuple[int, NDArray[np.int64], NDArray[np.int64], Array]]) -> Array:
    """What came of each trial: time, less the way made at full speed, collision and nearness.

    Args:
        episode: In which they took place.
        log: Of `Trials`.

    Returns:
        Cost of each, in the order of the log, shape (k,) [s].
    """
    dt = episode.control_timestep
    speed = float(episode.metadata["scenario"]["robot"]["max_speed"])
    radius = float(episode.metadata["scenario"]["goal_radius"])
    near = nearest_pedestrian_distance(episode) < INTIMATE_DISTANCE
    first = np.full(episode.n_agents, np.inf)
    np.minimum.at(first, episode.contact_agent, episode.contact_time)
    gap = episode.agent_position - episode.agent_goal
    left = np.maximum(np.hypot(gap[..., 0], gap[..., 1]), radius)
    costs = []
    for step, persons, *_ in log:
        for agent in np.searchsorted(episode.agent_person, persons):
            end = min(step + round(HOLD / dt), episode.window(agent).stop - 1)
            begin_time, end_time = episode.time[step], episode.time[end]
            cost = end_time - begin_time - (left[step, agent] - left[end, agent]) / speed
            cost += COLLISION_COST * (begin_time < first[agent] <= end_time)
            costs.append(cost + NEARNESS_COST * dt * near[step:end, agent].sum())
    return np.array(costs)


def collect(
    folder: Path, candidates: Sequence[str], *, dataset: str, shares: Sequence[float], draws: int, data_dir: str | None
) -> list[Path]:
    """Run episodes of trials; those whose file is there are not run again.

    Args:
        folder: Gets trials_SHARE_DRAW.npz.
        candidates: Specs of the policies.
        dataset: Name or path of the recording.
        shares: Of the people who are replaced, an episode each.
        draws: How many draws of each, from draw 0 on; at most 100, since draws from 100 on are for reporting.
        data_dir: Where recordings are looked for first.

    Returns:
        The files, in the order of shares and draws.

    Raises:
        ValueError: If there are more draws than may be learned from.
    """
    if not 1 <= draws <= 100:
        raise ValueError(
            f"draws = {draws} is not allowed; allowed: 1 to 100, since draws from 100 on are for reporting"
        )
    paths = []
    for share in shares:
        for draw in range(draws):
            paths.append(folder / f"trials_{share:g}_{draw:03d}.npz")
            if paths[-1].exists():
                continue
            controller = Trials(candidates=tuple(_made(spec, dataset) for spec in candidates))
            environment = make_environment(dataset=dataset, share=share, seed=draw, data_dir=data_dir)
            episode = rollout(environment, controller)
            choice = np.concatenate([chosen for _, _, chosen, _ in controller.log])
            numbers = np.concatenate([seen for *_, seen in controller.log])
            with written_whole(paths[-1]) as part:
                np.savez(part, choice=choice, situation=numbers, cost=outcomes(episode, controller.log))
    return paths


def _made(spec: str, dataset: str) -> TwistController:
    controller = make_controller(with_policy_of(spec, dataset))
    if not isinstance(controller, TwistController):
        raise ValueError(f"candidate {spec!r} is not allowed; allowed: controllers derived from TwistController")
    return controller
