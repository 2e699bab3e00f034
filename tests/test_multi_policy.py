"""Controllers that choose among policies by what each would bring about: `mpdm`, `selector`, and their imagination."""

from dataclasses import dataclass

import numpy as np
import pytest
from test_protocol import LIMITS, Walks

from socialnav_mj.controllers import controller_config, make_controller, with_policy_of
from socialnav_mj.controllers.base import TwistController
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.mpdm import MPDM, STEPS
from socialnav_mj.controllers.planning.foresight import Foresight
from socialnav_mj.controllers.planning.imagination import Imagination
from socialnav_mj.controllers.planning.terms import terms_of
from socialnav_mj.controllers.prediction import constant_velocity
from socialnav_mj.controllers.selector import Selector
from socialnav_mj.controllers.specs import controller_of
from socialnav_mj.controllers.stand_still import StandStill
from socialnav_mj.observation import observe

BOTH = ("mpdm", "selector")


def seen(people=(), velocities=None, *, goal=(5.0, 0.0), speed=1.0, heading=0.0):
    """What one agent sees at the origin of people in the world."""
    people = np.array(people, dtype=float).reshape(-1, 2)
    return observe(
        active=np.array([True]),
        person=np.array([7]),
        position=np.zeros((1, 2)),
        heading=np.array([heading]),
        velocity=speed * np.array([[np.cos(heading), np.sin(heading)]]),
        yaw_rate=np.zeros(1),
        goal=np.array([goal], dtype=float),
        pedestrian_position=people,
        pedestrian_velocity=np.zeros_like(people) if velocities is None else np.array(velocities, dtype=float),
        pedestrian_slots=np.arange(len(people)),
    )


def imagined(observation, steps=STEPS) -> Imagination:
    ahead = Foresight(constant_velocity(steps + 1), LIMITS, steps=steps + 1).look(observation)
    return Imagination(observation, np.flatnonzero(observation["active"]), ahead, terms_of(LIMITS, steps=steps))


# Imagination


def test_imagination_begins_with_what_is_seen():
    observation = seen([(1.0, 2.0), (3.0, -1.0)], [(0.3, 0.0), (0.0, -0.4)], heading=0.4)
    found = imagined(observation).observation()
    for name in ("goal", "twist"):
        np.testing.assert_allclose(found[name], observation[name], atol=1e-12)
    order = np.argsort(np.hypot(*observation["pedestrian_position"][0].T))
    for name in ("pedestrian_position", "pedestrian_velocity"):
        np.testing.assert_allclose(found[name][0], observation[name][0, order], atol=1e-12)
    assert found["pedestrian_mask"].all() and not found["agent_mask"].any()


