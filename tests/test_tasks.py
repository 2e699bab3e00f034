"""Every task keeps dm_env's and dm_control's conventions."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from absl.testing import absltest
from dm_control import suite
from dm_control.mujoco.wrapper import MjvOption
from dm_control.rl import control
from dm_control.suite.wrappers import action_noise, action_scale
from dm_env import specs, test_utils
from scenes import TINY, state_of, still

import socialnav_mj
import tasks
from socialnav_mj.config import SETTINGS, Robot, Scenario
from socialnav_mj.environment import make_environment
from socialnav_mj.physics import Physics


@pytest.fixture(params=tasks.ALL_TASKS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def environment(name: str) -> control.Environment:
    return tasks.load(name, {"dataset": TINY})


class _Conformance(test_utils.EnvironmentTestMixin):
    """dm_env's own tests on the hand-made recording of three people; the time limit lets episodes end in them."""

    task_name: str

    def make_object_under_test(self) -> control.Environment:
        return tasks.load(self.task_name, {"dataset": TINY, "time_limit": 2.0})

    def make_action_sequence(self) -> Iterator[np.ndarray]:
        random, spec = np.random.default_rng(0), self.environment.action_spec()
        for _ in range(25):
            yield random.uniform(spec.minimum, spec.maximum, spec.shape)


class Scenario1Test(_Conformance, absltest.TestCase):
    task_name = "scenario_1"


class Scenario2Test(_Conformance, absltest.TestCase):
    task_name = "scenario_2"


class Scenario3Test(_Conformance, absltest.TestCase):
    task_name = "scenario_3"


class Scenario4Test(_Conformance, absltest.TestCase):
    task_name = "scenario_4"


# Model


def test_every_element_that_is_used_has_a_unique_name(environment: control.Environment) -> None:
    model = environment.physics.model.ptr
    for kind, count in (("body", model.nbody), ("joint", model.njnt), ("geom", model.ngeom), ("site", model.nsite)):
        names = [getattr(model, kind)(i).name for i in range(count)]
        assert all(names), kind
        assert len(set(names)) == count, kind
    for kind, count in (("actuator", model.nu), ("camera", model.ncam), ("tendon", model.ntendon)):
        assert all(getattr(model, kind)(i).name for i in range(count)), kind
    assert model.nu == 2 * environment.physics.n_agents


def test_there_are_three_kinds_of_cameras(environment: control.Environment) -> None:
    model = environment.physics.model.ptr
    names = [model.camera(i).name for i in range(model.ncam)]
    assert names[:3] == ["top", "oblique", "agent_000/follow"]


def test_pictures_of_all_cameras_show_something(offscreen: str) -> None:
    environment = tasks.load("scenario_1", {"dataset": TINY})
    environment.reset()
    for camera in ("top", "oblique", "agent_000/follow"):
        picture = environment.physics.render(60, 80, camera_id=camera, scene_option=MjvOption())
        assert picture.shape == (60, 80, 3)
        assert picture.std() > 1.0, camera


# Specifications


def test_action_is_one_bounded_array_of_wheel_speeds(environment: control.Environment) -> None:
    spec = environment.action_spec()
    assert isinstance(spec, specs.BoundedArray)
    assert spec.shape == (environment.physics.n_agents, 2) and spec.dtype == np.float64
    assert np.isfinite(spec.minimum).all() and (spec.minimum < spec.maximum).all()
    # 1 m/s and pi/6 per 0.2 s at a wheel 0.12 m off the middle, of radius 0.06 m.
    turn = 0.12 * np.pi / 6.0 / 0.2
    np.testing.assert_allclose([spec.minimum, spec.maximum], [-turn / 0.06, (1.0 + turn) / 0.06])


