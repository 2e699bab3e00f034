"""Controllers: the paper's equations by hand, symmetries, limits, names, and the check that users can call."""

import math
from dataclasses import dataclass
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from socialnav_mj.config import Robot, Scenario
from socialnav_mj.controllers import Controller, Limits, TwistController, controller_config, make_controller, registry
from socialnav_mj.controllers.check import check_controller
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.potential_field import (
    MINIMUM_DISTANCE,
    MINIMUM_TURN,
    PotentialField,
    PotentialFieldCapped,
    attractive_force,
    repulsive_force,
    speed_and_turn,
)
from socialnav_mj.geometry import twist_of_wheel_speed

LIMITS = Limits.of(Scenario())
BOTH = [PotentialFieldCapped(), PotentialField(), GoStraight()]
IDS = ["capped", "printed", "straight"]


def observation(goal=(5.0, 0.0), speed=0.0, pedestrians=(), agents=()):
    """One active agent that sees people and agents at places of its own frame; extra slots are empty."""
    n = 1 + len(agents)
    result = {
        "active": np.arange(n) < 1,
        "person": np.where(np.arange(n) < 1, 7, -1),
        "position": np.zeros((n, 2)),
        "heading": np.zeros(n),
        "twist": np.zeros((n, 2)),
        "goal": np.zeros((n, 2)),
        "pedestrian_position": np.zeros((n, len(pedestrians) + 1, 2)),
        "pedestrian_velocity": np.zeros((n, len(pedestrians) + 1, 2)),
        "pedestrian_mask": np.zeros((n, len(pedestrians) + 1), dtype=bool),
        "agent_position": np.zeros((n, n, 2)),
        "agent_velocity": np.zeros((n, n, 2)),
        "agent_mask": np.zeros((n, n), dtype=bool),
    }
    result["goal"][0], result["twist"][0, 0] = goal, speed
    for kind, places, first in (("pedestrian", pedestrians, 0), ("agent", agents, 1)):
        for k, place in enumerate(places):
            result[f"{kind}_position"][0, first + k] = place
            result[f"{kind}_mask"][0, first + k] = True
    return result


def twist_of(controller, *args, **kwargs):
    """Twist that the wheels would roll with, of the one active agent."""
    controller.reset(LIMITS)
    wheel_speed = controller.act(observation(*args, **kwargs))[0]
    return twist_of_wheel_speed(wheel_speed, wheel_radius=LIMITS.wheel_radius, track=LIMITS.track)


# The paper's equations


def test_attraction_is_equation_3_as_printed_without_a_limit():
    """k_p = 2, k_v = 0.5, 3 m ahead and 4 m left, 0.8 m/s: (2*3 - 0.5*0.8, 2*4)."""
    force = attractive_force(
        np.array([[3.0, 4.0]]), np.array([[0.8, 0.0]]), position_gain=2.0, velocity_gain=0.5, limit=None
    )
    np.testing.assert_allclose(force, [[5.6, 8.0]], rtol=1e-15)


def test_attraction_limit_caps_the_pull_and_not_the_damping():
    """The pull (3, 4) has size 5; capped at 1 it is (0.6, 0.8), less 0.5 * 0.8 ahead."""
    kwargs = {"position_gain": 1.0, "velocity_gain": 0.5, "limit": 1.0}
    far = attractive_force(np.array([[3.0, 4.0]]), np.array([[0.8, 0.0]]), **kwargs)
    near = attractive_force(np.array([[0.3, 0.4]]), np.array([[0.8, 0.0]]), **kwargs)
    np.testing.assert_allclose(far, [[0.2, 0.8]], rtol=1e-15)
    np.testing.assert_allclose(near, [[-0.1, 0.4]], rtol=1e-14)


@pytest.mark.parametrize(
    ("distance", "size"),
    [
        (0.5, 0.5 * 2.0 * (1 / 0.5 - 1 / 2.0) / 0.5**2),  # 6
        (1.0, 0.5),
        (2.0, 0.0),
        (2.0001, 0.0),
        (50.0, 0.0),
    ],
)
def test_repulsion_is_equation_4_away_from_the_obstacle(distance, size):
    place = distance * np.array([0.6, 0.8])
    force = repulsive_force(place[None, None], np.ones((1, 1), dtype=bool), gain=2.0, influence_distance=2.0)
    np.testing.assert_allclose(force, [[-0.6 * size, -0.8 * size]], atol=1e-12)


