"""Stored episodes, traces and tables say what their re-simulation says; whatever does not is named; nothing runs."""

import json
import shutil
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from socialnav_mj.cli import main
from socialnav_mj.controllers import Limits, Observation, controller_of
from socialnav_mj.episode import Episode, EpisodeError, Outcome
from socialnav_mj.evaluation import Evaluation, evaluate
from socialnav_mj.geometry import Array
from socialnav_mj.report.writer import write_report
from socialnav_mj.resimulation import Trust, resimulate
from socialnav_mj.resources import assets_folder
from socialnav_mj.trace.writer import write_trace
from socialnav_mj.verification import files_of, verify

TINY = str(Path(__file__).parent / "data" / "tiny")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    # Radii at which robots touch people, so that there are contacts to alter.
    wide = {"robot_radius": 0.3, "pedestrian_radius": 0.3}
    plan = Evaluation(
        dataset=TINY, scenarios=("scenario_3",), controllers=("go_straight",), draws=1, seed=1, task_kwargs=wide
    )
    # Interrupted after the first episode, and resumed with other processes.
    next(iter(evaluate(plan, folder, n_jobs=1)))
    list(evaluate(plan, folder, n_jobs=2))
    write_report(folder)
    return folder


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_episodes_and_traces_of_a_resumed_run_give_the_same_states(run: Path, n_jobs: int) -> None:
    verdicts = list(verify(run, dataset=TINY, n_jobs=n_jobs))
    assert sorted(v.path.suffix for v in verdicts)[-4:] == [".parquet", ".parquet", ".rrd", ".rrd"]
    assert all(v.same for v in verdicts), verdicts


def test_episodes_and_traces_of_people_who_yield_give_the_same_states(tmp_path: Path) -> None:
    wide = {"robot_radius": 0.3, "pedestrian_radius": 0.3, "pedestrian_body": "compliant"}
    plan = Evaluation(
        dataset=TINY, scenarios=("scenario_3",), controllers=("go_straight",), draws=1, seed=1, task_kwargs=wide
    )
    list(evaluate(plan, tmp_path, n_jobs=1))
    write_report(tmp_path)
    episode = Episode.load(tmp_path / "episodes" / EPISODE)
    assert (episode.contact_held_back > 0.0).any()
    verdicts = list(verify(tmp_path, dataset=TINY, n_jobs=1))
    assert len(verdicts) > 4 and all(v.same for v in verdicts), verdicts
    # Where the bodies were is part of what is verified.
    position = episode.pedestrian_position.copy()
    position[np.isfinite(position)] += 1e-9
    replace(episode, pedestrian_position=position).save(tmp_path / "episodes" / EPISODE)
    (told,) = verify(tmp_path / "episodes" / EPISODE, dataset=TINY, n_jobs=1)
    assert "pedestrian_position differs" in " ".join(told.differences)


def test_cut_episode_is_verified_over_its_own_length(run: Path) -> None:
    metadata = dict(Episode.load(run / "episodes" / "scenario_3.go_straight.draw_001.npz").metadata)
    whole = resimulate(metadata, dataset=TINY)
    cut = resimulate({**metadata, "steps": 7}, dataset=TINY)
    assert len(cut.time) == 8
    np.testing.assert_array_equal(cut.agent_position, whole.agent_position[:8])
    again = resimulate(cut.metadata, dataset=TINY)
    assert again.metadata["state_hash"] == cut.metadata["state_hash"] != whole.metadata["state_hash"]


EPISODE = "scenario_3.go_straight.draw_001.npz"


def write_altered(run: Path, target: Path, **changes: Any) -> Path:
    """The run's episode with other contents and a digest that fits them, as somebody who means to deceive writes it."""
    return replace(Episode.load(run / "episodes" / EPISODE), **changes).save(target)


def test_file_of_another_platform_may_agree_and_is_told_where_it_does_not(run: Path, tmp_path: Path) -> None:
    """An episode of before platforms were noted says none."""
    metadata = Episode.load(run / "episodes" / EPISODE).metadata
    now = metadata["platform"]["c_library"]
    assert "x86" not in now and now != "unknown"
    elsewhere = {**metadata, "platform": {**metadata["platform"], "c_library": "glibc 2.0"}}
    silent = {name: value for name, value in metadata.items() if name != "platform"}
    found = [
        next(iter(verify(write_altered(run, tmp_path / f"{number}.npz", metadata=given), dataset=TINY, n_jobs=1)))
        for number, given in enumerate((metadata, elsewhere, silent))
    ]
    assert all(verdict.same for verdict in found), found
    assert [v.other_versions for v in found] == [(), (f"c_library: glibc 2.0, {now}",), ()]


