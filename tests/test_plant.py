"""Plants: an ideal unicycle goes exactly where it is told, a heavier base and a slippery floor do not."""

import numpy as np
import pytest
from scenes import TINY, environment_of, stand, walk

from socialnav_mj import metrics
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import GoStraight
from socialnav_mj.environment import make_environment
from socialnav_mj.geometry import Array, arc, wheel_speed_of_twist
from socialnav_mj.metrics.tracking import side_slip, stopping_distance, tracking_error, unmet_share
from socialnav_mj.rollout import rollout
from socialnav_mj.scene import build_model
from socialnav_mj.studies.settings import HEAVY

ALONE = (walk([(0, 0), (9, 0)], 1.0), stand((30, 30), 0.0, 9.0))


def driven(*twists: tuple[float, float], **settings) -> tuple[Array, Array, Array]:
    """Positions, headings and velocities, one a control step, of a robot alone that is told twists, each for a step."""
    environment = environment_of(*ALONE, agents=[1], **settings)
    environment.reset()
    robot = environment.task.scenario.robot
    path = [(environment.task.sample.position[0], environment.task.sample.heading[0], np.zeros(2))]
    for twist in twists:
        wheels = wheel_speed_of_twist([twist], wheel_radius=robot.wheel_radius, track=robot.track)
        environment.step(wheels)
        sample = environment.task.sample
        path.append((sample.position[0], sample.heading[0], sample.velocity[0]))
    return tuple(np.array(values) for values in zip(*path, strict=True))


def test_arc_is_the_limit_of_many_small_straight_steps() -> None:
    twist, n = np.array([[0.8, 1.7], [0.5, 0.0], [0.0, -2.0], [1.0, 1e-9]]), 200_000
    position, heading = np.zeros((4, 2)), np.full(4, 0.3)
    there, turned = arc(position, heading, twist, np.array([[0.2], [0.4]]))
    time = (np.arange(n) + 0.5) * 0.4 / n
    for k, (speed, rate) in enumerate(twist):
        angle = 0.3 + rate * time
        expected = speed * 0.4 * np.array([np.cos(angle).mean(), np.sin(angle).mean()])
        np.testing.assert_allclose(there[1, k], expected, atol=1e-9)
    np.testing.assert_allclose(turned[1], 0.3 + 0.4 * twist[:, 1])


def test_unicycle_follows_every_command_exactly_and_within_the_limits() -> None:
    twists = [(1.0, 0.0), (1.0, 2.0), (0.0, -2.0), (0.5, 9.0), (3.0, 0.0), (-1.0, 0.0)]
    position, heading, velocity = driven(*twists, plant="unicycle")
    low, high = (0.0, -Scenario().max_yaw_rate), (1.0, Scenario().max_yaw_rate)
    for k, twist in enumerate(np.clip(twists, low, high)):
        there, turned = arc(position[k : k + 1], heading[k : k + 1], twist[None], np.array([[0.2]]))
        np.testing.assert_allclose(position[k + 1], there[0, 0], atol=1e-12)
        np.testing.assert_allclose(np.cos(heading[k + 1]), np.cos(turned[0, 0]), atol=1e-12)
        ahead = np.array([np.cos(heading[k + 1]), np.sin(heading[k + 1])])
        np.testing.assert_allclose(velocity[k + 1], twist[0] * ahead, atol=1e-12)


@pytest.mark.parametrize("people", ["rigid", "compliant"])
def test_nothing_stops_a_unicycle_and_its_touches_are_told_like_those_of_wheels(people) -> None:
    crowd = walk([(0, 0), (9, 0)], 1.0), stand((2, 0), 0.0, 12.0)
    wheels, ideal = (
        rollout(environment_of(*crowd, agents=[1], pedestrian_body=people, plant=plant), GoStraight())
        for plant in ("wheels", "unicycle")
    )
    assert len(wheels.contact_time) >= 1 and len(ideal.contact_time) >= 1
    # From (0, 0) at 1 m/s at once: it touches after 2 m less the radii, and is through.
    assert ideal.contact_time[0] == pytest.approx(2.0 - 0.32, abs=0.011)
    there = np.isfinite(ideal.agent_heading[:, 0])
    np.testing.assert_allclose(ideal.agent_position[there, 0, 0], 0.2 * np.arange(there.sum()), atol=1e-9)
    assert np.abs(ideal.agent_position[there, 0, 1]).max() < 1e-9 and np.nanmax(ideal.agent_tilt) < 1e-9
    assert tracking_error(ideal)[0] < 1e-9 < 0.01 < tracking_error(wheels)[0]
    assert unmet_share(ideal)[0] == 0.0 < unmet_share(wheels)[0] and side_slip(ideal)[0] < 1e-9


