"""Scenes in worker processes: the bits of single crowds, draws of their own, clear errors, and nothing left behind."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import closing
from functools import cache, partial
from multiprocessing import active_children
from pathlib import Path
from threading import Lock

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from scenes import TINY, recording_of, walk
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecCheckNan, VecMonitor

from socialnav_mj import throughput
from socialnav_mj.cli import main
from socialnav_mj.envs.guided import CrowdSettings
from socialnav_mj.envs.sb3 import CrowdVecEnv
from socialnav_mj.envs.scenes import ScenesVecEnv, scene_seed
from socialnav_mj.envs.worker import WorkerError
from socialnav_mj.features import feature_set
from socialnav_mj.features.continuous import Continuous
from socialnav_mj.processes import in_processes
from socialnav_mj.recordings import load_recording

SLOTS = 3
GONE = 60.0
"""Longest time in which workers end after their parent [s]; an idle machine takes a tenth of a second."""


class Breaking(Continuous):
    """Features that fail at the third look, and cannot travel after the first."""

    def __init__(self) -> None:
        self.looks = 0

    def __call__(self, view):
        self.looks += 1
        self.lock = Lock()
        if self.looks == 3:
            raise KeyError("no eyes")
        return super().__call__(view)


class Lethal(Continuous):
    """Features that end their process at the third look, as memory that runs out does."""

    def __init__(self) -> None:
        self.looks = 0

    def __call__(self, view):
        self.looks += 1
        if self.looks == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(view)


class Meeting(Continuous):
    """Features that look only when another process does so as well."""

    def __init__(self, folder) -> None:
        self.folder, self.looks = folder, 0

    def __call__(self, view):
        self.looks += 1
        (self.folder / f"{self.looks}_{os.getpid()}").touch()
        if not wait_until(lambda: len(list(self.folder.glob(f"{self.looks}_*"))) == 2):
            raise TimeoutError("nobody else came")
        return super().__call__(view)


def settings(**changes) -> CrowdSettings:
    of_all = {"shares": (0.4, 1.0), "n_slots": SLOTS, "guide": "potential_field"}
    of_all |= {"recordings": [load_recording(TINY)], "features": feature_set("continuous")}
    return CrowdSettings(**{**of_all, **changes})


def scenes(n_scenes=2, seed=3, **changes) -> ScenesVecEnv:
    return ScenesVecEnv(settings(**changes), n_scenes=n_scenes, seed=seed)


def alone(scene, seed=3, **changes) -> CrowdVecEnv:
    return CrowdVecEnv(settings(**changes), seed=scene_seed(seed, scene))


def first_sight() -> np.ndarray:
    with closing(scenes(1)) as env:
        return env.reset()


def test_scenes_start_in_a_worker_of_joblib_too():
    """Several trainings run in such workers; how these were started is nothing that a scene's process could repeat."""
    (seen,) = in_processes(first_sight, [()], n_jobs=2)
    np.testing.assert_array_equal(seen, alone(0).reset())


@pytest.fixture(scope="module")
def pair():
    """Two scenes for tests that leave them as they are."""
    with closing(scenes()) as env:
        yield env


def same(some, other) -> bool:
    """Whether two infos are of the same types and values to the bit."""
    if some.keys() != other.keys():
        return False
    return all(type(some[key]) is type(other[key]) and np.array_equal(some[key], other[key]) for key in some)


def ours():
    """Workers of this process."""
    return {child.pid for child in active_children() if child.name.startswith("worker ")}


def named_memory():
    """Shared memory of multiprocessing that has a name in the file system."""
    return {name for name in os.listdir("/dev/shm") if name.startswith(("psm_", "pym-"))}


def wait_until(condition, longest=GONE) -> bool:
    end = time.monotonic() + longest
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def is_running(pid) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


# The same as single crowds


