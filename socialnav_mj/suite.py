"""The four scenarios of the paper as a dm_control domain.

`load("scenario_1")` returns an environment; after `register_with_dm_control()` so does
`dm_control.suite.load("socialnav", "scenario_1")`. All keyword arguments of
`socialnav_mj.environment.make_environment` can be given, as keywords or in `task_kwargs`. The top-level package `tasks`
shows the same names.
"""

import inspect
from typing import Any

from dm_control.rl import control

# dm_control.utils.containers cannot be the first import of dm_control.
from dm_control.utils import containers

from socialnav_mj.config import SETTINGS, SHARES
from socialnav_mj.environment import make_environment

DOMAIN = "socialnav"
SUITE = containers.TaggedTasks()


@SUITE.add("benchmarking", "no_reward_visualization")
def scenario_1(**task_kwargs: Any) -> control.Environment:
    """10 % of the people are replaced by robots, a few robots in a crowd of people (paper section IV)."""
    return make_environment(**{"share": SHARES["scenario_1"], **task_kwargs})


@SUITE.add("benchmarking", "no_reward_visualization")
def scenario_2(**task_kwargs: Any) -> control.Environment:
    """30 % of the people are replaced by robots (paper section IV)."""
    return make_environment(**{"share": SHARES["scenario_2"], **task_kwargs})


@SUITE.add("benchmarking", "no_reward_visualization")
def scenario_3(**task_kwargs: Any) -> control.Environment:
    """70 % of the people are replaced by robots (paper section IV)."""
    return make_environment(**{"share": SHARES["scenario_3"], **task_kwargs})


@SUITE.add("benchmarking", "no_reward_visualization")
def scenario_4(**task_kwargs: Any) -> control.Environment:
    """90 % of the people are replaced by robots, many robots among a few people (paper section IV)."""
    return make_environment(**{"share": SHARES["scenario_4"], **task_kwargs})


ALL_TASKS: tuple[str, ...] = tuple(SUITE)


def load(
    task_name: str,
    task_kwargs: dict[str, Any] | None = None,
    environment_kwargs: dict[str, Any] | None = None,
    visualize_reward: bool = False,
    **keywords: Any,
) -> control.Environment:
    """Environment of a scenario.

    Args:
        task_name: One of `ALL_TASKS`.
        task_kwargs: Keyword arguments of `socialnav_mj.environment.make_environment`.
        environment_kwargs: Keyword arguments of `dm_control.rl.control.Environment`.
        visualize_reward: As in `dm_control.suite.load`; these tasks colour nothing by reward.
        **keywords: More of `task_kwargs`, such as seed=1.

    Returns:
        A dm_control environment.

    Raises:
        ValueError: If the task or a keyword is unknown or given twice, or a value not allowed.
    """
    if task_name not in SUITE:
        raise ValueError(f"unknown task {task_name!r}; available: {', '.join(ALL_TASKS)}")
    own = inspect.signature(make_environment).parameters.values()
    allowed = [parameter.name for parameter in own if parameter.kind is not parameter.VAR_KEYWORD]
    allowed = [*SETTINGS, *(name for name in allowed if name != "environment_kwargs")]
    task_kwargs = task_kwargs or {}
    if unknown := sorted({*task_kwargs, *keywords} - {*allowed}):
        raise ValueError(f"unknown task_kwargs {', '.join(unknown)}; available: {', '.join(allowed)}")
    if twice := sorted({*task_kwargs} & {*keywords}):
        raise ValueError(f"{', '.join(twice)} given twice, in task_kwargs and as a keyword; give it once")
    environment = SUITE[task_name](**task_kwargs, **keywords, environment_kwargs=environment_kwargs)
    environment.task.visualize_reward = visualize_reward
    return environment


def register_with_dm_control() -> None:
    """Make `dm_control.suite.load("socialnav", ...)` find these tasks."""
    import sys

    from dm_control import suite

    domain = sys.modules[__name__]
    suite._DOMAINS[DOMAIN] = domain
    suite.TASKS_BY_DOMAIN[DOMAIN] = ALL_TASKS
    missing = tuple((DOMAIN, name) for name in ALL_TASKS if (DOMAIN, name) not in suite.ALL_TASKS)
    suite.ALL_TASKS += missing
    suite.BENCHMARKING += missing
    suite.NO_REWARD_VIZ += missing
