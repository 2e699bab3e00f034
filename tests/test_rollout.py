"""The loop of an episode: the same twice, any controller with the protocol, and a record of what was commanded."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from scenes import TINY, busy_crowd, environment_of, stand, walk

import tasks
from socialnav_mj import recorder
from socialnav_mj.cast import cast_recording
from socialnav_mj.controllers import GoStraight, PotentialField
from socialnav_mj.environment import build_environment
from socialnav_mj.episode import Episode, EpisodeError, Outcome, Partner
from socialnav_mj.geometry import twist_of_wheel_speed
from socialnav_mj.metrics import per_agent
from socialnav_mj.rollout import rollout

DT = 0.2  # control step [s]


def busy(**kwargs):
    return environment_of(*busy_crowd(), agents=[2, 3, 5, 7], **kwargs)


def arrays(episode):
    values = {field.name: getattr(episode, field.name) for field in fields(Episode)}
    return {name: value.tobytes() for name, value in values.items() if isinstance(value, np.ndarray)}


class Noted:
    """Not derived from anything of the package; returns one buffer again and again and notes what it returned."""

    name = "noted"

    def reset(self, limits, *, seed=0):
        self.limits, self.seed, self.returned, self.seen = limits, seed, [], []

    def act(self, observation):
        if not self.returned:
            self.buffer = np.zeros((len(observation["active"]), 2))
        self.buffer[:] = 2.0 + 0.1 * len(self.returned)
        self.returned.append(self.buffer.copy())
        self.seen.append(observation)
        return self.buffer


class Switching(Noted):
    """Says that two policies take turns."""

    name = "switching"
    policies = ("even", "odd")

    @property
    def active_policy(self):
        return np.full(len(self.buffer), (len(self.returned) - 1) % 2)


def test_same_run_twice_is_bitwise_the_same_in_new_and_in_used_environments():
    environment = busy()
    one, again, other = (rollout(e, PotentialField(), scenario_name="made") for e in (environment, environment, busy()))
    assert arrays(one) == arrays(again) == arrays(other)
    assert one.metadata == again.metadata == other.metadata
    assert rollout(environment, GoStraight()).metadata["state_hash"] != one.metadata["state_hash"]


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"pedestrian_body": "compliant"},
        {"pedestrians": "yielding", "plant": "unicycle"},
        {"pedestrians": "weak", "pedestrian_body": "compliant"},
    ],
)
@pytest.mark.parametrize(("slots", "robots"), [(5, 5), (0, -3)])
def test_size_of_the_pool_changes_no_bit_of_an_episode(settings, slots, robots, monkeypatch):
    """A pool that is larger, and one of a single robot that grows while agents and people touch."""
    environment = busy(**settings)
    expected, n_agents = rollout(environment, PotentialField(), scenario_name="made"), environment.physics.n_agents
    assert len(expected.contact_time) and n_agents == 4

    def other(*args, **kwargs):
        cast = cast_recording(*args, **kwargs)
        return replace(cast, n_agent_slots=n_agents + slots, n_likely_agents=n_agents + robots)

    monkeypatch.setattr("socialnav_mj.task.cast_recording", other)
    task = environment.task
    environment = build_environment(task.recording, task.scenario, robots="likely")
    built = [environment.physics.model.nu // 2]
    episode = rollout(environment, PotentialField(), scenario_name="made")
    built.append(environment.physics.model.nu // 2)
    assert built == [n_agents + robots, n_agents + max(robots, 0)] and environment.physics.n_agents == n_agents + slots
    assert arrays(episode) == arrays(expected)
    assert episode.metadata == expected.metadata


def test_copy_that_cannot_grow_says_so():
    task = busy().task
    physics = build_environment(task.recording, task.scenario, robots="likely").physics
    with pytest.raises(ValueError, match="slot 8 has no robot, and this copy of the physics cannot build one"):
        physics.copy().place_agent(8, np.zeros(2), 0.0)


def test_lonely_robot_goes_straight_to_its_goal():
    """6 m less the goal radius at 1 m/s, and 0.45 s to gain speed cost about half of that: 5.6 to 6.2 s."""
    episode = rollout(environment_of(walk([(0, 0), (6, 0)], 1.0), stand((9, 9), 0, 1)), GoStraight())
    values = {name: value[0] for name, value in per_agent(episode).items()}
    assert values["success"] and 5.6 <= values["completion_time"] <= 6.2
    assert abs(episode.agent_position[episode.window(0), 0, 1]).max() < 0.01
    np.testing.assert_allclose(values["path_length"], 5.5, atol=0.15)
    assert episode.agent_outcome.tolist() == [Outcome.ARRIVED]


def test_own_controller_is_recorded_as_it_commanded():
    environment, controller = busy(), Noted()
    episode = rollout(environment, controller, scenario_name="made")
    assert controller.seed == environment.task.scenario.seed
    assert len(controller.returned) == len(episode.time) - 1
    active = episode.agent_active
    expected = np.broadcast_to((2.0 + 0.1 * np.arange(len(episode.time)))[:, None, None], (*active.shape, 2))
    np.testing.assert_array_equal(episode.agent_wheel_speed[active], expected[active])
    assert np.isnan(episode.agent_wheel_speed[~active]).all()
    assert episode.policies == ("noted",) and (episode.agent_policy[active] == 0).all()
    config = episode.metadata["controller_config"]
    assert config["class"] == f"{__name__}:Noted" and f"{__name__}:Noted in test_rollout.py" in config["sources"]


def test_controller_sees_what_is_recorded():
    environment, controller = busy(), Noted()
    episode = rollout(environment, controller)
    seen = 0
    for k, observation in enumerate(controller.seen):
        for slot in np.flatnonzero(observation["active"]):
            agent = int(np.flatnonzero(episode.agent_person == observation["person"][slot])[0])
            np.testing.assert_array_equal(observation["position"][slot], episode.agent_position[k, agent])
            np.testing.assert_array_equal(observation["heading"][slot], episode.agent_heading[k, agent])
            to_goal = np.linalg.norm(episode.agent_goal[agent] - episode.agent_position[k, agent])
            assert np.linalg.norm(observation["goal"][slot]) == pytest.approx(to_goal)
            seen += 1
    assert seen == episode.agent_active.sum() > 0


def test_policies_that_take_turns_are_recorded():
    episode = rollout(busy(), Switching())
    assert episode.policies == ("even", "odd")
    for k in range(len(episode.time)):
        assert set(episode.agent_policy[k, episode.agent_active[k]].tolist()) <= {k % 2}


def test_commands_within_the_limits_are_followed():
    """A constant twist of 0.6 m/s and 0.5 rad/s: the mean of the measured one is within 2 %."""

    class Turning(Noted):
        def act(self, observation):
            return self.limits.wheel_speed(np.tile([0.6, 0.5], (len(observation["active"]), 1)))

    episode = rollout(environment_of(walk([(0, 0), (9, 0)], 1.0), stand((19, 19), 0, 1)), Turning())
    steady = slice(10, 60)
    speed = np.linalg.norm(episode.agent_velocity[steady, 0], axis=-1)
    assert speed.mean() == pytest.approx(0.6, rel=0.02)
    assert episode.agent_yaw_rate[steady, 0].mean() == pytest.approx(0.5, rel=0.02)
    velocity = 0.5 * (episode.agent_velocity[11:60, 0] + episode.agent_velocity[10:59, 0])
    np.testing.assert_allclose(np.diff(episode.agent_position[steady, 0], axis=0) / DT, velocity, atol=0.005)
    command = twist_of_wheel_speed(episode.agent_wheel_speed[steady, 0], wheel_radius=0.06, track=0.24)
    np.testing.assert_allclose(command, np.tile([0.6, 0.5], (50, 1)), rtol=1e-12)


@pytest.mark.parametrize(
    ("action", "named"),
    [
        (lambda n: np.zeros((n, 3)), r"action has shape \(\d, 3\); expected \(\d, 2\)"),
        (lambda n: np.zeros(2 * n), r"action has shape \(\d,\); expected"),
        (lambda n: np.zeros((0, 2)), r"action has shape \(0, 2\); expected"),
        (lambda n: None, r"action has shape \(\); expected"),
        (lambda n: np.full((n, 2), np.nan), r"action\[0\] = \[nan nan\] of an active agent at 0.00 s; expected finite"),
    ],
)
def test_action_that_is_not_allowed_is_named(action, named):
    class Wrong(Noted):
        def act(self, observation):
            return action(len(observation["active"]))

    environment = environment_of(walk([(0, 0), (6, 0)], 1.0), stand((9, 9), 0, 1))
    with pytest.raises(ValueError, match=named):
        rollout(environment, Wrong())


@pytest.mark.parametrize("policy", [0, [0], np.full(9, 0), "x"])
def test_active_policy_that_is_not_allowed_is_named(policy):
    controller = type("Wrong", (Noted,), {"active_policy": policy})()
    with pytest.raises(ValueError, match=r"active_policy = .* of controller 'noted'; expected shape \(\d,\)"):
        rollout(busy(), controller)


class Scoring(Switching):
    """Says what its two policies would have cost: the number of its call, and twice that; nothing of empty slots."""

    @property
    def scores(self):
        cost = np.where(self.seen[-1]["active"], len(self.returned), np.nan)
        return np.stack([cost, 2.0 * cost], axis=1)


def test_scores_are_recorded_in_single_precision_for_agents_under_way():
    episode = rollout(busy(), Scoring())
    call = np.arange(1.0, len(episode.time) + 1.0)[:, None]
    expected = np.where(episode.agent_active, call, np.nan)
    assert episode.agent_scores.dtype == np.float32 and 0.0 < episode.agent_active.mean() < 1.0
    np.testing.assert_array_equal(episode.agent_scores, np.stack([expected, 2.0 * expected], axis=2))
    assert rollout(busy(), Switching()).agent_scores is None


@pytest.mark.parametrize(
    "scores", [0.0, np.zeros(9), np.full((2, 1), np.nan), np.full((2, 1), 1e300), np.zeros((2, 3))]
)
def test_scores_that_are_not_allowed_are_named(scores):
    environment = environment_of(walk([(0, 0), (6, 0)], 1.0), walk([(0, 3), (6, 3)], 1.0), agents=(1, 2))
    controller = type("Wrong", (Noted,), {"scores": scores})()
    with pytest.raises(ValueError, match=r"scores = [\s\S]* of controller 'noted'; expected shape \(2, 1\)"):
        rollout(environment, controller)


def test_progress_tells_the_simulated_time_that_has_passed():
    told = []
    episode = rollout(busy(), Noted(), progress=told.append)
    assert told == pytest.approx(np.arange(1, len(told) + 1) * 5.0)
    assert 0.0 <= episode.time[-1] - told[-1] < 5.0


def test_episode_that_is_cut_says_who_was_under_way_and_who_never_came():
    walks = (walk([(0, 0), (9, 0)], 1.0), walk([(0, 3), (9, 3)], 1.0, begin=4.0), stand((19, 19), 0, 1))
    environment = environment_of(*walks, agents=[1, 2], time_limit=2.0)
    episode = rollout(environment, GoStraight())
    assert episode.agent_outcome.tolist() == [Outcome.UNFINISHED, Outcome.NEVER_SPAWNED]
    np.testing.assert_allclose(episode.agent_end_time, [2.0, np.nan])
    assert episode.agent_policy[-1].tolist() == [-1, -1] and len(episode.time) == 11


def test_robot_that_lies_on_its_back_ends_its_run_overturned_and_leaves_the_scene():
    """Turned over by force at 1 s: it fails, is taken out at the next step, and the other one drives on."""
    walks = (walk([(0, 0), (9, 0)], 1.0), walk([(0, 3), (9, 3)], 1.0), stand((19, 19), 0, 20))
    environment = environment_of(*walks, agents=[1, 2])

    class Vandal(GoStraight):
        def act(self, observation):
            task, data = environment.task, environment.physics.data
            if task.step == 5:
                data.qpos[2:7] = [0.12, 0.0, 1.0, 0.0, 0.0]  # half a turn about its x axis, on its wheels
            return super().act(observation)

    episode = rollout(environment, Vandal())
    assert episode.agent_outcome.tolist() == [Outcome.OVERTURNED, Outcome.ARRIVED]
    assert episode.agent_end_time[0] == pytest.approx(1.2)
    assert episode.agent_tilt[6, 0] > 2.4 and np.nanmax(episode.agent_tilt[:6, 0]) < 0.1
    assert np.isnan(episode.agent_tilt[7:, 0]).all() and np.nanmax(episode.agent_tilt[:, 1]) < 0.1
    values = per_agent(episode)
    assert values["overturned"].tolist() == [True, False] and values["success"].tolist() == [False, True]
    assert values["maximum_tilt"][0] > 2.4 and values["completion_censored"].tolist() == [True, False]


def test_touch_of_a_standing_person_is_recorded_with_its_physics():
    """A person of radius 0.15 m stands in the way at 3 m: the bodies meet at 2.85 m, at full speed."""
    episode = rollout(environment_of(walk([(0, 0), (6, 0)], 1.0), stand((3.0, 0.0), 0, 30)), GoStraight())
    assert episode.contact_partner_kind[0] == Partner.PEDESTRIAN and not per_agent(episode)["success"][0]
    np.testing.assert_allclose(episode.contact_normal[0], [1.0, 0.0], atol=0.02)
    assert episode.contact_closing_speed[0] == pytest.approx(1.0, abs=0.03)
    np.testing.assert_allclose(episode.contact_position[0], [2.85, 0.0], atol=0.02)
    assert episode.contact_impact_impulse[0] > 0.0 and episode.contact_impact_force[0] > 0.0


def test_touch_of_two_agents_stands_in_two_mirrored_rows():
    walks = (walk([(0, 0), (6, 0)], 1.0), walk([(6, 0), (0, 0)], 1.0), stand((19, 19), 0, 1))
    episode = rollout(environment_of(*walks, agents=[1, 2]), GoStraight())
    assert episode.contact_agent[:2].tolist() == [0, 1] and episode.contact_partner[:2].tolist() == [1, 0]
    np.testing.assert_array_equal(episode.contact_normal[0], -episode.contact_normal[1])
    np.testing.assert_array_equal(episode.contact_impact_impulse[::2], episode.contact_impact_impulse[1::2])
    assert episode.contact_closing_speed[0] == pytest.approx(episode.contact_closing_speed[1])
    assert episode.contact_closing_speed[0] == pytest.approx(2.0, abs=0.06)


def test_metadata_hold_the_resolved_configuration_as_json():
    environment = tasks.load("scenario_4", {"dataset": TINY, "seed": 3, "robot_radius": 0.18})
    metadata = rollout(environment, PotentialField(attraction_limit=None), scenario_name="scenario_4").metadata
    assert json.loads(json.dumps(metadata)) == metadata
    assert metadata["scenario"]["robot"]["radius"] == 0.18 and metadata["scenario"]["share"] == 0.9
    assert metadata["controller_config"]["attraction_limit"] is None and metadata["draw"] == 3
    assert metadata["recording"]["name"] == "tiny" and len(metadata["recording"]["checksum"]) == 64
    assert {"mujoco", "dm-control", "numpy", "socialnav-mj"} <= set(metadata["versions"])
    assert len(metadata["state_hash"]) == 64


def test_a_record_that_no_file_may_hold_is_refused_when_it_has_grown_too_large(monkeypatch):
    """17 samples of 4 agents of 80 bytes and of the 2 of 6 people of 40 bytes who have appeared."""
    environment = busy()
    monkeypatch.setattr("socialnav_mj.recorder.MAX_BYTES", 16 * (80 * 4 + 40 * 2))
    with pytest.raises(EpisodeError, match=r"at 3 s the record of 4 agents and 2 people takes 6800 bytes.*with --part"):
        rollout(environment, GoStraight())
    assert environment.task.step == 16


def test_the_size_at_which_a_record_is_refused_is_what_its_samples_take():
    episode = rollout(busy(), GoStraight())
    values = {field.name: getattr(episode, field.name) for field in fields(Episode)}
    sampled = {name: v for name, v in values.items() if np.ndim(v) > 1 and len(v) == len(episode.time)}
    agents = sum(v.nbytes for name, v in sampled.items() if name.startswith("agent"))
    people = sum(v.nbytes for name, v in sampled.items() if name.startswith("pedestrian"))
    assert agents == recorder._AGENT_BYTES * len(episode.time) * episode.n_agents
    assert people == recorder._PERSON_BYTES * len(episode.time) * episode.n_pedestrians
