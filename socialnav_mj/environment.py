"""From keyword arguments to a scenario, and from a scenario to a dm_control environment."""

from functools import partial
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal

import numpy as np
from dm_control.rl import control
from dm_env import specs

from socialnav_mj.config import Scenario
from socialnav_mj.episode import IntArray
from socialnav_mj.physics import Physics
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.robot_files import robot_settings
from socialnav_mj.scene import build_model
from socialnav_mj.task import CrowdTask


class Environment(control.Environment):
    """A dm_control environment with one reward a slot; dm_control's own specifies a single number."""

    def reward_spec(self) -> specs.Array:
        """One reward a slot.

        Returns:
            Shape (n_slots,), float64, without bounds.
        """
        return self.task.reward_spec(self.physics)


def make_environment(
    scenario: Scenario | None = None,
    *,
    dataset: str | Path | Recording = "plaza",
    variant: str | None = None,
    data_dir: str | Path | None = None,
    robot: str | Path | None = None,
    time_limit: float = float("inf"),
    random: int | np.random.RandomState | None = None,
    environment_kwargs: dict[str, Any] | None = None,
    **changes: Any,
) -> Environment:
    """A scenario on a recording as a dm_control environment.

    Args:
        scenario: Settings that `changes` start from; None for the defaults of `Scenario`.
        dataset: Name in the catalogue, path of a recording, or a recording.
        variant: Which annotation of the recording; None is the default one.
        data_dir: Where recordings are looked for first; None means SOCIALNAV_MJ_DATA, then the user cache.
        robot: Name of a shipped robot, or path of an MJCF file with its limits in a TOML beside it; None for that of
            the settings.
        time_limit: The episode is cut after this time; by default it ends when the last agent's run has [s].
        random: An integer is another name for the setting `seed`. A generator is kept by the task, which draws nothing.
        environment_kwargs: Passed to `dm_control.rl.control.Environment`.
        **changes: Settings that differ: any field of `socialnav_mj.config.Scenario`, such as share=0.3, seed=4 or
            goal_radius=0.3, and any of `Robot` as robot_radius=0.2, robot_model="mine.xml".

    Returns:
        An environment whose task is a `CrowdTask` and whose physics is a `Physics`.

    Raises:
        ValueError: If a setting is unknown or a value not allowed, or seed and an integer random are both given.
        FileNotFoundError: If the recording is not there.
    """
    if isinstance(random, Integral):
        if "seed" in changes:
            raise ValueError(
                f"seed = {changes['seed']} and random = {random} are both given; they name the same thing, give one"
            )
        changes["seed"] = random
    if not (isinstance(time_limit, Real) and time_limit > 0.0):
        raise ValueError(f"time_limit = {time_limit!r} is not allowed; allowed: numbers > 0")
    of_robot = {} if robot is None else robot_settings(robot)
    scenario = (scenario or Scenario()).changed(**{**of_robot, **changes})
    recording = (
        dataset if isinstance(dataset, Recording) else load_recording(dataset, variant=variant, data_dir=data_dir)
    )
    return build_environment(
        recording, scenario, time_limit=time_limit, random=random, environment_kwargs=environment_kwargs
    )


def build_environment(
    recording: Recording,
    scenario: Scenario,
    *,
    time_limit: float = float("inf"),
    random: int | np.random.RandomState | None = None,
    environment_kwargs: dict[str, Any] | None = None,
    robots: int | Literal["all", "likely"] = "all",
    replaced: IntArray | None = None,
) -> Environment:
    """A dm_control environment of a recording that is at hand and a scenario that is final.

    Args:
        recording: Whose people are replaced and replayed; floor and cameras are centred on it.
        scenario: Decides everything else.
        time_limit: The episode is cut after this time [s].
        random: Kept by the task, which draws nothing from it.
        environment_kwargs: Passed to `dm_control.rl.control.Environment`.
        robots: How many are built at first: one for each slot, as many as are likely to be in the scene at once, or a
            number >= 1. When a slot beyond them is used, the scene is compiled anew with more. Only "all" has the parts
            that are for the eye alone. No bit of an episode depends on it, but who holds on to the model, as
            dm_control's viewer does, must not see it change.
        replaced: Indices of the people who become agents, ascending; those of the scenario's draw by default.

    Returns:
        An environment whose task is a `CrowdTask` and whose physics is a `Physics`.
    """
    task = CrowdTask(recording, scenario, random=random, replaced=replaced)
    everywhere = np.concatenate(recording.positions)
    build = partial(
        build_model,
        scenario,
        n_agent_slots=task.cast.n_agent_slots,
        n_pedestrian_slots=task.cast.n_pedestrian_slots,
        low=everywhere.min(axis=0),
        high=everywhere.max(axis=0),
        is_drawn=robots == "all",
    )
    sizes = {"all": task.cast.n_agent_slots, "likely": task.cast.n_likely_agents}
    count = robots if isinstance(robots, int) else sizes[robots]
    return Environment(
        Physics.from_mujoco(build(n_robots=count), build=lambda n: build(n_robots=n)),
        task,
        control_timestep=scenario.control_timestep,
        time_limit=time_limit,
        **(environment_kwargs or {}),
    )