def test_observation_reward_and_discount_keep_their_specifications(environment: control.Environment) -> None:
    n, m = environment.physics.n_agents, environment.physics.n_pedestrians
    spec = environment.observation_spec()
    assert {key: value.shape for key, value in spec.items()} == {
        "active": (n,),
        "person": (n,),
        "position": (n, 2),
        "heading": (n,),
        "twist": (n, 2),
        "goal": (n, 2),
        "pedestrian_position": (n, m, 2),
        "pedestrian_velocity": (n, m, 2),
        "pedestrian_mask": (n, m),
        "agent_position": (n, n, 2),
        "agent_velocity": (n, n, 2),
        "agent_mask": (n, n),
    }
    assert environment.reward_spec().shape == (n,)
    assert environment.control_timestep() == pytest.approx(0.2)
    time_step = environment.reset()
    for _ in range(400):
        for key, value in time_step.observation.items():
            spec[key].validate(value)
        if not time_step.first():
            environment.reward_spec().validate(time_step.reward)
            environment.discount_spec().validate(time_step.discount)
        if time_step.last():
            return
        time_step = environment.step(still(environment))
    raise AssertionError("the episode does not end")


def test_random_actions_within_the_specification_keep_everything_finite(environment: control.Environment) -> None:
    random, spec = np.random.default_rng(1), environment.action_spec()
    time_step = environment.reset()
    while not time_step.last():
        time_step = environment.step(random.uniform(spec.minimum, spec.maximum, spec.shape))
        values = [*time_step.observation.values(), time_step.reward, environment.physics.get_state()]
        assert all(np.isfinite(value).all() for value in values)


def test_observation_does_not_alias_the_physics_or_a_later_observation(environment: control.Environment) -> None:
    data = environment.physics.data
    held = (data.qpos, data.qvel, data.ctrl, data.mocap_pos, data.xpos)
    time_step = environment.reset()
    for _ in range(3):
        kept = {key: value.copy() for key, value in time_step.observation.items()}
        before = time_step
        time_step = environment.step(environment.action_spec().maximum * np.ones(environment.action_spec().shape))
        for key, value in before.observation.items():
            np.testing.assert_array_equal(value, kept[key], err_msg=key)
            assert not any(np.may_share_memory(value, array) for array in held)
            value[...] = 0
    again = tasks.load("scenario_1", {"dataset": TINY})
    again.reset()  # writing to observations changed no task
    assert again.task.recording.at([0.0]).present.any()


def test_action_is_left_alone(environment: control.Environment) -> None:
    environment.reset()
    action = np.full(environment.action_spec().shape, 3.0)
    action.flags.writeable = False
    environment.step(action)


def test_initial_state_is_the_same_for_equal_seeds(name: str) -> None:
    states = []
    for _ in range(2):
        environment = tasks.load(name, {"dataset": TINY, "random": 4})
        for _ in range(2):
            environment.reset()
            states.append(state_of(environment))
    assert all(np.array_equal(state, states[0]) for state in states)


def test_reward_can_be_asked_to_be_shown(name: str) -> None:
    environment = tasks.load(name, {"dataset": TINY}, visualize_reward=True)
    environment.reset()
    environment.step(still(environment))
    assert environment.task.visualize_reward


def test_environment_keywords_reach_dm_control(name: str) -> None:
    environment = tasks.load(name, {"dataset": TINY}, {"flat_observation": True})
    observation = environment.reset().observation["observations"]
    assert observation.ndim == 1 and np.isfinite(observation).all()


# Names and keywords


def test_suite_has_the_four_scenarios_of_the_paper() -> None:
    assert tasks.ALL_TASKS == ("scenario_1", "scenario_2", "scenario_3", "scenario_4")
    assert list(tasks.SHARES.values()) == [0.1, 0.3, 0.7, 0.9]
    for task_name in tasks.ALL_TASKS:
        environment = tasks.load(task_name, {"dataset": TINY})
        assert environment.task.scenario.share == tasks.SHARES[task_name]
        assert isinstance(environment.physics, Physics)