def alterations(episode: Episode) -> dict[str, dict[str, Any]]:
    """One change for each thing that an episode says; all keep its invariants."""
    metadata = episode.metadata
    changes: dict[str, dict[str, Any]] = {
        "agent_person": {"agent_person": np.append(episode.agent_person[:-1], 10**6)},
        "agent_outcome": {
            "agent_outcome": np.where(episode.agent_outcome == Outcome.ARRIVED, Outcome.TIMED_OUT, Outcome.ARRIVED)
        },
        "pedestrian_person": {"pedestrian_person": np.append(episode.pedestrian_person[:-1], 10**6)},
        "policies": {"policies": ("other",)},
        "controller": {"metadata": {**metadata, "controller": "better"}},
        "scenario_name": {"metadata": {**metadata, "scenario_name": "scenario_5"}},
        "recording": {"metadata": {**metadata, "recording": {**metadata["recording"], "name": "other"}}},
        "state_hash": {"metadata": {**metadata, "state_hash": "0" * 64}},
        "note": {"metadata": {**metadata, "note": "checked"}},
    }
    for field in fields(episode):
        values = getattr(episode, field.name)
        if isinstance(values, np.ndarray) and values.dtype.kind == "f" and field.name != "time":
            altered = values.copy()
            place = np.unravel_index(np.flatnonzero(np.isfinite(altered))[0], altered.shape)
            altered[place] += 1e-9
            changes[field.name] = {field.name: altered}
    contacts = [field.name for field in fields(episode) if field.name.startswith("contact_")]
    changes["contact_time"] = {name: getattr(episode, name)[:0] for name in contacts}
    return changes


def test_whatever_is_altered_is_found_and_named(run: Path, tmp_path: Path) -> None:
    episode = Episode.load(run / "episodes" / EPISODE)
    assert len(episode.contact_time) > 0
    changes = alterations(episode)
    for name, change in changes.items():
        write_altered(run, tmp_path / "episodes" / f"{name}.npz", **change)
    found = {v.path.stem: v for v in verify(tmp_path, dataset=TINY, n_jobs=1) if v.path.suffix == ".npz"}
    assert found.keys() == changes.keys()
    for name, verdict in found.items():
        assert not verdict.same and verdict.error is None, (name, verdict)
        assert any(difference.startswith(name) for difference in verdict.differences), (name, verdict)


def test_scores_that_are_altered_or_left_out_are_found(tmp_path: Path) -> None:
    plan = Evaluation(dataset=TINY, scenarios=("scenario_3",), controllers=("selector",), draws=1, seed=1)
    list(evaluate(plan, tmp_path / "run", n_jobs=1))
    episode = Episode.load(tmp_path / "run" / "episodes" / EPISODE.replace("go_straight", "selector"))
    scores = episode.agent_scores
    assert scores is not None
    for name, given in (("a", scores), ("b", 2 * scores), ("c", None)):
        replace(episode, agent_scores=given).save(tmp_path / "episodes" / f"{name}.npz")
    same, other, none = (v for v in verify(tmp_path, dataset=TINY, n_jobs=1) if v.path.suffix == ".npz")
    assert same.same and other.differences[0].startswith("agent_scores differs in")
    assert none.differences == (f"agent_scores is None, now 'shape {scores.shape}'",)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"draw": 7}, "draw 7"),
        ({"scenario_name": "scenario_1"}, "0.1"),
        ({"steps": 10**9}, "10000000 physics steps"),
        ({"steps": "many"}, "steps = 'many'"),
        ({"steps": 0}, "steps = 0"),
        ({"scenario": {}}, "scenario.seed"),
        ({"versions": 3}, "TypeError"),
    ],
)
def test_episode_that_contradicts_itself_is_refused(run: Path, tmp_path: Path, change: Any, message: str) -> None:
    episode = Episode.load(run / "episodes" / EPISODE)
    if change == {"scenario": {}}:
        scenario = {k: v for k, v in episode.metadata["scenario"].items() if k != "seed"}
        change = {"scenario": scenario}
    path = write_altered(run, tmp_path / "x.npz", metadata={**episode.metadata, **change})
    (verdict,) = verify(path, dataset=TINY, n_jobs=1)
    assert verdict.error is not None and message in verdict.error


