"""The loop of one episode."""

import hashlib
from collections.abc import Callable, Iterator
from math import inf

import numpy as np
from dm_control.rl import control
from numpy.typing import NDArray

from socialnav_mj.cast import NOBODY
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Controller, Limits, controller_config
from socialnav_mj.controllers.base import neighbours_of
from socialnav_mj.episode import Array, Episode
from socialnav_mj.parting import Parting
from socialnav_mj.parts import PART
from socialnav_mj.provenance import episode_metadata
from socialnav_mj.recorder import Recorder

_PROGRESS_PERIOD = 25


def rollout(
    environment: control.Environment,
    controller: Controller,
    *,
    scenario_name: str = "",
    progress: Callable[[float], None] | None = None,
) -> Episode:
    """Run one episode from its start to its end.

    Args:
        environment: Of `socialnav_mj.load`.
        controller: Commands every agent.
        scenario_name: Kept in the episode's metadata.
        progress: Called now and then with the simulated time that has passed [s].

    Returns:
        Record of all agents; its `metadata["state_hash"]` is the SHA-256 of the simulated state of all agents under way
        at every control step, whatever the size of the pool.

    Raises:
        PhysicsError: If the simulation became invalid.
        ValueError: If the controller's action, active policy or scores are not allowed.
    """
    (episode,) = rollout_in_parts(environment, controller, scenario_name=scenario_name, progress=progress)
    return episode


def rollout_in_parts(
    environment: control.Environment,
    controller: Controller,
    *,
    seconds: float = inf,
    scenario_name: str = "",
    progress: Callable[[float], None] | None = None,
) -> Iterator[Episode]:
    """Run one episode from its start to its end, and give its record in parts, each when it is complete.

    No bit of what is simulated depends on the parts, and no more than a part is ever kept.

    Args:
        environment: As for `rollout`.
        controller: As for `rollout`.
        seconds: Length of a part at least, see `socialnav_mj.parting`; by default there is one, without an end [s].
        scenario_name: As for `rollout`.
        progress: As for `rollout`.

    Yields:
        Records; the state hash of each is of all control steps from the episode's first to the record's last.

    Raises:
        PhysicsError: If the simulation became invalid.
        ValueError: If the controller's action, active policy or scores are not allowed.
    """
    task, physics = environment.task, environment.physics
    scenario: Scenario = task.scenario
    configuration = controller_config(controller)  # before anything adds to its attributes
    controller.reset(Limits.of(scenario), seed=scenario.seed)
    task.neighbours = neighbours_of(controller)
    recorder, parting = Recorder(task), Parting(task.cast, length=seconds / scenario.control_timestep)
    digest = hashlib.sha256()
    time_step = environment.reset()
    recorder.note_sample()

    def episode(*, is_last: bool) -> Episode:
        part = parting.cut(task.step, spawn=task.spawn_step, end=task.end_step, is_last=is_last)
        said = {} if seconds == inf else {PART: part.metadata(seconds, task.cast)}
        return recorder.episode(
            part,
            policies=_policies(controller),
            metadata=episode_metadata(
                task.recording,
                scenario,
                controller=controller.name,
                controller_config=configuration,
                scenario_name=scenario_name,
                steps=task.step,
                state_hash=digest.copy().hexdigest(),
                **said,
            ),
        )

    while not time_step.last():
        action = np.asarray(controller.act(time_step.observation), dtype=float)
        agent = task.slot_agent
        time_step = environment.step(action)
        scores = _checked_scores(controller, agent != NOBODY)
        recorder.note_action(agent, action, _checked_policy(controller, len(agent)), scores)
        recorder.note_sample()
        digest.update(physics.state(np.flatnonzero(task.slot_agent != NOBODY)).tobytes())
        if progress is not None and task.step % _PROGRESS_PERIOD == 0:
            progress(task.time)
        if parting.is_due(task.step, task.end_step) and not time_step.last():
            yield episode(is_last=False)
    yield episode(is_last=True)


def _policies(controller: Controller) -> tuple[str, ...]:
    return tuple(getattr(controller, "policies", (controller.name,)))


def _checked_policy(controller: Controller, n_slots: int) -> NDArray[np.int64]:
    policy = getattr(controller, "active_policy", None)
    if policy is None:
        return np.zeros(n_slots, dtype=np.int64)
    policy, names = np.asarray(policy), _policies(controller)
    known = policy.dtype.kind in "biu" and policy.shape == (n_slots,)
    if not known or (n_slots and not 0 <= policy.min() <= policy.max() < len(names)):
        raise ValueError(
            f"active_policy = {policy} of controller {controller.name!r}; expected shape ({n_slots},) with indices "
            f"into its policies {names}"
        )
    return policy.astype(np.int64)


def _checked_scores(controller: Controller, active: NDArray[np.bool_]) -> Array | None:
    scores = getattr(controller, "scores", None)
    if scores is None:
        return None
    shape = (len(active), len(_policies(controller)))
    if np.shape(scores) != shape or not (np.abs(np.asarray(scores)[active]) <= np.finfo(np.float32).max).all():
        raise ValueError(
            f"scores = {scores} of controller {controller.name!r}; expected shape {shape}, a number for each of its "
            f"policies {_policies(controller)}, finite in single precision for each agent under way"
        )
    return np.asarray(scores, dtype=float)