def test_package_loads_the_same_tasks() -> None:
    environment = socialnav_mj.load("scenario_3", {"dataset": TINY, "seed": 2}, {"flat_observation": True})
    assert environment.task.scenario.share == 0.7 and environment.task.scenario.seed == 2


def test_keywords_become_the_scenario() -> None:
    given: dict[str, Any] = {
        "share": 0.5,
        "seed": 8,
        "pedestrian_radius": 0.2,
        "pedestrian_body": "compliant",
        "pedestrians": "weak",
        "plant": "unicycle",
        "floor_friction": 0.5,
        "turn_limit": "per_second",
        "on_collision": "retire",
        "control_timestep": 0.1,
        "physics_timestep": 0.02,
        "goal_radius": 0.4,
        "deadline_base": 9.0,
        "deadline_per_metre": 3.0,
        "minimum_displacement": 1.5,
        "spawn_clearance": 0.1,
        "contact_rearm_time": 0.3,
    }
    of_robot = {"robot_radius": 0.21, "robot_max_speed": 0.8}
    scenario = tasks.load("scenario_1", {"dataset": TINY, **given, **of_robot}).task.scenario
    assert {key: getattr(scenario, key) for key in given} == given
    assert scenario.robot == Robot(radius=0.21, max_speed=0.8)
    assert set(SETTINGS) == {
        *given,
        *of_robot,
        "robot_model",
        "robot_wheel_radius",
        "robot_track",
        "robot_max_yaw_rate",
    }


def test_scenario_can_be_given_whole_and_changed() -> None:
    given = Scenario(share=0.7, goal_radius=0.3, robot=Robot(radius=0.2))
    scenario = make_environment(given, dataset=TINY, seed=4, robot_max_speed=0.5).task.scenario
    expected = Scenario(share=0.7, goal_radius=0.3, robot=Robot(radius=0.2, max_speed=0.5), seed=4)
    assert scenario == expected
    assert make_environment(dataset=TINY).task.scenario == Scenario()


@pytest.mark.parametrize("seed", [3, np.int64(3)])
def test_integer_random_names_the_draw(seed: Any) -> None:
    by_random = tasks.load("scenario_2", {"dataset": TINY, "random": seed}).task
    by_seed = tasks.load("scenario_2", {"dataset": TINY, "seed": seed}).task
    assert by_random.scenario == by_seed.scenario and by_random.scenario.seed == 3
    with pytest.raises(ValueError, match="seed = 1 and random = 3 are both given"):
        tasks.load("scenario_2", {"dataset": TINY, "seed": 1, "random": seed})
    state = np.random.RandomState(5)
    assert tasks.load("scenario_2", {"dataset": TINY, "seed": 1, "random": state}).task.scenario.seed == 1