def test_report_refuses_what_was_altered_without_its_digest(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "episodes" / EPISODE
    path.parent.mkdir()
    with np.load(run / "episodes" / EPISODE) as file:
        arrays = {name: file[name] for name in file.files}
    contacts = {name: array[:0] for name, array in arrays.items() if name.startswith("contact_")}
    np.savez_compressed(path, **{**arrays, **contacts})
    with pytest.raises(EpisodeError, match="altered"):
        write_report(tmp_path)
    header = json.loads(str(arrays["header"]))
    header["metadata"]["controller"] = "better"
    np.savez_compressed(path, **{**arrays, "header": np.array(json.dumps(header))})
    with pytest.raises(EpisodeError, match="altered"):
        write_report(tmp_path)


@pytest.mark.parametrize(("key", "value"), [("draw", 3), ("scenario_name", "scenario_1")])
def test_report_refuses_another_draw_or_scenario_than_was_run(run: Path, tmp_path: Path, key: str, value: Any) -> None:
    metadata = Episode.load(run / "episodes" / EPISODE).metadata
    write_altered(run, tmp_path / "episodes" / EPISODE, metadata={**metadata, key: value})
    with pytest.raises(EpisodeError, match=str(value)):
        write_report(tmp_path)


def test_altered_trace_is_found_and_its_column_named(run: Path, tmp_path: Path) -> None:
    episode = Episode.load(run / "episodes" / EPISODE)
    position = episode.agent_position.copy()
    position[np.isfinite(position)] += 0.01
    path = write_trace(replace(episode, agent_position=position), tmp_path / "x.rrd")
    (verdict,) = verify(path, dataset=TINY, n_jobs=1)
    assert verdict.error is None and "/scene/trails/robots Points3D:positions" in verdict.differences


def test_tables_and_the_count_of_episodes_are_verified(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    text = (folder / "summary.csv").read_text()
    (folder / "summary.csv").write_text(text.replace("scenario_3", "scenario_4", 1))
    agents = pyarrow.parquet.read_table(folder / "agents.parquet")
    column = agents.schema.get_field_index("success")
    altered = agents.set_column(column, "success", pa.array([True] * len(agents)))
    pyarrow.parquet.write_table(altered, folder / "agents.parquet")
    (folder / "tables" / "paired.csv").unlink()
    (folder / "traces").rename(tmp_path / "traces")
    found = {v.path.name: v for v in verify(folder, dataset=TINY, n_jobs=2)}
    assert {name for name, v in found.items() if not v.same} == {"summary.csv", "agents.parquet", "paired.csv"}
    assert found["agents.parquet"].differences == ("column success is not what the episodes give",)
    shutil.copy(folder / "episodes" / EPISODE, folder / "episodes" / "another.npz")
    (folder / "episodes" / "scenario_3.human.draw_001.npz").unlink()
    found = {v.path.name: v for v in verify(folder, dataset=TINY, n_jobs=2)}
    assert found["run.json"].differences == ("scenario_3.human.draw_001.npz is missing", "another.npz is not listed")
    (folder / "run.json").unlink()
    found = {v.path.name: v for v in verify(folder, dataset=TINY, n_jobs=2)}
    assert found["run.json"].error is not None


def test_other_recordings_are_told(run: Path) -> None:
    path = run / "episodes" / EPISODE
    (verdict,) = verify(path, dataset="plaza", n_jobs=1)
    assert verdict.error is not None and "no variant" in verdict.error
    (verdict,) = verify(path, n_jobs=1)
    assert verdict.error is not None and "--dataset" in verdict.error


def test_files_after_one_that_fails_are_verified(run: Path, tmp_path: Path) -> None:
    (tmp_path / "episodes").mkdir()
    (tmp_path / "episodes" / "a.npz").write_bytes(b"no episode")
    write_altered(run, tmp_path / "episodes" / "b.npz")
    metadata = {**Episode.load(run / "episodes" / EPISODE).metadata, "controller_config": {"class": ["x"]}}
    write_altered(run, tmp_path / "episodes" / "c.npz", metadata=metadata)
    found = {v.path.stem: v for v in verify(tmp_path, dataset=TINY, n_jobs=1)}
    assert found["b"].same and found["a"].error and found["c"].error


HOSTILE = (
    {"class": "subprocess:getoutput", "cmd": "touch {ran}"},
    {"class": "hostile:Hostile"},
    {"class": "socialnav_mj.controllers.hybrid:Hybrid", "near": "hostile:Hostile"},
    {
        "class": "socialnav_mj.controllers.hybrid:Hybrid",
        "far": "hybrid(near=\"subprocess:getoutput(cmd='touch {ran}')\")",
    },
)


@pytest.mark.parametrize("config", HOSTILE)
@pytest.mark.parametrize("kind", ["npz", "rrd"])
def test_nothing_that_a_file_names_runs(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, config: dict[str, str], kind: str
) -> None:
    ran = tmp_path / "ran"
    (tmp_path / "hostile.py").write_text(f"import pathlib\npathlib.Path({str(ran)!r}).touch()\n")
    monkeypatch.syspath_prepend(tmp_path)
    config = {key: value.format(ran=ran) for key, value in config.items()}
    episode = Episode.load(run / "episodes" / EPISODE)
    hostile = replace(episode, metadata={**episode.metadata, "controller_config": config})
    path = hostile.save(tmp_path / "x.npz") if kind == "npz" else write_trace(hostile, tmp_path / "x.rrd")
    (verdict,) = verify(path, dataset=TINY, n_jobs=1)
    assert verdict.error is not None and "--trust" in verdict.error
    assert not ran.exists()


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"class": "socialnav_mj.controllers.potential_field:PotentialField", "gain": 1}, "no setting 'gain'"),
        ({"class": "socialnav_mj.controllers.potential_field:PotentialField", "position_gain": "1"}, "position_gain"),
        ({"class": "subprocess:getoutput", "cmd": "true"}, "no controller"),
        ({"class": "subprocess:Popen", "args": "true"}, "no controller"),
        ({"class": "tests.test_verification:Slow", "margin": 1}, "no setting 'margin'"),
        ({"class": 3}, "controller_config"),
        ([], "controller_config"),
    ],
)
def test_controllers_of_files_are_checked_before_they_are_called(config: Any, message: str) -> None:
    trusted = ("subprocess:getoutput", "subprocess:Popen", "tests.test_verification:Slow")
    with pytest.raises(ValueError, match=message):
        controller_of(config, trusted=trusted)


