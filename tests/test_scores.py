"""Kept scores: the same tables as scored anew, for the same bytes and code alone."""

import os
import subprocess
import sys
from importlib import import_module
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line
from rich.console import Console

from socialnav_mj.config import Scenario
from socialnav_mj.report import scores
from socialnav_mj.report.results import read_results
from socialnav_mj.report.watching import watched


def make(controller, draw, **kwargs):
    """One agent that touches a person in odd draws."""
    return build_episode(
        [Agent(positions=line((0, 0), (4, 0), 20 + draw))],
        [Pedestrian(positions=np.zeros((40, 2)))],
        [Touch(agent=0, partner=0, step=2.5)] if draw % 2 else [],
        controller=controller,
        draw=draw,
        scenario=Scenario(share=0.1, seed=draw),
        scenario_name="scenario_1",
        **kwargs,
    )


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A cache of the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setattr(scores, "scores_folder", lambda: folder)
    return folder


@pytest.fixture
def run(tmp_path):
    for controller in ("potential_field", "human"):
        for draw in (0, 1):
            make(controller, draw).save(tmp_path / "run" / "episodes" / f"{controller}-{draw}.npz")
    return tmp_path / "run"


def files(kept):
    return sorted(kept.glob("*/*.arrows"))


def test_kept_scores_give_the_tables_of_fresh_ones(run, kept):
    anew = read_results(run, anew=True)
    assert not files(kept)
    for found in (read_results(run), read_results(run)):
        assert found.agents.equals(anew.agents, check_metadata=True)
        assert found.contacts.equals(anew.contacts, check_metadata=True)
        assert found.sources == anew.sources
        assert found.overlaps.keys() == anew.overlaps.keys()
        for key, values in anew.overlaps.items():
            np.testing.assert_array_equal(found.overlaps[key], values)
    assert len(files(kept)) == 4


def test_episodes_are_scored_once(run, kept, monkeypatch):
    read_results(run)
    monkeypatch.setattr(scores, "score", lambda path: pytest.fail(f"{path} was scored again"))
    read_results(run)


def test_another_episode_of_the_same_name_is_scored_anew(run, kept):
    first = read_results(run)
    path = run / "episodes" / "potential_field-0.npz"
    longer = build_episode(
        [Agent(positions=line((0, 0), (4, 0), 33))],
        [Pedestrian(positions=np.zeros((40, 2)))],
        [],
        controller="potential_field",
        scenario=Scenario(share=0.1, seed=0),
        scenario_name="scenario_1",
    )
    longer.save(path)
    second = read_results(run)
    assert second.agents["completion_time"][0].as_py() > first.agents["completion_time"][0].as_py()
    assert len(files(kept)) == 5


def test_other_code_scores_anew(run, kept, monkeypatch):
    read_results(run)
    monkeypatch.setattr(scores, "_code", lambda: "other")
    read_results(run)
    assert len(files(kept)) == 8


def test_damaged_scores_are_made_again(run, kept):
    expected = read_results(run)
    whole = {path: path.read_bytes() for path in files(kept)}
    for (path, content), kept_bytes in zip(whole.items(), (0, 1, 40, -900), strict=True):
        path.write_bytes(content[:kept_bytes] or b"nonsense")
    assert read_results(run).agents.equals(expected.agents)
    assert {path: path.read_bytes() for path in files(kept)} == whole


def test_old_scores_are_removed(run, kept):
    read_results(run)
    old = files(kept)[0]
    os.utime(old, (0, 0))
    scores.clear_old_scores()
    assert not old.exists() and len(files(kept)) == 3


def test_scores_depend_on_all_that_scoring_imports_and_not_on_the_simulator():
    """Whatever module of this package is loaded by then is one whose change scores episodes anew."""
    script = """if True:
        import sys
        import socialnav_mj.report.scores
        print(*(module.__file__ for name, module in sys.modules.items() if name.startswith("socialnav_mj.")))
    """
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    sources, root = scores.scoring_sources(), Path(scores.__file__).parents[2]
    assert len(loaded) > 20
    assert {Path(file).relative_to(root).as_posix() for file in loaded} <= {*sources}
    assert not {"socialnav_mj/physics.py", "socialnav_mj/task.py", "socialnav_mj/rollout.py"} & {*sources}


def test_whoever_watches_is_told_how_far_the_scoring_is(run, kept):
    told = []
    with watched(lambda *counts: told.append(counts)):
        read_results(run)
        read_results(run, anew=True, n_jobs=1)
    read_results(run)
    assert told == 2 * [(1, 4), (2, 4), (3, 4), (4, 4)]


@pytest.mark.parametrize("is_terminal", [True, False])
def test_commands_show_how_far_the_scoring_is(is_terminal, monkeypatch):
    """Again and again: a command may score several runs."""
    cli_console = import_module("socialnav_mj.cli.console")  # the package has a name `console` of its own
    shown = Console(file=StringIO(), force_terminal=is_terminal, width=80)
    monkeypatch.setattr(cli_console, "errors", shown)
    monkeypatch.setattr(cli_console, "_QUIET_TIME", 0.0)
    monkeypatch.setattr(cli_console, "_PATIENCE", 0.0)
    with cli_console.scoring() as tell:
        for _ in range(2):
            for count in (1, 2, 3):
                tell(count, 3)
    text = shown.file.getvalue()
    if is_terminal:
        assert text.count("3/3") >= 2 and "scoring" in text
    else:
        assert text.splitlines() == 2 * ["scored 1/3", "scored 2/3", "scored 3/3"]
