"""Crowds as environments of Gymnasium and PettingZoo: their own checkers, and what the tasks say."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from scenes import TINY, recording_of, stand, walk

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits, make_controller
from socialnav_mj.environment import build_environment
from socialnav_mj.envs import ENVIRONMENT_ID, SCENARIOS
from socialnav_mj.envs.single import CrowdEnv
from socialnav_mj.features import feature_set, running_state, view_of
from socialnav_mj.recordings import load_recording
from socialnav_mj.recordings.draw import replaced_people
from socialnav_mj.recordings.window import excerpt

FIRST = ENVIRONMENT_ID.format(number=1)
CROSSING = recording_of(
    walk([(0.0, 0.0), (4.0, 0.0)], 1.0), walk([(2.0, -6.0), (2.0, 6.0)], 1.0), walk([(4.0, 1.0), (0.0, 1.0)], 1.0)
)
SEES_AND_ACTS = pytest.mark.parametrize("kind", [{}, {"observation": "dict", "action": "wheels"}], ids=["flat", "dict"])


def to_the_goal(seen) -> np.ndarray:
    """Full speed towards the goal of a flat observation."""
    bearing = np.arctan2(seen[1], seen[0])
    return np.array([2.0 * max(np.cos(bearing), 0.0) - 1.0, np.clip(2.0 * bearing, -1.0, 1.0)], dtype=np.float32)


def played(env, action=to_the_goal, **reset):
    """All steps of an episode: (observation, reward, terminated, truncated, info)."""
    seen, _ = env.reset(**reset)
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(action(seen)))
        seen = steps[-1][0]
    return steps


# The checkers of others


@pytest.mark.parametrize("number", SCENARIOS)
@SEES_AND_ACTS
def test_gymnasiums_checker_has_nothing_to_say(number, kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(ENVIRONMENT_ID.format(number=number), dataset=TINY, **kind)
        check_env(env.unwrapped)


@SEES_AND_ACTS
def test_stable_baselines3s_checker_has_nothing_to_say(kind):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gymnasium.make(FIRST, dataset=TINY, **kind).unwrapped)


@SEES_AND_ACTS
def test_pettingzoos_checkers_have_nothing_to_say(kind):
    checkers = pytest.importorskip("pettingzoo.test")
    from socialnav_mj.envs.parallel import parallel_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checkers.parallel_api_test(parallel_env(scenario=4, dataset=TINY, **kind), num_cycles=1000)
        checkers.parallel_seed_test(lambda: parallel_env(scenario=4, dataset=TINY, **kind))


@pytest.mark.parametrize(
    ("code", "loads_mujoco"),
    [
        ("import socialnav_mj.envs; gymnasium.spec('SocialNavMJ/Scenario1-v0')", False),
        (f"gymnasium.make('socialnav_mj.envs:SocialNavMJ/Scenario1-v0', dataset={str(TINY)!r})", True),
    ],
)
def test_gymnasium_finds_the_scenarios_after_an_import_or_with_the_modules_name(code, loads_mujoco, tmp_path):
    code = f"import sys, gymnasium; {code}; print('mujoco' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert found.stdout.split() == [str(loads_mujoco)]


# One agent


def test_the_lone_robot_arrives_and_its_reward_is_its_progress():
    env = CrowdEnv(dataset=recording_of(walk([(0.0, 0.0), (3.0, 0.0)], 1.0)), others="people")
    steps = played(env, seed=0)
    *_, (seen, _, terminated, truncated, info) = steps
    assert terminated and not truncated and info["outcome"] == "arrived" and info["collisions"] == 0
    np.testing.assert_array_equal(seen, [0.0] * 54 + [1.0, 0.0])
    # 3 m less the distance at which it has arrived, and 5 for that
    assert 5.0 + 2.5 <= sum(reward for _, reward, *_ in steps) <= 5.0 + 3.0
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset first"):
        env.step(np.zeros(2))


@pytest.mark.parametrize("mode", ["retire", "continue"])
def test_a_collision_ends_the_run_unless_it_may_go_on(mode):
    crowd = recording_of(walk([(0.0, 0.0), (6.0, 0.0)], 1.0), stand((3.0, 0.0), 0.0, 60.0))
    steps = played(CrowdEnv(dataset=crowd, others="people", on_collision=mode), seed=0)
    _, reward, terminated, truncated, info = steps[-1]
    assert info["collisions"] >= 1 and min(reward for _, reward, *_ in steps) < -4.0
    assert (terminated, info["outcome"]) == (True, "collided") if mode == "retire" else truncated or terminated
    if mode == "retire":
        assert reward < -4.0


def test_a_deadline_truncates():
    env = CrowdEnv(dataset=recording_of(walk([(0.0, 0.0), (1.2, 0.0)], 1.0)), others="people")
    steps = played(env, lambda _: np.array([-1.0, 0.0]), seed=0)
    assert len(steps) == 87 and steps[-1][3] and not steps[-1][2] and steps[-1][4]["outcome"] == "timed_out"


def test_one_among_robots_does_what_it_does_in_the_whole_scene():
    """The draw's first agent under the same controller as the others: the episode is the scene's own, to the bit."""
    scenario = Scenario(share=1.0, seed=5, on_collision="retire")
    whole = build_environment(CROSSING, scenario)
    controller = make_controller("potential_field_capped")
    controller.reset(limits := Limits.of(scenario))
    time_step, slot, states = whole.reset(), None, []
    env = CrowdEnv(scenario=4, share=1.0, dataset=CROSSING, others="potential_field_capped")
    seen, info = env.reset(options={"draw": 5, "person": 1})
    assert (info["draw"], info["person"], info["time"]) == (5, 1, 0.0)
    for _ in range(12):
        slot = int(np.flatnonzero(time_step.observation["person"] == 1)[0])
        states.append(running_state(feature_set("continuous")(view_of(time_step.observation, np.array([slot]))))[0])
        np.testing.assert_allclose(seen, states[-1], atol=1e-6)
        wheel_speed = controller.act(time_step.observation)
        twist = limits.track and np.array(
            [
                [
                    0.5 * limits.wheel_radius * wheel_speed[slot].sum(),
                    limits.wheel_radius * (wheel_speed[slot, 1] - wheel_speed[slot, 0]) / limits.track,
                ]
            ]
        )
        seen, reward, *_ = env.step(limits.action_of_twist(twist)[0])
        time_step = whole.step(wheel_speed)
        assert reward == pytest.approx(time_step.reward[slot], abs=1e-9)


def test_others_are_people_or_robots():
    for others, robots in (("people", 0), ("go_straight", 2)):
        env = CrowdEnv(scenario=4, share=1.0, dataset=CROSSING, others=others, observation="dict", people=5)
        seen, _ = env.reset(options={"draw": 0, "person": 1})
        assert seen["people_are_agents"].sum() == robots and seen["people_mask"].tolist() == [1, 1, 0, 0, 0]


def test_dictionary_tells_where_the_nearest_are_and_how_they_move():
    """Robot 1 at the origin facing along x; person 3 at (4, 1) walking back, person 2 at (2, -6) walking up."""
    env = CrowdEnv(scenario=1, dataset=CROSSING, others="people", observation="dict", people=3, share=1.0)
    seen, _ = env.reset(options={"draw": 0, "person": 1})
    for key, values in {
        "goal": [4.0, 0.0],
        "people_ahead": [4.0, 2.0, 0.0],
        "people_left": [1.0, -6.0, 0.0],
        "people_velocity_ahead": [-1.0, 0.0, 0.0],
        "people_velocity_left": [0.0, 1.0, 0.0],
        "people_mask": [1.0, 1.0, 0.0],
    }.items():
        np.testing.assert_allclose(seen[key], values, atol=1e-3, err_msg=key)


def test_wheels_and_twist_are_two_names_of_the_same_motion():
    limits = Limits.of(Scenario())
    action = np.array([[0.2, -0.3], [-1.0, 0.0], [1.0, 0.0]])
    wheel_speed = limits.wheel_speed_of_action(action)
    fastest = (limits.max_speed + 0.5 * limits.track * limits.max_yaw_rate) / limits.wheel_radius
    np.testing.assert_allclose(limits.wheel_speed_of_action(wheel_speed / fastest, "wheels"), wheel_speed, atol=1e-9)
    np.testing.assert_allclose(limits.action_of_twist(limits.twist_of_action(action)), action, atol=1e-9)


def test_what_is_not_allowed_is_named():
    with pytest.raises(ValueError, match="scenario = 5 is not allowed; allowed: 1, 2, 3, 4"):
        CrowdEnv(scenario=5)
    with pytest.raises(ValueError, match="action = 'torque' is not allowed; allowed: twist, wheels"):
        CrowdEnv(dataset=TINY, action="torque")
    with pytest.raises(ValueError, match="observation = 'image' is not allowed; allowed: flat, dict"):
        CrowdEnv(dataset=TINY, observation="image")
    env = CrowdEnv(dataset=TINY)
    with pytest.raises(ValueError, match="option person = 'a' is not allowed; allowed: integers >= 0"):
        env.reset(options={"person": "a"})
    with pytest.raises(ValueError, match="unknown options drw; available: draw, person"):
        env.reset(options={"drw": 1})
    tiny = load_recording(TINY)
    (only,) = tiny.ids[replaced_people(tiny, share=0.1, seed=3, minimum_displacement=1.0)]
    other = int(next(person for person in tiny.ids if person != only))
    with pytest.raises(ValueError, match=rf"draw 3 does not replace person {other}; it replaces \[{only}\]"):
        env.reset(options={"draw": 3, "person": other})


def test_excerpt_cuts_beginnings_alone():
    part = excerpt(CROSSING, 1.0, 2.0)
    np.testing.assert_allclose(part.start, [(1.0, 0.0), (2.0, -5.0), (3.0, 1.0)], atol=1e-6)
    np.testing.assert_allclose(part.end, CROSSING.end, atol=1e-9)
    late = recording_of(walk([(0.0, 0.0), (3.0, 0.0)], 1.0), walk([(0.0, 0.0), (3.0, 0.0)], 1.0, begin=5.0))
    assert excerpt(late, 1.0, 4.0).n_people == 1
    with pytest.raises(ValueError, match="excerpt from 2 to 1 s is not allowed"):
        excerpt(CROSSING, 2, 1)


# All agents at once


def vector(num_envs=4, **kwargs):
    return gymnasium.make_vec(ENVIRONMENT_ID.format(number=4), num_envs=num_envs, dataset=TINY, share=1.0, **kwargs)


@SEES_AND_ACTS
def test_vector_environment_masks_empty_slots_and_hands_over_last_observations(kind):
    env = vector(**kind)
    assert env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP and env.num_envs == 4
    seen, infos = env.reset(seed=1)
    random, ended = np.random.default_rng(0), []
    while len(ended) < 3:
        assert seen in env.observation_space
        under_way = infos["under_way"]
        for values in seen.values() if isinstance(seen, dict) else [seen]:
            assert not values[~under_way].any()
        before = under_way
        seen, reward, terminated, truncated, infos = env.step(random.uniform(-0.2, 1.0, (4, 2)))
        np.testing.assert_array_equal(infos["active"], before)
        done = terminated | truncated
        assert not done[~before].any() and not reward[~before].any()
        assert done.any() == ("final_obs" in infos)
        for slot in np.flatnonzero(done):
            assert infos["final_obs"][slot] in env.single_observation_space
            ended.append(infos["outcome"][slot])
            assert (ended[-1] == "timed_out") == truncated[slot]


def test_vector_environment_repeats_a_seed_and_draws_on_without():
    env, firsts = vector(), []
    for seed in (7, None, 7, 8):
        env.reset(seed=seed)
        firsts.append(env.unwrapped._crowd.environment.task.scenario.seed)
    assert firsts[0] == firsts[2] and len(set(firsts)) == 3


def test_vector_environment_with_too_few_slots_says_so():
    with pytest.raises(ValueError, match="at most n_slots = 1 agents at once; allow more slots"):
        vector(num_envs=1)


def test_parallel_environment_has_everybody_once_in_order_of_appearance():
    pytest.importorskip("pettingzoo")
    from socialnav_mj.envs.parallel import parallel_env

    late = recording_of(walk([(0.0, 0.0), (2.0, 0.0)], 1.0, begin=20.0), walk([(0.0, 5.0), (2.0, 5.0)], 1.0))
    env = parallel_env(scenario=1, share=1.0, dataset=late)
    seen, infos = env.reset(seed=0)
    assert env.possible_agents == ["agent_0", "agent_1"] and env.agents == ["agent_0"]
    assert infos["agent_0"]["person"] == 2
    outcomes = {}
    while env.agents:
        driven = list(env.agents)
        seen, _, over, late_, infos = env.step({name: to_the_goal(seen[name]) for name in driven})
        assert set(seen) == set(driven) | set(env.agents)
        outcomes |= {name: info["outcome"] for name, info in infos.items() if over[name] or late_[name]}
    assert outcomes == {"agent_0": "arrived", "agent_1": "arrived"}
