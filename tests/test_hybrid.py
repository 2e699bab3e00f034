"""The mixed policy: where it switches, whom it counts, what the episode says of it."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import TINY, environment_of, stand, walk

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import (
    Limits,
    TwistController,
    controller_config,
    controller_of,
    make_controller,
    spec_of,
)
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.hybrid import Hybrid, nearest_distance
from socialnav_mj.controllers.potential_field import PotentialField
from socialnav_mj.environment import make_environment
from socialnav_mj.episode import Episode
from socialnav_mj.rollout import rollout

LIMITS = Limits.of(Scenario())
NEAR, FAR = 0, 1


def observation(pedestrians=((),), agents=None):
    """Agents that each see pedestrians, and other agents, straight ahead at some distances [m]; goals 5 m ahead."""
    n = len(pedestrians)
    agents = agents or [()] * n
    result = {
        "active": np.ones(n, dtype=bool),
        "person": np.arange(10, 10 + n),
        "twist": np.zeros((n, 2)),
        "goal": np.tile([5.0, 1.0], (n, 1)),
    }
    for kind, rows in (("pedestrian", pedestrians), ("agent", agents)):
        width = max(map(len, rows))
        result[f"{kind}_position"] = np.zeros((n, width, 2))
        result[f"{kind}_velocity"] = np.zeros((n, width, 2))
        result[f"{kind}_mask"] = np.zeros((n, width), dtype=bool)
        for i, row in enumerate(rows):
            result[f"{kind}_position"][i, : len(row), 0] = row
            result[f"{kind}_mask"][i, : len(row)] = True
    return result


def hybrid(**kwargs) -> Hybrid:
    controller = Hybrid(**{"near": PotentialField(), "far": GoStraight(), **kwargs})
    controller.reset(LIMITS)
    return controller


def acting(controller, *args, **kwargs):
    controller.act(observation(*args, **kwargs))
    return controller.active_policy.tolist()


# Where it switches


@pytest.mark.parametrize("distance", [0.5, 2.0, 3.3])
def test_switch_is_strictly_below_its_distance(distance):
    """The two neighbouring floating-point numbers and the distance itself."""
    below, above = np.nextafter(distance, 0.0), np.nextafter(distance, 9.0)
    found = acting(hybrid(switch_distance=distance), [[below], [distance], [above]])
    assert found == [NEAR, FAR, FAR]


def test_default_distance_is_the_papers_and_nobody_is_far():
    assert Hybrid.__dataclass_fields__["switch_distance"].default == 2.0
    assert acting(hybrid(), [[1.999], [2.0], []]) == [NEAR, FAR, FAR]


def test_nearest_of_several_decides():
    assert acting(hybrid(), [[3.0, 1.0, 2.5], [3.0, 2.1, 2.5]]) == [NEAR, FAR]


@pytest.mark.parametrize(("distance", "expected"), [(0.0, FAR), (1e9, NEAR)])
def test_extreme_distances_are_one_of_the_parents(distance, expected):
    seen = observation([[0.0], [1.0], [50.0]])
    parent = PotentialField() if expected == NEAR else GoStraight()
    parent.reset(LIMITS)
    np.testing.assert_array_equal(hybrid(switch_distance=distance).act(seen), parent.act(seen))


def test_each_agent_gets_the_action_of_its_policy():
    seen = observation([[1.0], [3.0]])
    near, far = PotentialField(), GoStraight()
    near.reset(LIMITS)
    far.reset(LIMITS)
    expected = np.stack([near.act(seen)[0], far.act(seen)[1]])
    assert not np.allclose(near.act(seen), far.act(seen))
    np.testing.assert_array_equal(hybrid().act(seen), expected)


# Whom it counts


def test_other_agents_count_only_for_anyone():
    people, agents = [[3.0], [3.0], [1.0]], [[1.0], [2.0], [3.0]]
    assert acting(hybrid(), people, agents) == [FAR, FAR, NEAR]
    assert acting(hybrid(who="anyone"), people, agents) == [NEAR, FAR, NEAR]


@given(
    people=st.lists(st.floats(-5.0, 5.0), max_size=4),
    agents=st.lists(st.floats(-5.0, 5.0), max_size=4),
)
def test_nearest_distance_is_the_least_of_those_who_count(people, agents):
    seen = observation([people], [agents])
    assert nearest_distance(seen, who="pedestrians")[0] == min(map(abs, people), default=np.inf)
    assert nearest_distance(seen, who="anyone")[0] == min(map(abs, people + agents), default=np.inf)


def test_masked_entries_do_not_count():
    seen = observation([[0.5]])
    seen["pedestrian_mask"][:] = False
    assert nearest_distance(seen, who="anyone").tolist() == [np.inf]


def test_nothing_is_remembered():
    controller = hybrid()
    assert [acting(controller, [[d]])[0] for d in (1.9, 2.1, 1.9, 2.1)] == [NEAR, FAR, NEAR, FAR]


def test_answer_is_the_callers_to_change():
    controller = hybrid()
    controller.act(observation([[1.0]]))
    controller.active_policy[:] = FAR
    assert controller.active_policy.tolist() == [NEAR]


# In an episode


def test_episode_records_which_policy_acted_where():
    """A bystander 1 m beside the way: near while the recorded distance at the sample is below 2 m, else far."""
    environment = environment_of(
        walk([(0.0, 0.0), (8.0, 0.0)], 1.0), stand((4.0, 1.0), 0.0, 30.0), stand((0.0, 9.0), 0.0, 30.0)
    )
    episode = rollout(environment, hybrid())
    assert episode.policies == ("potential_field", "go_straight")
    under_way = episode.agent_policy[:, 0] >= 0
    gap = np.linalg.norm(episode.pedestrian_position - episode.agent_position[:, :1], axis=-1)
    expected = np.where(np.nanmin(gap[under_way], axis=1) < 2.0, NEAR, FAR)
    np.testing.assert_array_equal(episode.agent_policy[under_way, 0], expected)
    assert set(expected) == {NEAR, FAR}
    changes = np.flatnonzero(np.diff(expected))
    assert len(changes) == 2  # in and out again


def test_episode_with_the_policies_goes_through_a_file(tmp_path):
    episode = rollout(make_environment(share=0.3, dataset=TINY), make_controller("hybrid(near='go_straight')"))
    assert episode.policies == ("go_straight", "potential_field")
    read = Episode.load(episode.save(tmp_path / "e.npz"))
    assert read.policies == episode.policies
    np.testing.assert_array_equal(read.agent_policy, episode.agent_policy)
    assert read.metadata["controller_config"]["near"] == "go_straight"
    assert read.metadata["controller_config"]["switch_distance"] == 2.0


# Refusals


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"who": "people"}, "who = 'people' is not allowed; allowed: pedestrians, anyone"),
        ({"switch_distance": -1.0}, "switch_distance = -1.0 is not allowed"),
        ({"switch_distance": float("nan")}, "switch_distance = nan is not allowed"),
        ({"near": "go_straight"}, "near = 'go_straight' is not allowed; allowed: objects of TwistController"),
        ({"far": dict}, "far = <class 'dict'> is not allowed"),
    ],
)
def test_settings_that_cannot_be_are_named(kwargs, message):
    with pytest.raises(ValueError) as caught:
        hybrid(**kwargs)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("hybrid(near='nobody')", "unknown controller 'nobody'"),
        ("hybrid(far='builtins:dict')", "controller 'builtins:dict'"),
        ("hybrid(near='potential_field(influence_distance=-1)')", "influence_distance = -1 is not allowed"),
        ("hybrid(near=3)", "controller 3 cannot be read"),
    ],
)
def test_parts_that_cannot_be_made_are_named(spec, message):
    with pytest.raises(ValueError) as caught:
        make_controller(spec)
    assert message in str(caught.value)


# As text


@dataclass(kw_only=True)
class Own(TwistController):
    """A controller of somebody else, with a setting that has no default."""

    knob: int
    name: str = "own"

    def twist(self, observation):
        return np.zeros((len(observation["active"]), 2))


POLICY = "replay_irl(policy='students003_continuous_seed0')"


@pytest.mark.parametrize(
    "near",
    [
        "replay_irl",
        POLICY,
        "potential_field(attraction_limit=2.0)",
        "potential_field_capped( attraction_limit = 1.0 )",  # a default that is given, and not as it would be written
        "potential_field(attraction_limit=2.0, name='PF')",
        f"{__name__}:Own(knob=3)",
        f"hybrid(near={POLICY!r}, switch_distance=1.5)",
    ],
)
def test_parts_travel_as_the_specs_that_made_them(near):
    """What is stored of a mixed policy is what earlier episodes hold, and makes the same one again."""
    controller = make_controller(f"hybrid(near={near!r}, who='anyone')")
    config = controller_config(controller)
    assert config["near"] == near and config["far"] == "potential_field" and config["who"] == "anyone"
    again = controller_of(config, trusted=[f"{__name__}:Own"])
    assert controller_config(again) == config
    assert again.policies == controller.policies == (make_controller(near).name, "potential_field")
    assert controller_config(again.near) == controller_config(make_controller(near))


def test_name_that_lies_is_not_run(monkeypatch, tmp_path):
    """What a part is called may come from a file; it is taken for a spec only where it says what the part is."""
    ran = tmp_path / "ran"
    (tmp_path / "hostile.py").write_text(f"import pathlib\npathlib.Path({str(ran)!r}).touch()\n")
    monkeypatch.syspath_prepend(tmp_path)
    lying = "hybrid(near='go_straight', name=\"hybrid(near='hostile:Hostile')\")"
    controller = controller_of({"class": "socialnav_mj.controllers.hybrid:Hybrid", "near": lying})
    assert spec_of(controller.near).startswith("hybrid(near='go_straight', ")
    assert not ran.exists()


def test_controllers_that_were_never_a_spec_get_one():
    assert spec_of(Own(knob=1)) == f"{__name__}:Own(knob=1, name='own')"
    assert spec_of(Own(knob=1, name=f"{__name__}:Own(knob=2)")).startswith(f"{__name__}:Own(knob=1, name=")
    for controller in (PotentialField(repulsion_gain=3.0), PotentialField(name="PF"), GoStraight(), Own(knob=1)):
        assert controller_config(make_controller(spec_of(controller))) == controller_config(controller)