def test_every_scene_is_to_the_bit_the_crowd_of_its_seed_alone():
    """Random actions, the guide's now and then, through several draws; then back to a moment of before."""
    singles, random = [alone(0), alone(1)], np.random.default_rng(0)
    with closing(scenes()) as env:
        assert env.num_envs == 2 * SLOTS and env.observation_space == singles[0].observation_space
        assert env.action_space == singles[0].action_space
        seen = env.reset()
        np.testing.assert_array_equal(seen, np.concatenate([single.reset() for single in singles]))
        ended, drawn = 0, [[single.environment] for single in singles]
        for step in range(240):
            actions = random.uniform([0.0, -1.0], 1.0, (env.num_envs, 2))
            if step % 3 == 0:
                actions = env.guide_action()
                guided = np.concatenate([single.guide_action() for single in singles])
                np.testing.assert_array_equal(actions, guided)
            if step == 120:
                state, before = env.state(), seen
            seen, rewards, dones, infos = env.step(actions)
            parts = [single.step(own) for single, own in zip(singles, np.split(actions, 2), strict=True)]
            for many, those in zip((seen, rewards, dones), list(zip(*parts, strict=True))[:3], strict=True):
                assert many.dtype == those[0].dtype
                np.testing.assert_array_equal(many, np.concatenate(those))
            assert all(same(a, b) for a, b in zip(infos, parts[0][3] + parts[1][3], strict=True))
            ended += int(dones.sum())
            for single, played in zip(singles, drawn, strict=True):
                if single.environment is not played[-1]:
                    played.append(single.environment)
        assert ended > 5 and min(map(len, drawn)) > 1
        np.testing.assert_array_equal(env.restore(state), before)
        with pytest.raises(ValueError, match="a state of 1 scenes is not allowed; allowed: of 2"):
            env.restore({"scenes": state["scenes"][:1]})


def test_scenes_step_at_the_same_time(tmp_path):
    with closing(
        scenes(features=Meeting(tmp_path), recordings=[recording_of(walk([(0.0, 0.0), (9.0, 0.0)], 1.0))])
    ) as env:
        env.reset()
        for _ in range(3):
            env.step(np.zeros((6, 2)))
    assert len(list(tmp_path.iterdir())) == 2 * 4


def test_what_a_step_returned_stays_as_it_was(pair):
    first = pair.reset()
    kept = first.copy()
    seen, rewards, *_ = pair.step(np.ones((pair.num_envs, 2)))
    copies = seen.copy(), rewards.copy()
    pair.step(np.zeros((pair.num_envs, 2)))
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(seen, copies[0])
    np.testing.assert_array_equal(rewards, copies[1])


def test_empty_slots_stand_aside_and_are_told(pair):
    seen = pair.reset()
    for _ in range(100):
        held = seen.any(axis=1)
        seen, rewards, dones, infos = pair.step(np.ones((pair.num_envs, 2)))
        assert [info["active"] for info in infos] == held.tolist()
        assert not rewards[~held].any() and not dones[~held].any()
        for done, info in zip(dones, infos, strict=True):
            ends = {"terminal_observation", "TimeLimit.truncated", "outcome"} if done else set()
            assert info.keys() == {"active"} | ends


def test_draws_of_scenes_and_of_seeds_are_all_different():
    seeds = {scene_seed(seed, scene) for seed in range(20) for scene in range(20)}
    assert len(seeds) == 400

    @cache
    def draws(seed):
        random = np.random.default_rng(seed)
        return tuple(random.integers(2**31, size=5))

    assert len({draw for seed in seeds for draw in draws(seed)}) == 2000


# stable-baselines3's conventions


def test_attributes_and_methods_are_those_of_each_scene(pair):
    assert pair.get_attr("n_slots") == [SLOTS] * 6 and pair.render_mode is None
    pair.set_attr("mark", 7, indices=[3])
    assert pair.get_attr("mark", indices=[4, 5]) == [7, 7]
    assert not pair.has_attr("mark") and pair.has_attr("shares")
    with pytest.raises(AttributeError, match=r"worker 0 of 0 to 1 \(environments 0 to 2\).* no attribute 'mark'"):
        pair.get_attr("mark")
    under_way = pair.env_method("under_way", indices=[0, 4])
    assert [mask.shape for mask in under_way] == [(SLOTS,), (SLOTS,)]
    assert pair.env_is_wrapped(VecMonitor) == [False] * 6 and pair.get_images() == [None] * 6
    assert pair.seed(5) == [None] * 6
    assert len(pair.cpu_time()) == 2 and min(pair.cpu_time()) > 0.0