def test_repulsion_of_several_obstacles_is_the_sum_of_equation_5_in_any_order():
    random = np.random.default_rng(0)
    places, there = random.uniform(-2, 2, (3, 8, 2)), random.random((3, 8)) < 0.7
    kwargs = {"gain": 2.0, "influence_distance": 2.0}
    total = repulsive_force(places, there, **kwargs)
    single = [repulsive_force(places[:, [k]], there[:, [k]], **kwargs) for k in range(8)]
    order = random.permutation(8)
    np.testing.assert_allclose(total, np.sum(single, axis=0), rtol=1e-12)
    np.testing.assert_allclose(total, repulsive_force(places[:, order], there[:, order], **kwargs), rtol=1e-12)


def test_repulsion_is_the_negative_gradient_of_khatibs_potential():
    """U = eta/4 (1/rho - 1/rho_0)^2 has the gradient of eq 4 with its factor 1/2; finite differences agree."""

    def potential(place):
        return 0.25 * 2.0 * (1 / np.hypot(*place) - 1 / 2.0) ** 2

    place, step = np.array([0.7, -0.4]), 1e-6
    # Moving the obstacle by +d is moving the agent by -d, so the force is the gradient in the obstacle's place.
    gradient = [(potential(place + d) - potential(place - d)) / (2 * step) for d in step * np.eye(2)]
    force = repulsive_force(place[None, None], np.ones((1, 1), dtype=bool), gain=2.0, influence_distance=2.0)
    np.testing.assert_allclose(force[0], gradient, rtol=1e-8)


@pytest.mark.parametrize(
    ("force", "speed", "turn"),
    [
        ((1.0, 1.0), 1.0 / 0.25, math.pi / 4),  # eqs 7-8: theta_f = 1/4
        ((1.0, -1.0), 1.0 / 0.25, -math.pi / 4),  # the printed quotient would be -4
        ((0.5, 0.0), 0.5 / MINIMUM_TURN, 0.0),  # the printed quotient would be infinite
        ((0.0, 2.0), 0.0, math.pi / 2),
        ((-1.0, 1.0), 0.0, 3 * math.pi / 4),  # from behind: turn on the spot
        ((-1.0, 0.0), 0.0, math.pi),
        ((0.0, 0.0), 0.0, 0.0),
    ],
)
def test_speed_and_turn_are_equations_7_and_8_with_the_angle_positive_and_away_from_zero(force, speed, turn):
    s, t = speed_and_turn(np.array([force]))
    assert (s[0], t[0]) == (pytest.approx(speed, abs=1e-15), pytest.approx(turn))


def test_potential_field_adds_up_pedestrians_and_agents_by_hand():
    """Pull 1 ahead, damping 0.5 * 0.4; a person 1 m left pushes 0.5 right, an agent 1 m ahead pushes 0.5 back."""
    seen = observation((9.0, 0.0), 0.4, pedestrians=[(0.0, 1.0)], agents=[(1.0, 0.0)])
    np.testing.assert_allclose(PotentialFieldCapped().force(seen)[0], [1.0 - 0.2 - 0.5, -0.5], rtol=1e-12)
    np.testing.assert_allclose(PotentialField().force(seen)[0], [9.0 - 0.2 - 0.5, -0.5])
    np.testing.assert_array_equal(PotentialField().force(seen)[1], 0.0)


def test_potential_field_names_the_gains_of_its_docstrings():
    """The docstrings say k_p 1, k_v 0.5, eta 2, rho_0 2 m for both, and a pull of at most 1 for the capped one."""
    for field, limit in ((PotentialField(), None), (PotentialFieldCapped(), 1.0)):
        gains = (field.position_gain, field.velocity_gain, field.repulsion_gain, field.influence_distance)
        assert gains == (1.0, 0.5, 2.0, 2.0) and field.attraction_limit == limit


