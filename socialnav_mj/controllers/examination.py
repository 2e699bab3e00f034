"""Does a controller keep what every built-in one promises? Tried on made-up walks, with the input that says no."""

import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.controllers.base import Controller, Limits, Observation
from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import Array, twist_of_wheel_speed
from socialnav_mj.observation import observe

STEPS = 4
"""Control steps of a walk; the first moves are from one to the next."""
TIMED_STEPS = 10
TIMED_AGENTS = 60
"""Agents, and as many pedestrians, of the walk that is timed; about scenario 3 of students003 at its fullest."""
SAME_ORDER, SAME_FRAME = 1e-9, 1e-6
"""By how much wheel speeds may differ when agents are counted otherwise, and when the world is turned [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """The answer to one question."""

    question: str
    passed: bool
    told: str
    """What was found; empty for a plain yes."""
    observation: dict[str, NDArray[np.generic]] | None = None
    """The input that says no."""


class _BrokenError(Exception):
    def __init__(self, told: str, observation: Observation | None = None, *, raised: bool = False) -> None:
        super().__init__(told)
        self.raised = raised
        """Whether the controller itself raised an exception."""
        self.observation = None if observation is None else {key: value.copy() for key, value in observation.items()}


@dataclass(frozen=True, kw_only=True)
class _Walk:
    """Agents and people who walk on, whatever the agents are told; n slots of agents and m of people."""

    name: str
    position: Array
    heading: Array
    speed: Array
    yaw_rate: Array
    goal: Array
    people: Array
    people_velocity: Array
    agents: NDArray[np.int64]
    pedestrians: NDArray[np.int64]

    @classmethod
    def made(cls, name: str, random: np.random.Generator, *, n: int = 5, m: int = 7, side: float = 3.0) -> "_Walk":
        return cls(
            name=name,
            position=random.uniform(-side, side, (n, 2)),
            heading=random.uniform(-np.pi, np.pi, n),
            speed=random.uniform(0.0, 1.0, n),
            yaw_rate=random.uniform(-1.0, 1.0, n),
            goal=random.uniform(-2.0 * side, 2.0 * side, (n, 2)),
            people=random.uniform(-side, side, (m, 2)),
            people_velocity=random.normal(0.0, 0.7, (m, 2)),
            agents=np.arange(n),
            pedestrians=np.arange(m),
        )

    def observations(self, steps: int = STEPS) -> Iterator[Observation]:
        for k in range(steps):
            time = 0.2 * k
            heading = self.heading + time * self.yaw_rate
            velocity = self.speed[:, None] * np.stack([cos(heading), sin(heading)], axis=1)
            yield observe(
                active=np.isin(np.arange(len(heading)), self.agents),
                person=np.arange(len(heading)) + 100,
                position=self.position + time * velocity,
                heading=heading,
                velocity=velocity,
                yaw_rate=self.yaw_rate,
                goal=self.goal,
                pedestrian_position=self.people + time * self.people_velocity,
                pedestrian_velocity=self.people_velocity,
                pedestrian_slots=self.pedestrians,
            )

    def counted(self, agents: NDArray[np.int64], people: NDArray[np.int64]) -> "_Walk":
        own = {name: getattr(self, name)[agents] for name in ("position", "heading", "speed", "yaw_rate", "goal")}
        others = {name: getattr(self, name)[people] for name in ("people", "people_velocity")}
        return replace(self, **own, **others)

    def moved(self, turn: float, shift: tuple[float, float]) -> "_Walk":
        c, s = cos([turn])[0], sin([turn])[0]

        def turned(vector: Array) -> Array:
            return np.stack([c * vector[:, 0] - s * vector[:, 1], s * vector[:, 0] + c * vector[:, 1]], axis=1)

        places: dict[str, Any] = {name: turned(getattr(self, name)) + shift for name in ("position", "goal", "people")}
        return replace(self, **places, heading=self.heading + turn, people_velocity=turned(self.people_velocity))


def _walks(seed: int) -> tuple[_Walk, ...]:
    random = np.random.default_rng(seed)
    nobody = np.arange(0)
    plain = _Walk.made("alone", random)
    place = np.zeros((5, 2))
    return (
        _Walk.made("crowd", random),
        _Walk.made("throng", random, n=20, m=40, side=1.0),
        replace(plain, pedestrians=nobody, agents=np.arange(1)),
        replace(_Walk.made("no agents", random), agents=nobody),
        replace(
            _Walk.made("all at one place, and at their goals", random),
            position=place,
            goal=place,
            people=np.zeros((7, 2)),
            people_velocity=np.zeros((7, 2)),
            speed=np.zeros(5),
        ),
        replace(_Walk.made("thrown", random), speed=np.full(5, 4.0), yaw_rate=np.full(5, -9.0)),
    )


def examine(make: Callable[[], Controller], *, seed: int = 0) -> Iterator[Finding]:
    """Ask a controller all questions.

    Args:
        make: Makes a new one.
        seed: Of the walks, and what `reset` is given.

    Yields:
        A finding for each question, in the order of a table; it ends with the first at which the controller raised.
    """
    walks, limits = _walks(seed), Limits.of(Scenario())

    def run(walk: _Walk, controller: Controller | None = None, steps: int = STEPS) -> Array:
        return _actions(controller or make(), walk, limits, seed, steps)

    def shapes() -> str:
        for walk in walks:
            run(walk)
        return ""

    def finite() -> str:
        for walk in walks:
            _require(walk, np.all(np.isfinite(run(walk)), axis=-1), run(walk), "finite wheel speeds")
        return ""

    def within() -> str:
        for walk in walks:
            found = run(walk)
            twist = twist_of_wheel_speed(found, wheel_radius=limits.wheel_radius, track=limits.track)
            forward = (twist[..., 0] >= -1e-9) & (twist[..., 0] <= limits.max_speed + 1e-9)
            holds = forward & (np.abs(twist[..., 1]) <= limits.max_yaw_rate + 1e-9) | ~np.isfinite(twist).all(axis=-1)
            allowed = f"0 to {limits.max_speed:g} m/s and up to {limits.max_yaw_rate:.3g} rad/s"
            _require(walk, holds, twist, f"(forward speed, yaw rate) of {allowed}, as Limits.wheel_speed gives them")
        return ""

    def deterministic() -> str:
        for walk in walks:
            controller = make()
            one = run(walk, controller)
            for name, again in (("the same object after a reset", controller), ("another object", make())):
                _same(walk, one, run(walk, again), 0.0, f"the same as before: {name}, the same seed")
        return ""

    def orders() -> str:
        random = np.random.default_rng(seed)
        for walk in walks[:2]:
            agents, people = random.permutation(len(walk.agents)), random.permutation(len(walk.pedestrians))
            expected = run(walk)[:, agents]
            other = walk.counted(agents, people)
            _same(
                other, expected, run(other), SAME_ORDER, "what it told the same agents when they were counted otherwise"
            )
        return ""

    def frames() -> str:
        for walk in walks[:2]:
            for turn, shift in ((2.0, (0.0, 0.0)), (-1.1, (1.0, 40.0))):
                other = walk.moved(turn, shift)
                told = f"what it told before the world was turned by {turn:g} rad and shifted by {shift} m"
                _same(other, run(walk), run(other), SAME_FRAME, told)
        return ""

    def pace() -> str:
        walk = _Walk.made("many", np.random.default_rng(seed), n=TIMED_AGENTS, m=TIMED_AGENTS, side=8.0)
        controller = make()
        run(walk, controller)  # whatever is compiled or loaded is not timed
        seen = list(walk.observations(TIMED_STEPS))
        begin = perf_counter()
        for observation in seen:
            controller.act(observation)
        spent = (perf_counter() - begin) / TIMED_STEPS / TIMED_AGENTS
        return f"{1e6 * spent:.0f} us ({TIMED_AGENTS} agents and as many pedestrians)"

    for question, answer in (
        ("takes every observation, changes none, and returns wheel speeds of shape (agents, 2)", shapes),
        ("finite", finite),
        ("within the limits", within),
        ("deterministic", deterministic),
        ("the same in every order of agents and people", orders),
        ("the same in every frame", frames),
        ("time for an agent and step", pace),
    ):
        try:
            yield Finding(question=question, passed=True, told=answer())
        except _BrokenError as no:
            told = f"{no}; the other questions were not asked" if no.raised else str(no)
            yield Finding(question=question, passed=False, told=told, observation=no.observation)
            if no.raised:
                return


def _actions(controller: Controller, walk: _Walk, limits: Limits, seed: int, steps: int) -> Array:
    """(steps, n, 2) wheel speeds; zero for inactive slots."""
    observation: Observation = {}
    found = []
    try:
        controller.reset(limits, seed=seed)
        for step, seen in enumerate(walk.observations(steps)):
            observation = {key: value.copy() for key, value in seen.items()}
            action = np.asarray(controller.act(seen), dtype=float)
            where = f"walk {walk.name!r}, step {step}"
            if action.shape != (len(seen["active"]), 2):
                raise _BrokenError(f"{where}: shape {action.shape}; expected {(len(seen['active']), 2)}", observation)
            if changed := [key for key in seen if not np.array_equal(seen[key], observation[key])]:
                raise _BrokenError(f"{where}: act changes observation[{changed[0]!r}]", observation)
            found.append(np.where(seen["active"][:, None], action, 0.0))
    except _BrokenError:
        raise
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{frame.filename}:{frame.lineno}"
        raise _BrokenError(
            f"walk {walk.name!r}: {type(error).__name__}: {error} ({place})", observation, raised=True
        ) from error
    return np.array(found)


def _require(walk: _Walk, holds: NDArray[np.bool_], found: Array, expected: str) -> None:
    """Raise with the first agent and step for which something does not hold."""
    if holds.all():
        return
    step, agent = (int(index) for index in np.argwhere(~holds)[0])
    observation = list(walk.observations(step + 1))[step]
    given = {
        "goal": observation["goal"][agent].round(3).tolist(),
        "twist": observation["twist"][agent].round(3).tolist(),
    }
    for kind in ("pedestrian", "agent"):
        near = observation[f"{kind}_position"][agent][observation[f"{kind}_mask"][agent]]
        given[f"nearest {kind}s"] = near[np.argsort(np.hypot(*near.T))][:3].round(3).tolist()
    raise _BrokenError(
        f"walk {walk.name!r}, step {step}, agent {agent}: {found[step, agent].tolist()}; expected {expected}. "
        f"It saw {', '.join(f'{key} {value}' for key, value in given.items())}",
        observation,
    )


def _same(walk: _Walk, expected: Array, found: Array, tolerance: float, told: str) -> None:
    with np.errstate(invalid="ignore"):
        near = (np.abs(found - expected) <= tolerance) | (np.isnan(found) & np.isnan(expected))
    where = np.argwhere(~near.all(axis=-1))
    text = f"{expected[tuple(where[0])].tolist()}, {told}" if len(where) else ""
    _require(walk, np.all(near, axis=-1), found, text)
