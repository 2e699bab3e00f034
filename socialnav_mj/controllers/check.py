"""Whether a controller keeps the protocol, tried on made-up observations without a simulator."""

import traceback
from collections.abc import Iterator

import numpy as np

from socialnav_mj.config import Scenario
from socialnav_mj.controllers.base import Controller, Limits, Observation
from socialnav_mj.controllers.specs import controller_config
from socialnav_mj.geometry import Array
from socialnav_mj.observation import observe


class ProtocolError(ValueError):
    """A controller does not keep the protocol; says how, and in which scene."""


def check_controller(controller: Controller, *, seed: int = 0) -> None:
    """Run a controller on observations of an empty, a lonely, a crowded and a degenerate scene.

    Args:
        controller: As it would be evaluated; it is reset.
        seed: Seed of the made-up scenes, and the one that `reset` is given.

    Raises:
        ProtocolError: If something is wrong; says what, in which scene, and what is expected.
    """
    limits = Limits.of(Scenario())
    if not isinstance(controller, Controller) or not isinstance(controller.name, str) or not controller.name:
        raise ProtocolError(f"{type(controller).__name__} lacks reset, act, or a name that is a string and not empty")
    controller_config(controller)
    actions = []
    for _ in range(2):
        controller.reset(limits, seed=seed)
        actions.append([_checked_action(controller, scene, seen) for scene, seen in _scenes(seed)])
    for (scene, _), one, two in zip(_scenes(seed), *actions, strict=True):
        if not np.array_equal(one, two):
            raise ProtocolError(f"in the {scene} scene, after a reset with the same seed, act returns something else")


def try_controller(controller: Controller, scenario: Scenario) -> None:
    """Run a controller once on made-up observations, so that a slip in it is found before anything is simulated.

    Args:
        controller: As it would be evaluated; it is reset.
        scenario: Whose limits it is given.

    Raises:
        ValueError: If it fails, or returns no finite wheel speeds; says where.
    """
    scene = "empty"
    try:
        controller.reset(Limits.of(scenario), seed=scenario.seed)
        for scene, seen in _scenes(scenario.seed):
            if scene != "degenerate":
                _checked_action(controller, scene, seen)
    except ProtocolError as error:
        raise ValueError(f"controller {controller.name!r}, tried before anything is run: {error}") from error
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        raise ValueError(
            f"controller {controller.name!r}, tried before anything is run, fails in the {scene} scene: "
            f"{type(error).__name__}: {error} ({frame.filename}:{frame.lineno})"
        ) from error


def _checked_action(controller: Controller, scene: str, observation: Observation) -> Array:
    given = {key: value.copy() for key, value in observation.items()}
    returned = controller.act(observation)
    active = given["active"]
    shape = (len(active), 2)
    try:
        action = np.array(returned, dtype=float)
    except (TypeError, ValueError):
        raise ProtocolError(
            f"in the {scene} scene, act returns a {type(returned).__name__}; expected an array of shape {shape}"
        ) from None
    if action.shape != shape:
        raise ProtocolError(f"in the {scene} scene, act returns shape {action.shape}; expected {shape}: (left, right)")
    if not np.isfinite(action[active]).all():
        raise ProtocolError(
            f"in the {scene} scene, act returns {action[active].tolist()}; expected finite wheel speeds"
        )
    if changed := [key for key, value in observation.items() if not np.array_equal(value, given[key])]:
        raise ProtocolError(
            f"in the {scene} scene, act changes observation[{changed[0]!r}]; expected it to be only read"
        )
    policies = tuple(getattr(controller, "policies", (controller.name,)))
    policy = getattr(controller, "active_policy", None)
    if policy is not None and (
        np.shape(policy) != shape[:1] or not np.isin(np.asarray(policy)[active], np.arange(len(policies))).all()
    ):
        raise ProtocolError(
            f"in the {scene} scene, active_policy is {policy}; expected shape {shape[:1]} with indices into {policies}"
        )
    scores = getattr(controller, "scores", None)
    expected = (*shape[:1], len(policies))
    if scores is not None and (np.shape(scores) != expected or not np.isfinite(np.asarray(scores)[active]).all()):
        raise ProtocolError(
            f"in the {scene} scene, scores is {scores}; expected shape {expected}, finite for active agents"
        )
    action[~active] = 0.0
    return action


def _scenes(seed: int) -> Iterator[tuple[str, Observation]]:
    random = np.random.default_rng(seed)
    yield "empty", _observation(np.zeros((4, 2)), np.zeros((4, 2)), np.zeros((3, 2)), active=0, present=0)
    yield "lonely", _observation(np.zeros((4, 2)), np.full((4, 2), 5.0), np.zeros((3, 2)), active=1, present=0)
    for _ in range(5):
        places = random.uniform(-3.0, 3.0, (3, 12, 2))
        yield "crowded", _observation(*places, active=10, present=9)
    # Everybody at the same place, nobody moves, and the goal is there too.
    yield "degenerate", _observation(np.zeros((4, 2)), np.zeros((4, 2)), np.zeros((3, 2)), active=4, present=3)


def _observation(position: Array, goal: Array, crowd: Array, *, active: int, present: int) -> Observation:
    """Agents at positions, people who walk towards the origin; the first so many of each are there."""
    n = len(position)
    moving = not np.array_equal(position, goal)
    heading = np.arctan2(goal[:, 1], goal[:, 0])
    return observe(
        active=np.arange(n) < active,
        person=np.arange(n),
        position=position,
        heading=heading,
        velocity=0.5 * moving * np.stack([np.cos(heading), np.sin(heading)], axis=1),
        yaw_rate=np.zeros(n),
        goal=goal,
        pedestrian_position=crowd,
        pedestrian_velocity=-0.3 * crowd,
        pedestrian_slots=np.arange(present),
    )