@pytest.mark.parametrize(
    ("kwargs", "named"),
    [
        ({"influence_distance": 0.0}, "influence_distance = 0.0 is not allowed; allowed: numbers > 0"),
        ({"repulsion_gain": -1}, "repulsion_gain = -1 is not allowed; allowed: numbers >= 0"),
        ({"position_gain": "x"}, "position_gain = 'x'"),
        ({"velocity_gain": math.nan}, "velocity_gain = nan"),
        ({"attraction_limit": 0}, "attraction_limit = 0 is not allowed; allowed: numbers > 0, None"),
        ({"attraction_limit": math.inf}, "attraction_limit = inf"),
    ],
)
def test_potential_field_with_an_impossible_gain_says_what_is_allowed(kwargs, named):
    with pytest.raises(ValueError) as caught:
        PotentialField(**kwargs)
    assert named in str(caught.value)


# What every controller has to hold

PLACES = st.tuples(*2 * [st.floats(-20, 20, allow_subnormal=False)])
SCENES = st.fixed_dictionaries(
    {
        "goal": PLACES,
        "speed": st.floats(-1.0, 5.0),
        "pedestrians": st.lists(PLACES, max_size=4),
        "agents": st.lists(PLACES, max_size=3),
    }
)


@pytest.mark.parametrize("controller", BOTH, ids=IDS)
@settings(max_examples=60, deadline=None)
@given(scene=SCENES)
def test_action_is_finite_and_within_the_limits(controller, scene):
    speed, yaw_rate = twist_of(controller, **scene)
    assert -1e-12 <= speed <= LIMITS.max_speed + 1e-12
    assert abs(yaw_rate) <= LIMITS.max_yaw_rate + 1e-9


@pytest.mark.parametrize("controller", BOTH, ids=IDS)
@settings(max_examples=60, deadline=None)
@given(scene=SCENES)
def test_mirrored_scene_gives_the_mirrored_twist(controller, scene):
    def mirrored(places):
        return [(x, -y) for x, y in places]

    if scene["goal"][1] == 0.0 and scene["goal"][0] <= 0.0:
        return  # straight behind: both turns are as good
    other = {**scene, "goal": (scene["goal"][0], -scene["goal"][1])}
    other |= {kind: mirrored(scene[kind]) for kind in ("pedestrians", "agents")}
    one, two = twist_of(controller, **scene), twist_of(controller, **other)
    if isinstance(controller, PotentialField):
        controller.reset(LIMITS)
        force = controller.force(observation(**scene))[0]
        if force[0] <= 1e-9 and abs(force[1]) <= 1e-9:
            return
    np.testing.assert_allclose(two, one * [1.0, -1.0], atol=1e-9)


@pytest.mark.parametrize("controller", BOTH, ids=IDS)
def test_degenerate_scenes_give_finite_actions(controller):
    for scene in (
        {"goal": (0.0, 0.0)},
        {"goal": (0.0, 0.0), "pedestrians": [(0.0, 0.0)], "agents": [(0.0, 0.0)]},
        {"pedestrians": [(1e-12, 0.0), (-1e-300, 1e-300)]},
        {"goal": (-5.0, 0.0)},
        {"goal": (1e9, -1e9), "speed": 1e6},
    ):
        assert np.isfinite(twist_of(controller, **scene)).all(), scene


def test_repulsion_stays_finite_and_equal_below_the_minimum_distance():
    kwargs = {"gain": 2.0, "influence_distance": 2.0}
    there = np.ones((1, 1), dtype=bool)
    at_limit = repulsive_force(np.array([[[MINIMUM_DISTANCE, 0.0]]]), there, **kwargs)
    nearer = repulsive_force(np.array([[[0.2 * MINIMUM_DISTANCE, 0.0]]]), there, **kwargs)
    np.testing.assert_allclose(nearer, at_limit, rtol=1e-12)
    np.testing.assert_array_equal(repulsive_force(np.zeros((1, 1, 2)), there, **kwargs), 0.0)


