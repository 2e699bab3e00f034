"""What every built-in controller promises, tried on made-up walks: the same bits, in every frame, within the limits."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import BUILT_IN, Limits, make_controller
from socialnav_mj.controllers.check import check_controller
from socialnav_mj.geometry import twist_of_wheel_speed
from socialnav_mj.observation import observe

LIMITS = Limits.of(Scenario())
SPECS = (
    *BUILT_IN,
    "mpc(preset='calm')",
    "mpc(preset='brisk')",
    "mpc(preset='free')",
    "mpc(prediction='constant_velocity')",
)
every_controller = pytest.mark.parametrize("spec", SPECS)


@dataclass(frozen=True)
class Walks:
    """Agents and people who walk straight on, whatever the agents are told, and turn at random; with empty slots."""

    position: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    yaw_rate: np.ndarray
    goal: np.ndarray
    people: np.ndarray
    people_velocity: np.ndarray
    agents: np.ndarray
    pedestrians: np.ndarray

    @classmethod
    def made(cls, seed: int, n: int = 5, m: int = 7, side: float = 3.0) -> "Walks":
        random = np.random.default_rng(seed)
        return cls(
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

    def observations(self, steps: int = 4):
        for k in range(steps):
            t = 0.2 * k
            heading = self.heading + t * self.yaw_rate
            velocity = self.speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
            yield observe(
                active=np.isin(np.arange(len(heading)), self.agents),
                person=np.arange(len(heading)) + 100,
                position=self.position + t * velocity,
                heading=heading,
                velocity=velocity,
                yaw_rate=self.yaw_rate,
                goal=self.goal,
                pedestrian_position=self.people + t * self.people_velocity,
                pedestrian_velocity=self.people_velocity * (1.0 + 0.1 * k),
                pedestrian_slots=self.pedestrians,
            )

    def moved(self, turn: float, shift) -> "Walks":
        matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        places = {name: getattr(self, name) @ matrix.T + shift for name in ("position", "goal", "people")}
        velocity = self.people_velocity @ matrix.T
        return replace(self, **places, heading=self.heading + turn, people_velocity=velocity)


def actions(spec: str, walks: Walks, seed: int = 3, steps: int = 4) -> np.ndarray:
    controller = make_controller(spec)
    controller.reset(LIMITS, seed=seed)
    return np.array([controller.act(seen) for seen in walks.observations(steps)])


@every_controller
def test_keeps_the_protocol(spec):
    check_controller(make_controller(spec))


@every_controller
@pytest.mark.parametrize("seed", range(3))
def test_the_same_seed_gives_the_same_bits_again_and_with_another_object(spec, seed):
    walks = Walks.made(seed)
    one = actions(spec, walks)
    np.testing.assert_array_equal(actions(spec, walks), one)
    controller = make_controller(spec)
    for _ in range(2):
        controller.reset(LIMITS, seed=3)
        np.testing.assert_array_equal([controller.act(seen) for seen in walks.observations()], one)


@every_controller
@pytest.mark.parametrize("seed", range(3))
def test_whoever_is_counted_first_everybody_is_told_the_same(spec, seed):
    walks, random = Walks.made(seed), np.random.default_rng(seed)
    order, people = random.permutation(5), random.permutation(7)
    own = {name: getattr(walks, name)[order] for name in ("position", "heading", "speed", "yaw_rate", "goal")}
    others = {name: getattr(walks, name)[people] for name in ("people", "people_velocity")}
    found = actions(spec, replace(walks, **own, **others))
    np.testing.assert_allclose(found, actions(spec, walks)[:, order], atol=1e-9)


@every_controller
@pytest.mark.parametrize("seed", range(3))
def test_a_turned_and_shifted_world_gives_the_same_wheel_speeds(spec, seed):
    walks = Walks.made(seed)
    for turn, shift in ((0.0, [7.0, -3.0]), (2.0, [0.0, 0.0]), (-1.1, [1.0, 40.0])):
        found = actions(spec, walks.moved(turn, shift))
        np.testing.assert_allclose(found, actions(spec, walks), atol=1e-6)


@every_controller
def test_nobody_out_of_sight_changes_anything(spec):
    """Agent 4 and the people 5 and 6 are 100 m away, or are not there at all, from the beginning."""
    walks = Walks.made(1)
    far = replace(walks, position=walks.position.copy(), people=walks.people.copy())
    far.position[4] += 100.0
    far.people[5:] += 100.0
    alone = replace(walks, agents=np.arange(4), pedestrians=np.arange(5))
    np.testing.assert_allclose(actions(spec, far)[:, :4], actions(spec, alone)[:, :4], atol=1e-9)


@every_controller
@pytest.mark.parametrize(
    "walks",
    [
        Walks.made(0, n=60, m=60),
        Walks.made(1, n=40, m=80, side=1.0),
        replace(Walks.made(2), pedestrians=np.arange(0)),
        replace(Walks.made(3), pedestrians=np.arange(0), agents=np.arange(1)),
        replace(Walks.made(4), agents=np.arange(0)),
        replace(Walks.made(5), speed=np.full(5, 4.0), yaw_rate=np.full(5, -9.0)),
    ],
    ids=["many", "a throng", "no people", "alone", "no agents", "thrown"],
)
def test_wheel_speeds_are_finite_and_within_the_limits(spec, walks):
    found = actions(spec, walks, steps=3)
    assert np.isfinite(found).all()
    twist = twist_of_wheel_speed(found, wheel_radius=LIMITS.wheel_radius, track=LIMITS.track)
    assert (twist[..., 0] >= -1e-9).all() and (twist[..., 0] <= LIMITS.max_speed + 1e-9).all()
    assert (np.abs(twist[..., 1]) <= LIMITS.max_yaw_rate + 1e-9).all()


@pytest.mark.parametrize("spec", [s for s in SPECS if s != "stand_still"])
def test_a_free_way_ahead_is_driven_straight_and_nearly_at_full_speed(spec):
    walks = replace(Walks.made(0), pedestrians=np.arange(0), agents=np.arange(1), position=np.zeros((5, 2)))
    walks = replace(walks, heading=np.zeros(5), yaw_rate=np.zeros(5), goal=np.tile([6.0, 0.0], (5, 1)))
    twist = twist_of_wheel_speed(actions(spec, walks)[:, 0], wheel_radius=LIMITS.wheel_radius, track=LIMITS.track)
    assert (twist[:, 0] > 0.6).all() and (np.abs(twist[:, 1]) < 0.5).all(), twist