class Slow:
    """A plain class, as users write them."""

    name = "slow"

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        self.limits = limits

    def act(self, observation: Observation) -> Array:
        return self.limits.wheel_speed(np.tile([0.3, 0.0], (len(observation["active"]), 1)))


def test_trusted_controllers_are_verified(tmp_path: Path) -> None:
    path = f"{__name__}:Slow"
    plan = Evaluation(dataset=TINY, scenarios=("scenario_4",), controllers=(path,), draws=1)
    list(evaluate(plan, tmp_path, n_jobs=1))
    found = {v.path.name: v for v in verify(tmp_path, dataset=TINY, n_jobs=1)}
    assert [name for name, v in found.items() if v.error and f"--trust {path}" in v.error] == [
        next(name for name in found if "Slow" in name)
    ]
    trust = Trust(controllers=(path,))
    assert all(v.same for v in verify(tmp_path, dataset=TINY, trust=trust, n_jobs=1))


def test_robots_outside_of_the_assets_have_to_be_trusted(run: Path, tmp_path: Path) -> None:
    model = tmp_path / "mine.xml"
    shutil.copy(assets_folder() / "robot.xml", model)
    metadata = Episode.load(run / "episodes" / EPISODE).metadata
    scenario = {**metadata["scenario"], "robot": {**metadata["scenario"]["robot"], "model": str(model)}}
    metadata = {**metadata, "scenario": scenario}
    for name in (str(model), "../assets/../../x.xml"):
        scenario["robot"]["model"] = name
        with pytest.raises(ValueError, match="--trust-robot"):
            resimulate(metadata, dataset=TINY)
    scenario["robot"]["model"] = str(model)
    again = resimulate(metadata, dataset=TINY, trust=Trust(robots=(model,)))
    assert again.metadata["state_hash"] == metadata["state_hash"]


def test_nothing_to_verify_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no episodes"):
        files_of(tmp_path)
    (tmp_path / "traces").mkdir()
    (tmp_path / "traces" / "x.rrd").write_bytes(b"no trace")
    verdict = next(verify(tmp_path, n_jobs=1))
    assert verdict.error is not None and "x.rrd" in verdict.error


def test_command_exits_1_if_a_file_differs(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["verify", str(run), "--jobs", "1"]
    main([*command, "--dataset", TINY])
    assert "12 of 12 files say what their re-simulation says" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(SystemExit) as end:
        main(command)
    assert end.value.code == 1 and "8 of 12" in " ".join(capsys.readouterr().out.split())
