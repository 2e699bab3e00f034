"""What planners are told of their robots' motion, beside the physics."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import environment_of, stand, walk
from test_robot import World

from socialnav_mj.config import Robot, Scenario
from socialnav_mj.controllers import Limits, make_controller
from socialnav_mj.controllers.dynamic_window import DynamicWindow
from socialnav_mj.controllers.motion import HEAVY, IDEAL, LIGHT, MOTIONS
from socialnav_mj.controllers.planning import loops
from socialnav_mj.controllers.planning.terms import terms_of
from socialnav_mj.metrics.outcomes import success
from socialnav_mj.rollout import rollout
from socialnav_mj.studies.settings import SETTINGS

LIMITS = Limits.of(Scenario())
MOTION_OF = {"robot": LIGHT, "robot_heavy": HEAVY}


def rolled_out(command, begin, motion, *, steps):
    """Place, heading, speed and yaw rate after some steps of a command."""
    terms = terms_of(replace(LIMITS, motion=motion), steps=steps)
    x, y, heading, v, w = 0.0, 0.0, 0.0, *begin
    for _ in range(steps):
        way, turn, v, w = loops.driven(*command, v, w, terms)
        x, y = x + way * np.cos(heading + 0.5 * turn), y + way * np.sin(heading + 0.5 * turn)
        heading = heading + turn
    return x, y, heading, v, w


@pytest.mark.parametrize("robot", MOTION_OF)
@pytest.mark.parametrize("command", [(1.0, 0.0), (0.5, 1.5), (1.0, -2.618), (0.0, 2.0)])
@pytest.mark.parametrize("begin", [(0.0, 0.0), (1.0, 0.0), (0.8, -1.5)])
def test_roll_out_goes_where_the_physics_goes(command, begin, robot):
    """For 1 s, to 4 cm, .1 rad and 5 cm/s; the light robot reaches any twist in half of that."""
    world = World(robot=robot)
    world.drive(0.0, 0.0, 0.5)
    start = world.drive(*begin, 1.5)[-1]
    end = world.drive(*command, 1.0)[-1]
    x, y, heading, v, w = rolled_out(command, start[4:6], MOTION_OF[robot], steps=5)
    c, s = np.cos(start[3]), np.sin(start[3])
    dx, dy = end[1:3] - start[1:3]
    np.testing.assert_allclose([x, y], [c * dx + s * dy, c * dy - s * dx], atol=0.04)
    turned = (end[3] - start[3] - heading + np.pi) % (2.0 * np.pi) - np.pi
    assert abs(turned) < 0.1 and abs(v - end[4]) < 0.05 and abs(w - end[5]) < 0.1


@pytest.mark.parametrize("robot", MOTION_OF)
def test_robots_stop_as_soon_as_is_told(robot):
    world = World(robot=robot)
    start = world.drive(1.0, 0.0, 2.5)[-1]
    end = world.drive(0.0, 0.0, 2.5)[-1]
    way = np.hypot(*(end[1:3] - start[1:3]))
    assert start[4] > 0.98 and 0.8 < 2.0 * MOTION_OF[robot].acceleration * way / start[4] ** 2 <= 1.0


def test_an_ideal_unicycle_does_as_it_is_told():
    np.testing.assert_allclose(
        rolled_out((0.5, 1.5), (1.0, -2.0), IDEAL, steps=1),
        (0.1 * np.cos(0.15), 0.1 * np.sin(0.15), 0.3, 0.5, 1.5),
        atol=1e-5,
    )


@pytest.mark.parametrize("motion", [LIGHT, HEAVY, IDEAL])
@pytest.mark.parametrize("error", [0.02, 0.4, 3.0])
def test_a_heading_is_reached_and_hardly_passed(error, motion):
    """By less than .1 rad or a tenth of it; a heavy base that turned as fast as it may would pass it by more than 1."""
    terms = terms_of(replace(LIMITS, motion=motion), steps=1)
    left, w, passed = error, 0.0, 0.0
    for _ in range(25):
        reached = loops.yaw_reached(loops.yaw_command(left, terms), w, terms)
        left, w = left - loops.turn_made(reached, w, terms), reached
        passed = max(passed, -left)
    assert abs(left) < 0.01 and passed < max(0.1, 0.1 * error)


def test_controllers_are_told_the_motion_of_their_robots():
    assert Limits.of(Scenario()).motion == LIGHT
    assert Limits.of(Scenario().changed(**SETTINGS["heavy"].task_kwargs)).motion == HEAVY
    assert Limits.of(Scenario(plant="unicycle")).motion == IDEAL
    assert Limits.of(Scenario(robot=Robot(model="/somewhere/mine.xml"))).motion == LIGHT


def test_a_robot_of_ones_own_may_be_added(monkeypatch):
    own = HEAVY._replace(acceleration=0.5)
    monkeypatch.setitem(MOTIONS, "mine.xml", own)
    assert Limits.of(Scenario(robot=Robot(model="/somewhere/mine.xml"))).motion == own


def test_the_window_has_the_yaw_rates_that_a_heavy_base_can_reach():
    controller = DynamicWindow()
    controller.reset(replace(LIMITS, motion=HEAVY))
    now = np.array([0.0, 1.0, -2.6])
    turns = controller._turns(now)
    assert turns.shape == (3, 1, 17) and (turns[:, 0, 0] == now).all()
    assert (abs(turns - now[:, None, None]) <= HEAVY.yaw_change + 1e-12).all()
    assert (abs(turns) <= LIMITS.max_yaw_rate).all()


@pytest.mark.parametrize("controller", ["mpc", "mpdm", "dynamic_window"])
def test_who_is_told_gets_a_heavy_base_past_somebody_who_stands(controller):
    environment = environment_of(
        walk([(-3.0, 0.0), (3.0, 0.0)], 1.0), stand((0.0, 0.1), 0.0, 30.0), **SETTINGS["heavy"].task_kwargs
    )
    assert success(rollout(environment, make_controller(controller))).all()