def test_imagined_people_walk_on_and_the_agent_sees_them_from_where_it_would_be():
    """Driven straight at 1 m/s for 1 s, 1 m ahead: the world as it would then be seen, to what the motors lose."""
    state = imagined(seen([(3.0, 1.0)], [(-0.5, 0.0)]))
    for _ in range(5):
        state.drive(np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(state.position, [[1.0, 0.0]], atol=1e-9)
    found = state.observation()
    np.testing.assert_allclose(found["pedestrian_position"][0, 0], [3.0 - 0.5 - 1.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(found["pedestrian_velocity"][0, 0], [-0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(found["goal"], [[4.0, 0.0]], atol=1e-9)


def test_imagined_turns_turn_the_view():
    state = imagined(seen([(0.0, 2.0)], speed=0.0))
    for _ in range(10):
        error = np.pi / 2.0 - state.heading
        state.drive(np.stack([np.zeros(1), np.clip(error / 0.2, -2.6, 2.6)], axis=1))
    assert state.heading[0] == pytest.approx(np.pi / 2.0, abs=0.02)
    np.testing.assert_allclose(state.observation()["pedestrian_position"][0, 0], [2.0, 0.0], atol=0.05)


def test_least_distance_is_that_within_the_step():
    """Crossing 0.1 m ahead at 5 m/s, there and gone within a step."""
    state = imagined(seen([(0.1, -0.5)], [(0.0, 5.0)], speed=0.0))
    assert state.drive(np.zeros((1, 2)))[0, 0] == pytest.approx(0.1, abs=1e-6)


# MPDM


@dataclass(kw_only=True)
class Left(TwistController):
    """Drives a wide circle to the left."""

    name: str = "left"

    def twist(self, observation):
        return np.tile([1.0, 0.8], (len(observation["active"]), 1))


def chosen(controller, observation) -> str:
    controller.reset(LIMITS)
    controller.act(observation)
    return controller.policies[controller.active_policy[0]]


def test_free_way_is_driven_and_a_wall_is_waited_for():
    mpdm = MPDM(candidates=(StandStill(), GoStraight()))
    assert chosen(mpdm, seen()) == "go_straight"
    wall = [(1.0, y) for y in np.linspace(-1.0, 1.0, 9)]
    assert chosen(mpdm, seen(wall)) == "stand_still"


def test_somebody_ahead_is_passed_by_who_turns():
    mpdm = MPDM(candidates=(GoStraight(), Left(), StandStill()), zone_weight=0.0)
    assert chosen(mpdm, seen([(1.5, 0.0)])) == "left"


def test_scores_are_the_costs_of_hand_calculation():
    """Alone, 5 m away, at full speed: 2.4 m nearer for who drives, .23 m for who brakes; and 2.4 s in a zone."""
    mpdm = MPDM(candidates=(GoStraight(), StandStill()), bonus=0.0, zone_weight=2.0)
    mpdm.reset(LIMITS)
    mpdm.act(seen())
    np.testing.assert_allclose(mpdm.scores, [[-0.2 * STEPS, -0.231]], atol=1e-3)
    mpdm.act(seen([(-0.9, 0.0)], [(0.0, 0.0)], speed=0.0))
    assert mpdm.scores[0, 1] == pytest.approx(2.0 * 0.2 * STEPS)


def test_equals_do_not_alternate():
    twin = MPDM(candidates=(GoStraight(name="one"), GoStraight(name="two")), bonus=0.1)
    assert chosen(twin, seen()) == "one"
    for _ in range(3):
        twin.act(seen())
        assert twin.active_policy[0] == 0
    np.testing.assert_allclose(np.diff(twin.scores), [[0.1]])


def test_imagined_candidates_leave_the_driving_ones_alone():
    """A candidate with a memory keeps its own: what drives is what would drive without the roll-outs."""
    walks = Walks.made(0)
    alone, among = MPC(), MPDM(candidates=(MPC(), StandStill()))
    for controller in (alone, among):
        controller.reset(LIMITS, seed=3)
    for observation in walks.observations(2):
        expected, found = alone.act(observation), among.act(observation)
        driven = among.active_policy == 0
        np.testing.assert_array_equal(found[driven], expected[driven])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"candidates": (GoStraight(),)}, "allowed: two or more of TwistController"),
        ({"candidates": (GoStraight(), "x")}, "allowed: two or more of TwistController"),
        ({"zone_weight": -1.0}, "zone_weight = -1.0 is not allowed; allowed: numbers >= 0"),
        ({"prediction": "oracle"}, "there is no prediction 'oracle'"),
    ],
)
def test_impossible_choices_are_refused(changes, message):
    with pytest.raises(ValueError) as caught:
        MPDM(**changes)
    assert message in str(caught.value)


# Selector


def test_calm_plan_drives_unless_it_is_less_safe():
    walks = Walks.made(1, n=6, m=30)
    switched = set()
    for tolerance in (0.0, 1e6):
        selector = Selector(tolerance=tolerance)
        calm, free = MPC(preset="calm"), MPC(preset="free")
        for controller in (selector, calm, free):
            controller.reset(LIMITS, seed=2)
        for observation in walks.observations(3):
            found = selector.act(observation)
            plans = np.stack([calm.act(observation), free.act(observation)])
            risk = calm.choice.clearance - free.choice.clearance
            np.testing.assert_array_equal(selector.active_policy, risk > tolerance)
            np.testing.assert_array_equal(found, plans[selector.active_policy, np.arange(6)])
            switched |= set(selector.active_policy.tolist()) if tolerance == 0.0 else set()
    assert switched == {0, 1}


def test_selector_takes_planners_alone():
    with pytest.raises(ValueError, match=r"calm = .* is not allowed; allowed: mpc with any settings"):
        Selector(calm=GoStraight())
    with pytest.raises(ValueError, match="tolerance = -1 is not allowed; allowed: numbers >= 0"):
        Selector(tolerance=-1)


# As text and in files


@pytest.mark.parametrize(
    "spec",
    [
        "mpdm",
        "mpdm(candidates=['go_straight', 'potential_field(repulsion_gain=3.0)'])",
        "selector(tolerance=0.3)",
        "selector(calm=\"mpc(preset='calm', zone_weight=0.7)\")",
        "hybrid(near='selector', far='orca')",
    ],
)
def test_choices_travel_as_the_specs_that_made_them(spec):
    controller = make_controller(spec)
    config = controller_config(controller)
    again = controller_of(config)
    assert type(again) is type(controller) and controller_config(again) == config


def test_candidates_of_a_file_are_trusted_no_more_than_any_controller():
    config = controller_config(make_controller("mpdm"))
    config["candidates"] = ["go_straight", "subprocess:getoutput"]
    with pytest.raises(ValueError, match="add --trust subprocess:getoutput"):
        controller_of(config)
    config["candidates"] = ["go_straight", 3]
    with pytest.raises(ValueError, match="controller 3 cannot be read; expected a string"):
        controller_of(config)


def test_candidates_act_with_the_policy_of_the_recording():
    found = with_policy_of("mpdm(zone_weight=1.0)", "students003")
    assert "replay_irl(policy='students003_continuous_seed0')" in make_controller(found).policies
    assert with_policy_of("selector", "students003") == "selector"