@pytest.mark.parametrize("controller", BOTH, ids=IDS)
def test_free_way_to_a_goal_ahead_is_driven_straight_at_full_speed(controller):
    np.testing.assert_allclose(twist_of(controller, goal=(8.0, 0.0)), [1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("controller", BOTH, ids=IDS)
def test_goal_behind_makes_it_turn_on_the_spot_as_fast_as_allowed(controller):
    np.testing.assert_allclose(twist_of(controller, goal=(-5.0, 1.0)), [0.0, LIMITS.max_yaw_rate], atol=1e-12)


def test_go_straight_slows_by_the_cosine_and_turns_what_is_missing_in_one_step():
    """0.1 rad off: cos(0.1) m/s and 0.1 rad / 0.2 s."""
    twist = twist_of(GoStraight(), goal=(math.cos(0.1), math.sin(0.1)), pedestrians=[(0.4, 0.0)])
    np.testing.assert_allclose(twist, [math.cos(0.1), 0.5], rtol=1e-12)


# Limits


def test_limits_clip_twists_and_the_wheel_mapping_inverts_them():
    """2 m/s and 9 rad/s become 1 and pi/6 / 0.2; left = (1 - 0.12 * 2.618) / 0.06."""
    wheel_speed = LIMITS.wheel_speed(np.array([[2.0, 9.0], [-1.0, -9.0], [0.5, 0.3]]))
    turn = math.pi / 6 / 0.2
    np.testing.assert_allclose(wheel_speed[0], [(1 - 0.12 * turn) / 0.06, (1 + 0.12 * turn) / 0.06], rtol=1e-12)
    back = twist_of_wheel_speed(wheel_speed, wheel_radius=0.06, track=0.24)
    np.testing.assert_allclose(back, [[1.0, turn], [0.0, -turn], [0.5, 0.3]], atol=1e-12)


def test_limits_of_a_scenario_are_its_robots_and_its_reading_of_the_turn():
    limits = Limits.of(Scenario(robot=Robot(radius=0.2), pedestrian_radius=0.1, turn_limit="per_second"))
    assert limits.max_yaw_rate == pytest.approx(math.pi / 6)
    assert limits.contact_distance == pytest.approx(0.3) and limits.agent_contact_distance == pytest.approx(0.4)


# Names


class Outside:
    """A controller that owes nothing to the package's base."""

    name = "outside"

    def __init__(self, level=0.5):
        self.level = level

    def reset(self, limits, *, seed=0):
        self.limits = limits

    def act(self, observation):
        return np.full((len(observation["active"]), 2), self.level)


class Forgetful(Outside):
    def __init__(self, margin=1.0):
        super().__init__()


class Nameless:
    def act(self, observation):
        return None


@dataclass(kw_only=True)
class Odd(TwistController):
    knob: object = 1
    name: str = "odd"

    def twist(self, observation):
        return np.zeros((len(observation["active"]), 2))


def test_make_controller_takes_names_settings_and_paths():
    assert isinstance(make_controller("go_straight"), GoStraight)
    plain = make_controller("potential_field")
    printed = make_controller("potential_field(attraction_limit=None, repulsion_gain=3)")
    assert plain == PotentialField() and printed.attraction_limit is None and printed.repulsion_gain == 3
    assert (plain.name, printed.name) == ("potential_field", "potential_field(attraction_limit=None, repulsion_gain=3)")
    assert make_controller("potential_field(name='mine', velocity_gain=0)").name == "mine"
    outside = make_controller(f"{__name__}:Outside(level=2.0)")
    assert isinstance(outside, Outside) and outside.level == 2.0 and isinstance(outside, Controller)


def test_make_controller_takes_entry_points_of_installed_packages(monkeypatch):
    entries = (
        EntryPoint("offered", f"{__name__}:Outside", registry.ENTRY_POINT_GROUP),
        EntryPoint("broken", "no_such_package:Thing", registry.ENTRY_POINT_GROUP),
    )
    monkeypatch.setattr(registry, "entry_points", lambda group: entries)
    assert isinstance(make_controller("offered"), Outside)
    assert registry.available()[-2:] == ("broken", "offered")
    with pytest.raises(ValueError, match=r"'broken' cannot be imported from 'no_such_package:Thing'"):
        make_controller("broken")


@pytest.mark.parametrize(
    ("spec", "named"),
    [
        ("nobody", "unknown controller 'nobody'; available: potential_field"),
        ("go_straigt", "unknown controller 'go_straigt'; did you mean go_straight?; available: "),
        ("no.such.module:Thing", "cannot be imported from 'no.such.module:Thing': No module named 'no'"),
        (f"{__name__}:Missing", "has no attribute 'Missing'"),
        (":Thing", "expected package.module:Class"),
        (f"{__name__}:LIMITS", "is a Limits; expected a class"),
        (f"{__name__}:Nameless", "is a Nameless, which lacks name and reset"),
        ("potential_field(gain=1)", "has no setting 'gain'; its settings: position_gain, "),
        ("hybrid(neer=1)", "its settings: near, far, switch_distance, who"),
        (f"{__name__.replace(':', '.')}.Outside", f"did you mean {__name__}:Outside?"),
        (f"{__name__}:Forgetful(margin=2)", "was given margin = 2 but does not keep it"),
        ("potential_field(influence_distance=-1)", "influence_distance = -1 is not allowed"),
        ("potential_field(position_gain=x)", "cannot be read; expected name or name(key=value, ...)"),
        ("potential_field(1)", "cannot be read"),
        ("potential_field(position_gain=1", "cannot be read"),
        ("potential_field(position_gain=1)(velocity_gain=1)", "cannot be read"),
        ("potential_field(position_gain=__import__('os').getpid())", "cannot be read"),
    ],
)
def test_make_controller_names_what_is_wrong_and_what_exists(spec, named):
    with pytest.raises(ValueError) as caught:
        make_controller(spec)
    assert named in str(caught.value)


class Bare:
    """README's kind: no arguments, and a name that belongs to the class."""

    name = "bare"

    def reset(self, limits, *, seed=0):
        self.limits = limits

    def act(self, observation):
        return np.zeros((len(observation["active"]), 2))


def test_a_class_without_arguments_can_be_given_a_name():
    assert make_controller(f"{__name__}:Bare").name == "bare"
    assert make_controller(f"edited={__name__}:Bare").name == "edited"


def test_controller_config_holds_the_class_and_the_fields_as_json_values():
    config = controller_config(PotentialField(attraction_limit=None))
    assert config.pop("class") == "socialnav_mj.controllers.potential_field:PotentialField"
    assert config["attraction_limit"] is None and config["repulsion_gain"] == 2.0 and len(config) == 6
    outside = controller_config(Outside(level=0.25))
    assert (outside.pop("class"), outside.pop("level")) == (f"{__name__}:Outside", 0.25) and set(outside) == {"sources"}
    assert controller_config(Odd(knob=(1, 2)))["knob"] == [1, 2]
    for knob in (np.zeros(2), math.inf, {1, 2}):
        with pytest.raises(ValueError, match=r"Odd\.knob = .* is not allowed; allowed: JSON values"):
            controller_config(Odd(knob=knob))


# The check that users call


@pytest.mark.parametrize("controller", [*BOTH, Outside()], ids=[*IDS, "outside"])
def test_check_controller_is_silent_about_sound_controllers(controller):
    check_controller(controller)


def misbehaving(**members):
    return type("Wrong", (Outside,), members)()


@pytest.mark.parametrize(
    ("members", "named"),
    [
        ({"name": ""}, "lacks reset, act, or a name"),
        (
            {"act": lambda self, o: np.zeros((len(o["active"]), 3))},
            r"empty scene, act returns shape \(4, 3\); expected",
        ),
        ({"act": lambda self, o: None}, "expected"),
        ({"act": lambda self, o: {}}, "act returns a dict; expected an array"),
        ({"act": lambda self, o: o["goal"] / np.hypot(*o["goal"].T)[:, None]}, "degenerate scene.*finite"),
        ({"act": lambda self, o: np.multiply(o["goal"], 2, out=o["goal"])}, "lonely scene.*observation.'goal'."),
        ({"act": lambda self, o: np.random.default_rng().random((len(o["active"]), 2))}, "something else"),
        ({"policies": ("a", "b"), "active_policy": 1}, r"active_policy is 1; expected shape \(4,\)"),
        ({"active_policy": property(lambda self: np.full(4, 5))}, "indices into"),
        ({"policies": ("a", "b"), "scores": np.zeros(2)}, r"scores is \[0. 0.\]; expected shape \(4, 2\), finite"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_check_controller_says_what_is_wrong_and_where(members, named):
    with pytest.raises(ValueError, match=named):
        check_controller(misbehaving(**members))
