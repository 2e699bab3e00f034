"""All agents of one scene as a PettingZoo parallel environment."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from socialnav_mj.controllers import Limits
from socialnav_mj.environment import Environment, build_environment
from socialnav_mj.envs.settings import Settings
from socialnav_mj.envs.spaces import Seen, action_space, bare, observation_space, row_of
from socialnav_mj.episode import Outcome
from socialnav_mj.recordings.draw import replaced_people


def parallel_env(*, scenario: int = 1, **settings: Any) -> "CrowdParallelEnv":
    """A scenario in which every agent is yours.

    Args:
        scenario: 1 to 4.
        **settings: Of `socialnav_mj.envs.settings.Settings.of`.

    Returns:
        A PettingZoo parallel environment.

    Raises:
        ValueError: If something is unknown or not allowed.
        FileNotFoundError: If the recording is not there.
    """
    return CrowdParallelEnv(scenario=scenario, **settings)


class CrowdParallelEnv(ParallelEnv[str, Seen, NDArray[np.float32]]):
    """Agents are numbered in the order in which their people appear, and are there while their run lasts.

    Rewards, ends of runs and bodies are those of `socialnav_mj.envs.single.CrowdEnv`. While nobody is under way the
    scene goes on by itself, so that `agents` is empty at the end alone.
    """

    metadata: dict[str, Any] = {"name": "socialnav_mj_v0", "render_modes": [], "is_parallelizable": True}  # noqa: RUF012

    def __init__(self, *, scenario: int = 1, render_mode: None = None, **settings: Any) -> None:
        """Load the recording.

        Args:
            scenario: 1 to 4.
            render_mode: None: there are no pictures.
            **settings: Of `socialnav_mj.envs.settings.Settings.of`.
        """
        self.settings, self.render_mode = Settings.of(scenario, **settings), render_mode
        own = self.settings.scenario
        count = len(
            replaced_people(
                self.settings.recording, share=own.share, seed=0, minimum_displacement=own.minimum_displacement
            )
        )
        # The share decides how many are replaced, the draw only whom.
        self.possible_agents = [f"agent_{number}" for number in range(count)]
        self.agents: list[str] = []
        self.observation_spaces = {name: observation_space(self.settings.observer) for name in self.possible_agents}
        self.action_spaces = {name: action_space() for name in self.possible_agents}
        self._random = np.random.default_rng()
        self._environment: Environment | None = None

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """What an agent can see.

        Args:
            agent: Its name.

        Returns:
            The same object at each call.
        """
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """What an agent can do.

        Args:
            agent: Its name.

        Returns:
            The same object at each call.
        """
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Seen], dict[str, dict[str, Any]]]:
        """Begin a draw.

        Args:
            seed: From which draws are drawn; None draws on.
            options: "draw": that draw instead of a random one.

        Returns:
            Observations and infos (draw, person) of the agents under way.
        """
        if seed is not None:
            self._random = np.random.default_rng(seed)
        draw = int((options or {}).get("draw", self._random.integers(2**31)))
        scenario = self.settings.scenario.changed(seed=draw)
        self._draw, self._limits = draw, Limits.of(scenario)
        self._environment = build_environment(self.settings.recording, scenario, robots="likely")
        self._environment.reset()
        cast = self._environment.task.cast
        # Ranks by appearance; the sort is stable, so those who appear together keep the recording's order.
        self._ranked = np.argsort(cast.agent_appear_step, kind="stable")
        self._rank = np.argsort(self._ranked)
        self._wait_for_somebody()
        self.agents = self._names_under_way()
        return self._seen(self.agents, {}), {name: self._info(name) for name in self.agents}

    def step(
        self, actions: dict[str, NDArray[np.float32]]
    ) -> tuple[dict[str, Seen], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Step the scene.

        Args:
            actions: Two numbers in [-1, 1] for each agent under way.

        Returns:
            Observations, rewards, terminations, truncations and infos (draw, person, at the end outcome) of those who
            were under way and of those who have appeared.
        """
        if self._environment is None or not self.agents:
            self.agents = []
            return {}, {}, {}, {}, {}
        task, driven = self._environment.task, self.agents
        slots = self._slots(driven)
        action = np.zeros((task.cast.n_agent_slots, 2))
        action[slots] = [actions[name] for name in driven]
        time_step = self._environment.step(self._limits.wheel_speed_of_action(action, self.settings.action))
        rewards = {name: float(time_step.reward[slot]) for name, slot in zip(driven, slots, strict=True)}
        outcomes = {name: int(task.outcome[self._index(name)]) for name in driven}
        seen = self._seen(driven, outcomes, slots)
        self._wait_for_somebody()
        self.agents = self._names_under_way()
        new = [name for name in self.agents if name not in rewards]
        seen |= self._seen(new, {})
        rewards |= dict.fromkeys(new, 0.0)
        late = {name: outcomes.get(name) == Outcome.TIMED_OUT for name in rewards}
        over = {name: outcomes.get(name, -1) >= 0 and not late[name] for name in rewards}
        infos = {name: self._info(name, outcomes.get(name, -1)) for name in rewards}
        return seen, rewards, over, late, infos

    def _wait_for_somebody(self) -> None:
        """Let time pass until an agent is under way, or all have been."""
        assert self._environment is not None
        task = self._environment.task
        while not (task.slot_agent >= 0).any() and (task.outcome < 0).any():
            self._environment.step(np.zeros((task.cast.n_agent_slots, 2)))

    def _names_under_way(self) -> list[str]:
        assert self._environment is not None
        held = self._environment.task.slot_agent
        return [f"agent_{rank}" for rank in sorted(self._rank[held[held >= 0]].tolist())]

    def _index(self, name: str) -> int:
        """Index of an agent in the cast."""
        return int(self._ranked[int(name.removeprefix("agent_"))])

    def _slots(self, names: list[str]) -> NDArray[np.int64]:
        assert self._environment is not None
        held = self._environment.task.slot_agent.tolist()
        return np.array([held.index(self._index(name)) for name in names], dtype=np.int64)

    def _seen(
        self, names: list[str], outcomes: dict[str, int], slots: NDArray[np.int64] | None = None
    ) -> dict[str, Seen]:
        """What agents see, also those whose run has just ended, from the slots that they were in."""
        assert self._environment is not None
        slots = self._slots(names) if slots is None else slots
        observer = self.settings.observer
        seen = observer(self._environment.task.final_observation(), slots)
        return {name: bare(observer.ended(row_of(seen, row), outcomes.get(name, -1))) for row, name in enumerate(names)}

    def _info(self, name: str, outcome: int = -1) -> dict[str, Any]:
        assert self._environment is not None
        person = int(self._environment.task.cast.agent_person[self._index(name)])
        ended = {"outcome": Outcome(outcome).name.lower()} if outcome >= 0 else {}
        return {"draw": self._draw, "person": person, **ended}
