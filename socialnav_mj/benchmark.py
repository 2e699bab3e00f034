"""What an episode costs beside the bare physics: measured side by side in one run, as ratios."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from math import ceil
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import mujoco
import numpy as np
from dm_control.rl import control

from socialnav_mj.config import SHARES, Pedestrians, Scenario
from socialnav_mj.controllers import Limits, make_controller
from socialnav_mj.crowd import ReactingCrowd
from socialnav_mj.environment import build_environment, make_environment
from socialnav_mj.physics import Physics
from socialnav_mj.recordings import Recording
from socialnav_mj.rollout import rollout


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Median CPU times of one scenario, and their ratios within each repetition."""

    scenario: str
    n_agents: int
    simulated_time: float
    """[s]"""
    episode_cpu: float
    """From reset to the finished `Episode`: physics, contacts, observation, controller, record [s]."""
    episode_cpus: tuple[float, ...]
    """Of each repetition [s]."""
    physics_cpu: float
    """Bare `mj_step` calls from the same states, in a scene with no more robots than were in use at once [s]."""
    physics_cpus: tuple[float, ...]
    """Of each repetition [s]."""
    n_slots: int
    """Agents that deadlines let be in the scene at once."""
    n_robots: int
    """Robots that the episode's scene was built with."""
    n_used: int
    """Of them in use at once, at most; with as many the bare steps are made."""
    ratio: float
    """episode_cpu / physics_cpu, the median over repetitions."""
    ratio_low: float
    """The least of them."""
    ratio_high: float
    """The greatest."""
    parked_ratio: float
    """Bare `mj_step` calls of the scene as it was built, robots parked in it, over physics_cpu; the median."""
    reaction_ratio: float
    """What people who react take besides their replay, over physics_cpu; the median. 0 if nobody does."""
    real_time_factor: float
    """simulated_time / episode_cpu."""
    save_share: float
    """CPU time of saving the episode / episode_cpu."""
    trace_share: float
    """CPU time of writing the trace / episode_cpu, without importing rerun."""
    trace_megabytes: float
    """Size of the trace."""


def measure(
    recording: Recording,
    scenario: str,
    *,
    controller: str,
    pedestrians: Pedestrians = Scenario.pedestrians,
    seed: int = 0,
    repetitions: int = 3,
) -> Cost:
    """Cost of one scenario on one core.

    Bare steps are taken from the episode's own states: before each control step the state, the commands and the slots'
    contacts are set as they were, and only the `mj_step` calls are timed.

    Args:
        recording: Crowd in which the episodes are run.
        scenario: Name of a task.
        controller: As `make_controller` takes it.
        pedestrians: Whether people react, as in `Scenario`.
        seed: Seed of the draw.
        repetitions: Episodes and bare runs, in turn.

    Returns:
        CPU times of episode and bare physics, their ratio, and what saving and tracing add to it.
    """
    from socialnav_mj.trace.writer import write_trace  # rerun is slow to import and not needed elsewhere

    setting = Scenario(share=SHARES[scenario], seed=seed, pedestrians=pedestrians)
    environment = build_environment(recording, setting, robots="likely")
    whole_states = _record_states(environment, controller)
    n_used = max(state["n_used"] for state in whole_states)
    bare = build_environment(recording, setting, robots=n_used)
    states = _record_states(bare, controller)
    episode_times, physics_times, whole_times, reaction_times, save_times, trace_times = [], [], [], [], [], []
    crowd = environment.task.crowd
    is_reacting = isinstance(crowd, ReactingCrowd)
    reacting = _clock(crowd, "react", "motion", "crowd") if is_reacting else []
    replaying = _clock(crowd.replay, "motion", "crowd") if is_reacting else []
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.rrd"
        write_trace(rollout(environment, make_controller(controller)), trace)  # warms everything up
        for _ in range(repetitions):
            reacting.clear()
            replaying.clear()
            begin = process_time()
            episode = rollout(environment, make_controller(controller), scenario_name=scenario)
            episode_times.append(process_time() - begin)
            reaction_times.append(sum(reacting) - sum(replaying))
            physics_times.append(_time_bare_steps(bare, states))
            whole_times.append(_time_bare_steps(environment, whole_states))
            begin = process_time()
            episode.save(Path(folder) / "episode.npz")
            save_times.append(process_time() - begin)
            begin = process_time()
            write_trace(episode, trace)
            trace_times.append(process_time() - begin)
        size = trace.stat().st_size / 1e6
    ratios = [e / p for e, p in zip(episode_times, physics_times, strict=True)]
    return Cost(
        scenario=scenario,
        n_agents=episode.n_agents,
        simulated_time=float(episode.time[-1]),
        episode_cpu=median(episode_times),
        episode_cpus=tuple(episode_times),
        physics_cpu=median(physics_times),
        physics_cpus=tuple(physics_times),
        n_slots=environment.physics.n_agents,
        n_robots=environment.physics.model.nu // 2,
        n_used=n_used,
        ratio=median(ratios),
        ratio_low=min(ratios),
        ratio_high=max(ratios),
        parked_ratio=median(w / p for w, p in zip(whole_times, physics_times, strict=True)),
        reaction_ratio=median(r / p for r, p in zip(reaction_times, physics_times, strict=True)),
        real_time_factor=float(episode.time[-1]) / median(episode_times),
        save_share=median(s / e for s, e in zip(save_times, episode_times, strict=True)),
        trace_share=median(t / e for t, e in zip(trace_times, episode_times, strict=True)),
        trace_megabytes=size,
    )