@pytest.mark.parametrize(
    ("name", "task_kwargs", "message"),
    [
        (
            "scenario_5",
            {},
            r"^unknown task 'scenario_5'; available: scenario_1, scenario_2, scenario_3, scenario_4$",
        ),
        (
            "scenario_1",
            {"shares": 1, "color": 2},
            r"^unknown task_kwargs color, shares; available: share, seed, .*, dataset",
        ),
        ("scenario_1", {"environment_kwargs": {}}, r"^unknown task_kwargs environment_kwargs; available: "),
        ("scenario_1", {"dataset": TINY, "share": 2}, r"^share = 2 is not allowed; allowed: numbers in \(0, 1\]$"),
        ("scenario_1", {"dataset": TINY, "seed": 0.5}, r"^seed = 0.5 is not allowed; allowed: integers >= 0$"),
        ("scenario_1", {"dataset": TINY, "robot_radius": -1}, r"^Robot.radius = -1 is not allowed; allowed: numbers"),
        ("scenario_1", {"dataset": TINY, "on_collision": "bump"}, r"^on_collision = 'bump' .* continue, retire$"),
        ("scenario_1", {"dataset": TINY, "turn_limit": 3}, r"^turn_limit = 3 .* per_step, per_second$"),
        ("scenario_1", {"dataset": TINY, "control_timestep": 0.033}, r"^control_timestep = 0.033 .* multiples of"),
        ("scenario_1", {"dataset": TINY, "time_limit": "long"}, r"^time_limit = 'long' .* numbers > 0$"),
        ("scenario_1", {"dataset": TINY, "time_limit": 0.0}, r"^time_limit = 0.0 .* numbers > 0$"),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(name: str, task_kwargs: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tasks.load(name, task_kwargs)


# dm_control's suite, wrappers and viewer


def test_tasks_are_in_the_suite_after_registration_and_only_once() -> None:
    for _ in range(2):
        tasks.register_with_dm_control()
    for task_name in tasks.ALL_TASKS:
        for collection in (suite.ALL_TASKS, suite.BENCHMARKING, suite.NO_REWARD_VIZ):
            assert collection.count(("socialnav", task_name)) == 1
    assert suite.TASKS_BY_DOMAIN["socialnav"] == tasks.ALL_TASKS
    # As dm_control/suite/explore.py does.
    loaded = suite.load(
        "socialnav", "scenario_1", task_kwargs={"dataset": TINY, "random": 3, "time_limit": float("inf")}
    )
    loaded.task.visualize_reward = True
    loaded.reset()
    assert not loaded.step(still(loaded)).last()
    assert loaded.task.scenario.seed == 3
    flat = suite.load("socialnav", "scenario_2", {"dataset": TINY}, {"flat_observation": True}, visualize_reward=True)
    assert list(flat.reset().observation) == ["observations"]
    with pytest.raises(ValueError, match="scenario_9"):
        suite.load("socialnav", "scenario_9")


def test_wrappers_of_the_suite_accept_the_tasks(environment: control.Environment) -> None:
    for wrapped in (action_noise.Wrapper(environment, scale=0.01), action_scale.Wrapper(environment, -1.0, 1.0)):
        wrapped.reset()
        assert not wrapped.step(np.zeros(wrapped.action_spec().shape)).first()


@pytest.mark.filterwarnings("ignore:.*DISPLAY:Warning")
def test_viewer_runs_the_tasks_without_a_policy_and_with_one(environment: control.Environment) -> None:
    from dm_control.viewer import runtime  # looks for a display

    spec = environment.action_spec()
    for policy in (None, lambda time_step: np.full(spec.shape, spec.maximum)):
        running = runtime.Runtime(environment, policy)
        running.restart()
        for _ in range(12):
            running.tick(0.2, paused=False)
        running.single_step()
        running.tick(0.0, paused=True)
        assert environment.task.step >= 2
        running.stop()


def test_keywords_of_load_reach_the_task() -> None:
    assert socialnav_mj.load("scenario_1", seed=5, dataset=TINY).task.scenario.seed == 5
    assert tasks.load("scenario_2", {"dataset": TINY}, seed=3).task.scenario.seed == 3
    with pytest.raises(ValueError, match="unknown task_kwargs sed; available: share, seed"):
        socialnav_mj.load("scenario_1", sed=5)
    with pytest.raises(ValueError, match="seed given twice, in task_kwargs and as a keyword"):
        socialnav_mj.load("scenario_1", {"seed": 1}, seed=2)


def test_a_file_tasks_py_beside_the_user_is_not_taken_for_ours(tmp_path: Path) -> None:
    (tmp_path / "tasks.py").write_text("raise ImportError('the user's own')\n")
    code = f"import socialnav_mj; print(socialnav_mj.load('scenario_1', dataset={str(TINY)!r}).task.scenario.share)"
    for command in (["-c", code], ["-m", "socialnav_mj", "list"]):
        result = subprocess.run([sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert result.returncode == 0 and ("0.1" in result.stdout or "scenario_1" in result.stdout), result.stderr