def test_calls_out_of_turn_are_refused_and_harm_nothing(pair):
    pair.reset()
    with pytest.raises(RuntimeError, match="no step is under way; call step_async first"):
        pair.step_wait()
    with pytest.raises(ValueError, match=r"actions of shape \(2,\) are not allowed; allowed: \(6, 2\)"):
        pair.step_async(np.zeros(2))
    pair.step_async(np.zeros((6, 2)))
    for call in (lambda: pair.step_async(np.zeros((6, 2))), lambda: pair.get_attr("n_slots"), pair.guide_action):
        with pytest.raises(RuntimeError, match="a step is under way; call step_wait first"):
            call()
    assert pair.reset().any()  # the step is forgotten
    assert pair.step(np.zeros((6, 2)))[0].any()
    with pytest.raises(Exception, match="pickle"):
        pair.env_method("step", lambda: None)
    assert pair.get_attr("n_slots", indices=0) == [SLOTS]


def test_ppo_learns_in_scenes(pair):
    wrapped = VecMonitor(VecCheckNan(pair, raise_exception=True))
    model = PPO("MlpPolicy", wrapped, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    before = [values.detach().clone() for values in model.policy.parameters()]
    model.learn(2 * 16 * pair.num_envs)
    assert model.num_timesteps == 2 * 16 * pair.num_envs
    assert any((a != b).any() for a, b in zip(before, model.policy.parameters(), strict=True))


def test_bench_sets_workers_beside_one_process(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(throughput, "measure_scenes", partial(throughput.measure_scenes, control_steps=20))
    out = tmp_path / "bench.json"
    main(
        ["bench", "--scenes", "1", "--dataset", str(TINY), "--scenarios", "4", "--repetitions", "2", "--out", str(out)]
    )
    assert "agent-steps a second" in capsys.readouterr().out
    content = json.loads(out.read_text(encoding="utf-8"))
    (row,) = content["scenes"]
    assert content["recording"]["name"] == "tiny" and (row["scenario"], row["n_scenes"]) == ("scenario_4", 1)
    assert len(row["agent_steps"]) == 2 and row["agent_steps"][0] > 20
    for ratio, over, under in (("ratio", "workers", "one"), ("cpu_ratio", "workers_cpu", "one_cpu")):
        pairs = zip(row[over]["values"], row[under]["values"], strict=True)
        assert row[ratio]["values"] == pytest.approx([a / b for a, b in pairs]) and len(row[ratio]["values"]) == 2
        assert 0.0 < row[ratio]["low"] <= row[ratio]["middle"] <= row[ratio]["high"]


# Errors


def test_what_is_not_allowed_is_named_by_the_worker_that_found_it():
    others = ours()
    with pytest.raises(ValueError, match="n_scenes = 0 is not allowed; allowed: integers >= 1"):
        scenes(n_scenes=0)
    with pytest.raises(WorkerError, match=r"worker 0 of 0 to 0 .* raised ValueError: .* at most n_slots = 1 agents"):
        scenes(n_scenes=1, n_slots=1, shares=(1.0,))
    assert ours() == others


def test_exception_in_a_worker_is_told_with_its_place_and_ends_nothing():
    with closing(scenes(1, features=Breaking())) as env:
        env.reset()
        with pytest.raises(WorkerError, match=r"worker 0 .* raised TypeError: cannot pickle '_thread\.lock'"):
            env.get_attr("observer")
        env.step(np.zeros((3, 2)))
        with pytest.raises(WorkerError, match=r"worker 0 .* raised KeyError: 'no eyes'") as caught:
            env.step(np.zeros((3, 2)))
        assert "in __call__" in caught.value.__notes__[0]
        assert env.reset().any()


def test_death_in_a_worker_is_told_and_ends_all():
    others = ours()
    env = scenes(features=Lethal())
    env.reset()
    env.step(np.zeros((6, 2)))
    with pytest.raises(WorkerError, match=r"worker 0 of 0 to 1 \(environments 0 to 2\) was ended by SIGKILL; .*memory"):
        env.step(np.zeros((6, 2)))
    assert ours() == others
    with pytest.raises(RuntimeError, match="these scenes are closed; make them anew"):
        env.step_async(np.zeros((6, 2)))
    env.close()


def test_death_between_two_steps_is_told():
    env = scenes(1)
    env.reset()
    (victim,) = (child for child in active_children() if child.name.startswith("worker 0 of 0 to 0"))
    os.kill(victim.pid, signal.SIGTERM)
    assert wait_until(lambda: not is_running(victim.pid))
    with pytest.raises(WorkerError, match=r"worker 0 .* was ended by SIGTERM"):
        env.step(np.zeros((3, 2)))
    assert victim not in active_children()


# What is left behind


def test_close_leaves_no_process_and_no_named_memory():
    memory, descriptors = named_memory(), len(os.listdir("/proc/self/fd"))
    others = ours()
    env = scenes(1)
    env.step_async(np.zeros((3, 2)))
    assert len(ours()) == len(others) + 1 and named_memory() <= memory
    env.close()
    env.close()
    assert ours() == others
    del env
    # multiprocessing's own: its tracker of resources, and the heap that shared memory is taken from
    assert len(os.listdir("/proc/self/fd")) <= descriptors + 3


SCRIPT = f"""
import sys, time
from multiprocessing import active_children
import numpy as np

def main():
    from socialnav_mj.envs.guided import CrowdSettings
    from socialnav_mj.envs.scenes import ScenesVecEnv
    from socialnav_mj.features import feature_set
    from socialnav_mj.recordings import load_recording
    settings = CrowdSettings(
        recordings=[load_recording({str(TINY)!r})], features=feature_set("continuous"), shares=[1.0], n_slots=3
    )
    env = ScenesVecEnv(settings, n_scenes=2, seed=0)
    print(*[child.pid for child in active_children()], flush=True)
    try:
        env.reset()
        while "wait" in sys.argv:
            env.step(np.zeros((6, 2)))
    except KeyboardInterrupt:
        env.close()
        print("closed", len(active_children()), flush=True)
    # else it is forgotten

if __name__ == "__main__":
    main()
"""


@pytest.fixture
def script(tmp_path):
    """Starts a script with two workers, as the leader of a group of processes; gives it and the workers' ids."""
    path, started = tmp_path / "script.py", []
    path.write_text(textwrap.dedent(SCRIPT), encoding="utf-8")

    def start(*arguments):
        own = subprocess.Popen(
            [sys.executable, str(path), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(own)
        workers = [int(word) for word in own.stdout.readline().split()]
        assert len(workers) == 2 and all(map(is_running, workers)), own.stderr.read()
        return own, workers

    yield start
    for own in started:
        if own.poll() is None:
            own.kill()
        own.communicate()


def test_ctrl_c_reaches_the_script_alone_and_closes_cleanly(script):
    own, workers = script("wait")
    time.sleep(0.5)
    os.killpg(own.pid, signal.SIGINT)  # as a terminal does, to all
    out, err = own.communicate(timeout=GONE)
    assert (own.returncode, out, err) == (0, "closed 0\n", "")
    assert not any(map(is_running, workers))


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, *(pytest.param(n, marks=pytest.mark.slow) for n in (signal.SIGTERM, signal.SIGHUP))]
)
def test_workers_end_with_a_script_that_is_killed(script, number):
    memory = named_memory()
    own, workers = script("wait")
    own.send_signal(number)
    own.wait(GONE)
    assert wait_until(lambda: not any(map(is_running, workers)))
    assert named_memory() <= memory
    assert not own.stderr.read()


@pytest.mark.slow
def test_script_that_forgets_to_close_ends_all_the_same(script):
    own, workers = script()
    out, err = own.communicate(timeout=GONE)
    assert (own.returncode, out, err) == (0, "", "")
    assert wait_until(lambda: not any(map(is_running, workers)))


def test_workers_need_no_torch(tmp_path):
    code = "import sys, socialnav_mj.envs.worker; print({'torch', 'stable_baselines3'} & {*sys.modules})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert found.stdout == "set()\n"
