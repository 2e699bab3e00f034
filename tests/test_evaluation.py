"""Grids of episodes: resumable, the same with any number of processes, and clear about what does not fit."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import socialnav_mj.evaluation as evaluation_module
from socialnav_mj.cli.pace import Pace
from socialnav_mj.controllers import GoStraight
from socialnav_mj.episode import Episode, EpisodeError, read_header
from socialnav_mj.evaluation import Done, Evaluation, EvaluationError, Job, evaluate, jobs_of
from socialnav_mj.report.writer import write_report

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
TABLES = ("agents.parquet", "summary.csv")


class Outside(GoStraight):
    """Raises in scenarios with two or three agents; otherwise goes straight."""

    def __init__(self) -> None:
        super().__init__(name="outside")

    def act(self, observation):
        if 1 < len(observation["active"]) < 4:
            raise LookupError("nothing found")
        return super().act(observation)


class Namesake(GoStraight):
    """Named go_straight as well."""


def wanted(**changes):
    options = {"dataset": TINY, "scenarios": ("scenario_1", "scenario_4"), "draws": 2}
    return Evaluation(**{**options, **changes})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished run; its tables are made once."""
    folder = tmp_path_factory.mktemp("finished")
    list(evaluate(wanted(), folder, n_jobs=1))
    write_report(folder)
    return folder


@pytest.fixture
def run(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "run")


def episodes(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "episodes").iterdir()}


def tables(folder):
    return [(folder / name).read_bytes() for name in TABLES]


def test_grid_holds_every_combination_once_and_the_humans_last():
    jobs = jobs_of(wanted(seed=5))
    assert len(jobs) == len({job.file_name for job in jobs}) == 2 * 3 * 2
    assert [job.controller for job in jobs][-4:] == ["human"] * 4
    assert {job.draw for job in jobs} == {5, 6} and jobs[0].scenario == "scenario_4"


def test_episodes_carry_what_was_asked_for(finished):
    names = {f"scenario_{s}.{c}.draw_00{d}.npz" for s in (1, 4) for c in CONTROLLERS for d in (0, 1)}
    assert set(episodes(finished)) == names
    episode = Episode.load(finished / "episodes" / "scenario_4.go_straight.draw_001.npz")
    metadata = episode.metadata
    assert (metadata["controller"], metadata["scenario_name"], metadata["draw"]) == ("go_straight", "scenario_4", 1)
    assert metadata["scenario"]["share"] == 0.9 and metadata["scenario"]["seed"] == 1 and episode.n_agents == 3


CONTROLLERS = ("potential_field", "go_straight", "human")


def test_one_and_two_processes_give_identical_tables_and_hashes(finished, tmp_path):
    done = list(evaluate(wanted(), tmp_path, n_jobs=2))
    assert len(done) == 12 and all(d.error is None and d.simulated_time > 0 for d in done)
    write_report(tmp_path)
    assert tables(tmp_path) == tables(finished)
    for path in (tmp_path / "episodes").iterdir():
        same = read_header(finished / "episodes" / path.name)
        assert read_header(path) == same, path.name


def test_interrupted_run_goes_on_where_it_was(finished, tmp_path):
    for number, _ in enumerate(evaluate(wanted(), tmp_path, n_jobs=1), start=1):
        if number == 5:
            break
    before = episodes(tmp_path)
    assert 5 <= len(before) < 12
    left = tmp_path / "episodes" / f".scenario_1.human.draw_000.{os.getpid()}.part.npz"
    left.write_bytes(b"left by a killed process whose number is another's now")
    os.utime(left, (1e9, 1e9))
    done = list(evaluate(wanted(), tmp_path, n_jobs=1))
    assert len(done) == 12 and [d.simulated_time for d in done[: len(before)]] == [None] * len(before)
    assert all(d.simulated_time for d in done[len(before) :])
    assert not left.exists()
    after = episodes(tmp_path)
    assert {name: after[name] for name in before} == before
    write_report(tmp_path)
    assert tables(tmp_path) == tables(finished)


def test_finished_run_is_not_run_again(run, monkeypatch):
    monkeypatch.setattr(evaluation_module, "_run", None)
    assert len(list(evaluate(wanted(), run, n_jobs=1))) == 12


@pytest.mark.parametrize(
    ("changes", "file", "key"),
    [
        ({"task_kwargs": {"robot_radius": 0.2}}, "scenario_1.go_straight.draw_000.npz", "scenario.robot.radius = 0.17"),
        ({"task_kwargs": {"turn_limit": "per_second"}}, "scenario_1", "scenario.turn_limit = 'per_step'"),
        # Nothing of this is there yet, but its rows would stand beside those of another configuration.
        (
            {"task_kwargs": {"on_collision": "retire"}, "seed": 7, "scenarios": ("scenario_2",)},
            "scenario_1",
            "scenario.on_collision = 'continue', but 'retire' is asked for",
        ),
        ({"dataset": "plaza"}, "scenario_1", "recording.name = 'tiny', but 'plaza' is asked for"),
        (
            {"controllers": ("potential_field(repulsion_gain=3,name='potential_field')",)},
            "scenario_1.potential_field.draw_000.npz",
            "potential_field has changed since these episodes were run (repulsion_gain = 2.0, but 3;",
        ),
    ],
)
def test_folder_of_another_configuration_is_refused_with_file_and_key(run, changes, file, key):
    before = episodes(run), tables(run), (run / "run.json").read_bytes()
    with pytest.raises(EpisodeError) as caught:
        evaluate(wanted(**changes), run, n_jobs=1)
    assert (
        file in str(caught.value) and key in str(caught.value) and "choose another output folder" in str(caught.value)
    )
    assert before == (episodes(run), tables(run), (run / "run.json").read_bytes())


