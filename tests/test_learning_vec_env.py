"""A crowd as a stable-baselines3 VecEnv: runs end, scenes follow one another, empty slots stand aside."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from scenes import TINY, recording_of, stand, walk
from stable_baselines3.common.vec_env import VecCheckNan, VecEnv, VecMonitor

from socialnav_mj.cast import NOBODY
from socialnav_mj.envs.guided import CrowdSettings
from socialnav_mj.envs.sb3 import CrowdVecEnv
from socialnav_mj.episode import Outcome
from socialnav_mj.features import FEATURE_SETS, feature_set, running_state, view_of
from socialnav_mj.recordings import load_recording

SHORT = walk([(0.0, 0.0), (1.2, 0.0)], 1.0)
"""Arrives after 0.7 m at the latest, is late after 17.4 s."""


def crowd(*recordings, shares=(1.0,), n_slots=4, features="continuous", seed=0, **kwargs) -> CrowdVecEnv:
    settings = CrowdSettings(
        recordings=recordings or (load_recording(TINY),),
        features=feature_set(features),
        shares=shares,
        n_slots=n_slots,
        **kwargs,
    )
    return CrowdVecEnv(settings, seed=seed)


def to_the_goal(states):
    """Full speed towards the goal; -1, 0 (stand) in empty slots."""
    bearing = np.arctan2(states[:, 1], states[:, 0])
    under_way = states[:, 2] > 0.0
    action = np.stack([2.0 * np.maximum(np.cos(bearing), 0.0) - 1.0, np.clip(2.0 * bearing, -1.0, 1.0)], axis=1)
    return np.where(under_way[:, None], action, [-1.0, 0.0]).astype(np.float32)


def run_to_the_end(env, action=to_the_goal, most=200):
    """States, dones and infos of every step until a run has ended."""
    states = env.reset()
    for _ in range(most):
        states, rewards, dones, infos = env.step(action(states))
        if dones.any():
            return states, rewards, dones, infos
    raise AssertionError(f"no run ended in {most} steps")


# How runs end


def test_arrival_ends_in_the_goals_absorbing_state():
    states, rewards, dones, infos = run_to_the_end(crowd(recording_of(SHORT)))
    assert dones.tolist() == [True, False, False, False]
    assert infos[0]["outcome"] == Outcome.ARRIVED and not infos[0]["TimeLimit.truncated"]
    np.testing.assert_array_equal(infos[0]["terminal_observation"], [0.0] * 54 + [1.0, 0.0])
    assert rewards[0] > 5.0 and not rewards[1:].any()
    assert states[0, 2] > 0.0  # the next scene has begun


def test_collision_ends_in_its_absorbing_state():
    """Somebody stands in the middle of the way."""
    env = crowd(recording_of(walk([(0.0, 0.0), (6.0, 0.0)], 1.0), stand((3.0, 0.0), 0.0, 60.0)))
    _, rewards, dones, infos = run_to_the_end(env)
    assert dones[0] and infos[0]["outcome"] == Outcome.COLLIDED and not infos[0]["TimeLimit.truncated"]
    np.testing.assert_array_equal(infos[0]["terminal_observation"], [0.0] * 54 + [0.0, 1.0])
    assert rewards[0] < -4.0


def test_deadline_truncates_with_the_last_state():
    """Standing still: 17.4 s are 87 steps; the last state is no absorbing one, the goal is still 1.2 m ahead."""
    env = crowd(recording_of(SHORT))
    env.reset()
    steps = 0
    dones = [False]
    while not dones[0]:
        _, _, dones, infos = env.step(np.tile([-1.0, 0.0], (4, 1)))
        steps += 1
    assert steps == 87
    assert infos[0]["TimeLimit.truncated"] and infos[0]["outcome"] == Outcome.TIMED_OUT
    last = infos[0]["terminal_observation"]
    assert not last[-2:].any()
    np.testing.assert_allclose(last[[0, 2]], [1.0, 0.12], atol=1e-3)


@pytest.mark.parametrize("features", FEATURE_SETS)
def test_every_step_keeps_the_rules_of_slots(features):
    """Random actions through several scenes of two recordings."""
    random = np.random.default_rng(0)
    tiny = load_recording(TINY)
    env = crowd(tiny, recording_of(SHORT), shares=(0.4, 1.0), features=features)
    states = env.reset()
    size = feature_set(features).size
    scenes = [env.environment]
    outcomes = set()
    n_done = 0
    while len(scenes) < 6:
        task = env.environment.task
        under_way = np.zeros(env.num_envs, dtype=bool)
        under_way[: task.cast.n_agent_slots] = task.slot_agent != NOBODY
        assert not states[~under_way].any() and (states[under_way, :size] != 0.0).any(axis=1).all()
        assert not states[:, size:].any()
        action = random.uniform([0.0, -1.0], 1.0, (env.num_envs, 2))
        before = states
        states, rewards, dones, infos = env.step(action)
        assert states.dtype == np.float32 and states.shape == before.shape == (env.num_envs, size + 2)
        assert np.isfinite(states).all()
        assert [info["active"] for info in infos] == under_way.tolist()
        assert not dones[~under_way].any() and not rewards[~under_way].any()
        for slot, info in enumerate(infos):
            assert ("terminal_observation" in info) == ("outcome" in info) == bool(dones[slot])
            if dones[slot]:
                n_done += 1
                outcomes.add(info["outcome"])
                late = info["outcome"] == Outcome.TIMED_OUT
                assert info["TimeLimit.truncated"] == late
                assert info["terminal_observation"].dtype == np.float32
                assert info["terminal_observation"][-2:].sum() == (0.0 if late else 1.0)
        if env.environment is scenes[-1]:
            assert not states[dones].any()  # a slot that just became free is not used again at once
        else:
            assert (task.outcome >= 0).all()  # every run of the old scene has ended
            scenes.append(env.environment)
    # The recordings take turns, and then the shares: scenes 0 and 1 at 0.4, 2 and 3 at 1.0, 4 at 0.4 again.
    names = [scene.task.recording.n_people for scene in scenes]
    shares = [scene.task.scenario.share for scene in scenes]
    assert names == [3, 1, 3, 1, 3, 1] and shares == [0.4, 0.4, 1.0, 1.0, 0.4, 0.4]
    assert n_done == sum(scene.task.cast.n_agents for scene in scenes[:-1])


@pytest.mark.parametrize("features", FEATURE_SETS)
def test_states_are_the_features_of_the_tasks_observation(features):
    """What a policy sees in training is what `replay_irl` sees in an evaluation."""
    env = crowd(features=features)
    states = env.reset()
    for _ in range(15):
        observation = env.environment.task.get_observation(env.environment.physics)
        rows = np.flatnonzero(observation["active"])
        expected = running_state(feature_set(features)(view_of(observation, rows)))
        np.testing.assert_allclose(states[rows], expected, atol=1e-6)
        states = env.step(to_the_goal(states))[0]


def test_action_means_what_it_means_for_the_controller():
    """Speed (a + 1) / 2 of the limit: half a metre a second from a = 0, and a turn at half the largest yaw rate."""
    env = crowd(recording_of(walk([(0.0, 0.0), (8.0, 0.0)], 1.0)))
    states = env.reset()
    for _ in range(10):
        states = env.step(np.zeros((4, 2)))[0]
    np.testing.assert_allclose(states[0, 4:6], [0.5, 0.0], atol=0.02)
    for _ in range(5):
        states = env.step(np.tile([-1.0, 0.5], (4, 1)))[0]
    np.testing.assert_allclose(states[0, 4:6], [0.0, 0.5], atol=0.05)


def test_guides_action_brings_agents_home():
    """The guide's command in the actor's units: go_straight arrives where nobody is in the way."""
    env = crowd(recording_of(walk([(0.0, 0.0), (3.0, 2.0)], 1.0)), guide="go_straight")
    action = env.guide_action()
    assert action.shape == (4, 2) and not action[1:].any()
    _, _, _, infos = run_to_the_end(env, lambda _: env.guide_action())
    assert infos[0]["outcome"] == Outcome.ARRIVED


def test_same_seed_gives_the_same_states_and_another_other_scenes():
    runs = []
    for seed in (3, 3, 4):
        env = crowd(shares=(0.4,), seed=seed)
        states = [env.reset()]
        for _ in range(30):
            states.append(env.step(np.zeros((4, 2)))[0])
        runs.append(np.array(states))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_too_few_slots_are_named():
    with pytest.raises(ValueError, match=r"recording 'tiny' at share 1\.0 has at most n_slots = 1 agents at once"):
        crowd(n_slots=1)


# stable-baselines3's conventions


def test_vec_env_runs_in_stable_baselines3s_wrappers():
    """VecCheckNan raises on any value that is not finite; VecMonitor counts runs where slots are done."""
    env = VecMonitor(VecCheckNan(crowd(recording_of(SHORT)), raise_exception=True))
    states = env.reset()
    assert isinstance(env.unwrapped, VecEnv) and env.observation_space.contains(states[0])
    ended = 0
    for _ in range(30):
        states, _, dones, infos = env.step(to_the_goal(states))
        ended += int(dones.sum())
        assert all(("episode" in info) == done for info, done in zip(infos, dones, strict=True))
    assert ended >= 3


def test_vec_env_answers_for_every_environment():
    env = crowd(n_slots=5)
    assert env.num_envs == 5 and env.observation_space.shape == (56,)
    assert env.action_space.low.tolist() == [-1.0, -1.0] and env.action_space.high.tolist() == [1.0, 1.0]
    assert env.get_attr("num_envs") == [5] * 5 and env.get_attr("num_envs", [1, 2]) == [5, 5]
    assert env.env_is_wrapped(VecMonitor) == [False] * 5
    assert env.render_mode is None
    with pytest.raises(NotImplementedError, match="no method 'jump'"):
        env.env_method("jump")
    env.close()