def test_parked_unicycles_stay_parked_and_equal_settings_give_equal_bits() -> None:
    crowd = walk([(0, 0), (3, 0)], 1.0), walk([(0, 1), (3, 1)], 1.0, begin=9.0), stand((9, 9), 0.0, 20.0)
    hashes = set()
    for _ in range(2):
        environment = environment_of(*crowd, agents=[1, 2], plant="unicycle")
        episode = rollout(environment, GoStraight())
        hashes.add(episode.metadata["state_hash"])
        assert metrics.success(episode).all()
        assert environment.physics.data.qpos[2] < -1.0
    assert len(hashes) == 1


def test_floor_friction_is_the_wheels_and_the_default_leaves_the_model_alone() -> None:
    bounds = {"n_agent_slots": 1, "n_pedestrian_slots": 1, "low": np.zeros(2), "high": np.ones(2)}
    plain, slippery, same = (build_model(Scenario(floor_friction=friction), **bounds) for friction in (None, 0.3, 0.8))
    for wheel in ("left_wheel", "right_wheel"):
        geom = f"agent_000/{wheel}"
        assert slippery.geom(geom).friction[0] == 0.3 and plain.geom(geom).friction[0] == 0.8
    assert plain.geom("agent_000/bumper").friction[0] == slippery.geom("agent_000/bumper").friction[0]
    np.testing.assert_array_equal(plain.geom_friction, same.geom_friction)
    with pytest.raises(ValueError, match=r"floor_friction = 3.0 is not allowed; allowed: numbers in \[0.05, 1.5\]"):
        Scenario(floor_friction=3.0)


def test_heavy_base_answers_as_its_configuration_says_and_slippery_floors_stretch_the_stop() -> None:
    stops = {}
    plants = {"wheels": {}, "heavy": HEAVY, "slippery": {"floor_friction": 0.3}, "icy": {"floor_friction": 0.05}}
    for name, settings in plants.items():
        position, _, velocity = driven(*[(1.0, 0.0)] * 15, *[(0.0, 0.0)] * 20, **settings)
        assert velocity[15, 0] == pytest.approx(1.0, abs=0.04), name
        stops[name] = position[-1, 0] - position[15, 0]
        if name == "heavy":
            # 1.0 m/s^2 at first, 0.2 m/s a control step.
            assert np.diff(velocity[1:4, 0]) == pytest.approx(0.2, abs=0.02)
    assert stops["wheels"] == pytest.approx(0.22, abs=0.02)
    assert 0.5 < stops["heavy"] < 0.65  # v^2 / 2 a, and the servo's 0.1 s at the end
    # The wheels bear most of the weight: at 0.3 they hold nearly all that the servo brakes with, 2.5 m/s^2.
    assert 1.02 < stops["slippery"] / stops["wheels"] < 1.1
    assert stops["icy"] > 4.0 * stops["wheels"]


def test_turn_of_the_heavy_base_is_limited_as_well() -> None:
    _, heading, _ = driven(*[(0.0, 2.0)] * 3, **HEAVY)
    turn = np.diff(np.unwrap(heading)) / 0.2
    # 2.09 rad/s^2 from rest: a mean of 0.21 rad/s in the first control step, 0.63 in the second.
    assert turn[:2] == pytest.approx([0.21, 0.63], abs=0.04)


def test_stopping_distance_of_an_episode_is_that_of_the_plant() -> None:
    class Braking:
        name = "braking"

        def reset(self, limits, *, seed=0):
            self.limits, self.step = limits, 0

        def act(self, observation):
            self.step += 1
            speed = 1.0 if self.step % 30 < 15 else 0.0
            return self.limits.wheel_speed(np.tile((speed, 0.0), (len(observation["active"]), 1)))

    for settings, low, high in (({}, 0.2, 0.24), ({"plant": "unicycle"}, -1e-9, 1e-9), (HEAVY, 0.45, 0.65)):
        episode = rollout(environment_of(*ALONE, agents=[1], **settings), Braking())
        assert low <= stopping_distance(episode)[0] <= high, settings


def test_tasks_take_the_plant() -> None:
    assert make_environment(dataset=TINY, plant="unicycle").task.scenario.plant == "unicycle"
    with pytest.raises(ValueError, match="plant = 'hover' is not allowed; allowed: wheels, unicycle"):
        make_environment(dataset=TINY, plant="hover")