def test_damaged_episode_is_named_before_anything_runs(run):
    path = run / "episodes" / "scenario_4.human.draw_001.npz"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(EpisodeError, match=r"scenario_4\.human\.draw_001\.npz is not a readable episode"):
        evaluate(wanted(), run, n_jobs=1)


def test_more_draws_are_added_to_those_that_are_there(run):
    before = episodes(run)
    done = list(evaluate(wanted(draws=3), run, n_jobs=1))
    assert [d.job.draw for d in done if d.simulated_time is not None] == [2] * 6
    assert {name: value for name, value in episodes(run).items() if name in before} == before


def test_failures_are_told_with_their_place_and_the_others_are_kept(tmp_path):
    own = f"{__name__}:Outside"
    told = []
    with pytest.raises(EvaluationError, match=r"2 of 8 episodes failed, the others are kept"):
        told.extend(evaluate(wanted(controllers=(own,)), tmp_path, n_jobs=1))
    failed = [done for done in told if done.error is not None]
    assert len(told) == 8 and {done.job.scenario for done in failed} == {"scenario_4"}
    assert "LookupError: nothing found (" in failed[0].error and "test_evaluation.py:" in failed[0].error
    assert len(episodes(tmp_path)) == 6
    write_report(tmp_path)  # of those that are there
    assert json.loads((tmp_path / "run.json").read_text())["controllers"] == ["outside", "human"]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"scenarios": ("scenario_5",)}, "unknown task 'scenario_5'; available: scenario_1, scenario_2"),
        ({"scenarios": ()}, "one or more, each once"),
        ({"controllers": ("go_straight", "go_straight")}, "one or more, each once"),
        ({"controllers": ("human",)}, "'human' is no controller"),
        ({"draws": 0}, "draws = 0 is not allowed; allowed: integers >= 1"),
        ({"seed": -1}, "seed = -1 is not allowed"),
    ],
)
def test_evaluation_that_cannot_be_is_refused(changes, named):
    with pytest.raises(ValueError) as caught:
        wanted(**changes)
    assert named in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "error", "named"),
    [
        ({"dataset": "nowhere"}, FileNotFoundError, "no recording 'nowhere'"),
        ({"controllers": ("nobody",)}, ValueError, "unknown controller 'nobody'; available: potential_field"),
        ({"task_kwargs": {"robot_radius": -1.0}}, ValueError, "Robot.radius = -1.0 is not allowed"),
        ({"task_kwargs": {"control_timestep": 0.013}}, ValueError, "whole multiples of physics_timestep"),
        ({"controllers": ("go_straight", f"{__name__}:Namesake")}, ValueError, "named 'go_straight' like another row"),
        (
            {"controllers": ("go_straight(name='a')", 'go_straight(name="a")')},
            ValueError,
            "give files of the same name",
        ),
    ],
)
def test_wrong_request_is_refused_before_anything_is_written(changes, error, named, tmp_path):
    with pytest.raises(error) as caught:
        evaluate(wanted(**changes), tmp_path / "run", n_jobs=1)
    assert named in str(caught.value) and not (tmp_path / "run").exists()


def test_report_makes_all_but_the_episodes_again(run):
    before, expected = episodes(run), {p.name: p.read_bytes() for p in run.iterdir() if p.is_file()}
    traces = {path.name for path in (run / "traces").iterdir()}
    assert traces == {f"scenario_{s}.{c}.draw_000.rrd" for s in (1, 4) for c in CONTROLLERS}
    shutil.rmtree(run / "traces")
    for name in set(expected) - {"run.json"}:
        (run / name).unlink()
    write_report(run)
    assert {p.name: p.read_bytes() for p in run.iterdir() if p.is_file()} == expected
    assert {path.name for path in (run / "traces").iterdir()} == traces and episodes(run) == before


def test_pace_counts_what_was_run_and_not_what_was_there(monkeypatch):
    """Costs 2.5, 2.5, 2.5 and 0.5 s; those of `a` take as long as they cost, those of `b` four times as long."""
    now = iter([100.0, 101.0, 105.0, 105.0, 110.0, 110.0, 110.5, 200.0, 210.0, 210.0])
    monkeypatch.setattr("socialnav_mj.cli.pace.monotonic", lambda: next(now))
    jobs = [
        Job(evaluation=wanted(), scenario="scenario_1", controller=controller, draw=draw)
        for controller, draw in (("a", 0), ("a", 1), ("b", 0), ("b", 1))
    ]
    np.testing.assert_allclose([job.cost for job in jobs], 2.5)
    pace = Pace(jobs)
    pace.note(Done(job=jobs[0]))  # was there
    assert pace.rate is None and pace.left is None
    pace.note(Done(job=jobs[1], simulated_time=200.0, duration=2.5))
    assert pace.rate == pytest.approx(40.0) and pace.left == pytest.approx(5.0)  # b as a, one after the other
    pace.note(Done(job=jobs[2], simulated_time=200.0, duration=10.0))
    # 12.5 s of episodes in 10 s: 1.25 at once.
    assert [pace.left, pace.left] == pytest.approx([10.0 / 1.25, 10.0 / 1.25 - 0.5])
    assert pace.left is None  # it takes longer than thought, and nobody knows how long
    pace.note(Done(job=jobs[3], simulated_time=200.0, duration=10.0))
    assert pace.left == 0.0
