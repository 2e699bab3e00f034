"""Kept scores: the same tables as scored anew, for the same bytes and code alone."""

import os

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj.config import Scenario
from socialnav_mj.report import scores
from socialnav_mj.report.results import read_results


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
