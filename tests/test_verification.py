"""Stored episodes and traces give the same states again, and whatever does not is told."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.analysis.report import write_report
from socialnav_mj.episode import Episode
from socialnav_mj.evaluation import Evaluation, evaluate
from socialnav_mj.verification import files_of, resimulate, verify

TINY = str(Path(__file__).parent / "data" / "tiny")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    plan = Evaluation(dataset=TINY, scenarios=("scenario_4",), controllers=("potential_field",), draws=1)
    # Interrupted after the first episode, and resumed with other processes.
    next(iter(evaluate(plan, folder, n_jobs=1)))
    list(evaluate(plan, folder, n_jobs=2))
    write_report(folder)
    return folder


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_episodes_and_traces_of_a_resumed_run_give_the_same_states(run: Path, n_jobs: int) -> None:
    verdicts = list(verify(run, dataset=TINY, n_jobs=n_jobs))
    assert sorted(v.path.suffix for v in verdicts) == [".npz", ".npz", ".rrd", ".rrd"]
    assert all(v.same for v in verdicts), verdicts


def test_cut_episode_is_verified_over_its_own_length(run: Path) -> None:
    metadata = dict(Episode.load(run / "episodes" / "scenario_4.potential_field.draw_000.npz").metadata)
    whole = resimulate(metadata, dataset=TINY)
    cut = resimulate({**metadata, "steps": 7}, dataset=TINY)
    assert len(cut.time) == 8
    np.testing.assert_array_equal(cut.agent_position, whole.agent_position[:8])
    again = resimulate(cut.metadata, dataset=TINY)
    assert again.metadata["state_hash"] == cut.metadata["state_hash"] != whole.metadata["state_hash"]


def test_other_states_and_other_recordings_are_told(run: Path, tmp_path: Path) -> None:
    episode = Episode.load(run / "episodes" / "scenario_4.potential_field.draw_000.npz")
    changed = {**episode.metadata, "state_hash": "0" * 64}
    fields = {name: getattr(episode, name) for name in Episode.__dataclass_fields__ if name != "metadata"}
    path = Episode(**fields, metadata=changed).save(tmp_path / "changed.npz")
    (verdict,) = verify(path, dataset=TINY, n_jobs=1)
    assert not verdict.same and verdict.error is None and verdict.hash == episode.metadata["state_hash"]
    (verdict,) = verify(path, dataset="plaza", n_jobs=1)
    assert verdict.error is not None and "no variant" in verdict.error
    (verdict,) = verify(path, n_jobs=1)
    assert verdict.error is not None and "--dataset" in verdict.error


def test_nothing_to_verify_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no episodes"):
        files_of(tmp_path)
    (tmp_path / "traces").mkdir()
    (tmp_path / "traces" / "x.rrd").write_bytes(b"no trace")
    (verdict,) = verify(tmp_path, n_jobs=1)
    assert verdict.error is not None and "x.rrd" in verdict.error


def test_command_exits_1_if_a_file_differs(run: Path) -> None:
    command = [sys.executable, "-c", "from socialnav_mj.cli import main; main()", "verify", str(run), "--jobs", "1"]
    good = subprocess.run([*command, "--dataset", TINY], capture_output=True, text=True)
    assert good.returncode == 0 and "4 of 4 files give the same states again" in good.stdout
    bad = subprocess.run(command, capture_output=True, text=True)
    assert bad.returncode == 1 and "0 of 4" in bad.stdout and "Traceback" not in bad.stderr
    assert json.loads((run / "run.json").read_text())