def _clock(owner: object, *methods: str) -> list[float]:
    """Time every call of an object's methods from now on; the list gets the CPU times [s]."""
    times: list[float] = []

    def timed(method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def call(*args: Any, **kwargs: Any) -> Any:
            begin = process_time()
            result = method(*args, **kwargs)
            times.append(process_time() - begin)
            return result

        return call

    for name in methods:
        setattr(owner, name, timed(getattr(owner, name)))
    return times


@dataclass(frozen=True, kw_only=True)
class ControllerCost:
    """What a controller's own computation costs beside the physics that it drives."""

    controller: str
    n_agents: float
    """Agents under way, the mean over control steps."""
    act_cpu: float
    """CPU time of `act` for an agent and control step, the median over repetitions [s]."""
    act_cpus: tuple[float, ...]
    """Of each repetition [s]."""
    physics_cpu: float
    """Of bare `mj_step` calls, from the states that it led to, for an agent and control step, the median [s]."""
    physics_cpus: tuple[float, ...]
    """Of each repetition [s]."""
    ratio: float
    """act_cpu / physics_cpu, the median of the ratios within each repetition."""
    ratio_low: float
    """The least of them."""
    ratio_high: float
    """The greatest."""


def measure_controllers(
    controllers: Sequence[str],
    *,
    n_agents: int = 60,
    n_pedestrians: int = 60,
    control_steps: int = 40,
    repetitions: int = 3,
) -> list[ControllerCost]:
    """Cost of controllers for as many agents at once, in a made-up crowd as dense as students003.

    Args:
        controllers: As `make_controller` takes them.
        n_agents: All under way from the first step to the last.
        n_pedestrians: All there as long.
        control_steps: Length of an episode.
        repetitions: Episodes and bare runs of each controller, in turn.

    Returns:
        A row for each controller.
    """
    crowd = _crossing_crowd(n_agents + n_pedestrians)
    share = n_agents / (n_agents + n_pedestrians)
    result = []
    for spec in controllers:
        limit = (control_steps - 0.5) * 0.2
        environment = make_environment(dataset=crowd, share=share, time_limit=limit)
        _record_states(environment, spec)  # compiles and loads what the controller needs
        acts, bare, active = [], [], 0
        for _ in range(repetitions):
            states = _record_states(environment, spec)
            active = sum(state["active"] for state in states)
            acts.append(sum(state["act_cpu"] for state in states) / active)
            bare.append(_time_bare_steps(environment, states) / active)
        ratios = [act / step for act, step in zip(acts, bare, strict=True)]
        result.append(
            ControllerCost(
                controller=spec,
                n_agents=active / len(states),
                act_cpu=median(acts),
                act_cpus=tuple(acts),
                physics_cpu=median(bare),
                physics_cpus=tuple(bare),
                ratio=median(ratios),
                ratio_low=min(ratios),
                ratio_high=max(ratios),
            )
        )
    return result


def _crossing_crowd(n_people: int) -> Recording:
    """People on a grid, 2.5 m apart, who all start at once and cross each other's ways for 20 m at 1 m/s."""
    random = np.random.default_rng(0)
    side = ceil(n_people**0.5)
    place = 2.5 * np.stack(np.divmod(np.arange(n_people), side), axis=1) + random.uniform(-0.8, 0.8, (n_people, 2))
    # Across the middle, so that nobody leaves the crowd at once.
    centre = place.mean(axis=0)
    towards = centre + random.uniform(-4.0, 4.0, (n_people, 2)) - place
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    times = np.array([0.0, 10.0, 20.0])
    return Recording(
        name="crossing",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(1, n_people + 1),
        times=(times,) * n_people,
        positions=tuple(here + times[:, None] * way for here, way in zip(place, towards, strict=True)),
        checksum="0" * 64,
    )


_DATA_FIELDS = ("qpos", "qvel", "qacc_warmstart", "ctrl", "mocap_pos", "mocap_quat")
_MODEL_FIELDS = ("geom_contype", "geom_conaffinity", "body_gravcomp")


def _record_states(environment: control.Environment, controller_name: str) -> list[dict[str, Any]]:
    """What distinguishes the control steps of an episode, copied just before the physics of each, and act's cost."""
    physics: Physics = environment.physics
    controller = make_controller(controller_name)
    controller.reset(Limits.of(environment.task.scenario), seed=environment.task.scenario.seed)
    states = []
    time_step = environment.reset()
    while not time_step.last():
        begin = process_time()
        action = controller.act(time_step.observation)
        act_cpu = process_time() - begin
        state: dict[str, Any] = {name: getattr(physics.data.ptr, name).copy() for name in _DATA_FIELDS}
        state |= {name: getattr(physics.model.ptr, name).copy() for name in _MODEL_FIELDS}
        active = np.flatnonzero(time_step.observation["active"])
        state |= {"act_cpu": act_cpu, "active": len(active), "n_used": int(active.max(initial=0)) + 1}
        time_step = environment.step(action)
        state["ctrl"] = physics.data.ctrl.copy()
        states.append(state)
    return states


def _time_bare_steps(environment: control.Environment, states: list[dict[str, Any]]) -> float:
    physics: Physics = environment.physics
    model, data = physics.model.ptr, physics.data.ptr
    n_sub_steps = environment.task.scenario.n_sub_steps
    total = 0.0
    for state in states:
        for name in _DATA_FIELDS:
            np.copyto(getattr(data, name), state[name])
        for name in _MODEL_FIELDS:
            np.copyto(getattr(model, name), state[name])
        begin = process_time()
        mujoco.mj_step(model, data, n_sub_steps)
        total += process_time() - begin
    return total
