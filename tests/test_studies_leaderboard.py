"""The leaderboard: ranks of made-up draws, and the command on the smallest crowd."""

import csv
from pathlib import Path

import numpy as np
import pytest
from agents import rows_of, table_of

from socialnav_mj.cli import main
from socialnav_mj.report import style
from socialnav_mj.studies.leaderboard.board import board_of
from socialnav_mj.studies.leaderboard.ranks import rank
from socialnav_mj.studies.leaderboard.study import CONTROLLERS, Leaderboard
from socialnav_mj.studies.panel import Entry

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 40)


def draws_of(levels, *, n_draws=20, spread=0.01, seed=0):
    """Draws have luck of their own, which all controllers share, and each deviates a little."""
    random = np.random.default_rng(seed)
    luck = random.normal(0.0, 0.1, (n_draws, 1))
    return np.array(levels) + luck + random.normal(0.0, spread, (n_draws, len(levels)))


def test_clear_differences_have_one_rank_each_whatever_draws_have_in_common():
    ranks = rank(draws_of([0.5, 0.9, 0.7]), more_is_better=True)
    assert ranks.lowest.tolist() == ranks.highest.tolist() == [3, 1, 2]
    assert ranks.improvement[1].tolist() == [1.0, 0.5, 1.0] and ranks.at_most[1].tolist() == [1.0, 1.0, 1.0]
    worse = rank(draws_of([0.5, 0.9, 0.7]), more_is_better=False)
    assert worse.lowest.tolist() == [1, 3, 2]


def test_ties_share_ranks():
    ranks = rank(draws_of([0.7, 0.7005, 0.2], spread=0.05), more_is_better=True)
    assert list(zip(ranks.lowest.tolist(), ranks.highest.tolist(), strict=True)) == [(1, 2), (1, 2), (3, 3)]
    same = rank(np.full((5, 3), 0.5), more_is_better=True)
    assert same.lowest.tolist() == [1, 1, 1] and same.highest.tolist() == [3, 3, 3]
    assert (same.improvement == 0.5).all() and (same.at_most == 1.0).all()


def test_two_draws_rank_nobody():
    ranks = rank(draws_of([0.1, 0.9], n_draws=2), more_is_better=True)
    assert ranks.lowest.tolist() == [1, 1] and ranks.highest.tolist() == [2, 2]


def test_rank_sets_of_all_equal_controllers_leave_nobody_out_in_nineteen_of_twenty_studies():
    """Eight equal controllers, 20 draws: no pair is told apart but in 5 % of studies; 200 studies, 0.05 +- 0.015."""
    told_apart = [
        rank(draws_of([0.5] * 8, spread=0.05, seed=seed), more_is_better=True).better.any() for seed in range(200)
    ]
    assert np.mean(told_apart) < 0.1


def test_front_leaves_out_whoever_is_beaten_in_both():
    """(success, share): (.9, .5), (.9, .3), (.8, .4), (.7, .2): the second and the last are beaten by nobody."""
    rows = [
        row
        for name, success, share in (("a", 0.9, 0.5), ("b", 0.9, 0.3), ("c", 0.8, 0.4), ("d", 0.7, 0.2))
        for draw in range(3)
        for row in rows_of(
            name,
            "scenario_1",
            draw,
            {
                "success": [k < 10 * success for k in range(10)],
                "intimate_intrusions": [round(100 * share)] * 10,
                "active_steps": 100,
                "intrusion_share": share,
            },
        )
    ]
    roster = [Entry(controller=name, method=name) for name in "abcd"]
    board = board_of(table_of(rows), roster, recording="made")
    assert [board.controllers[k] for k in board.front("scenario_1", "intrusion_share_of_steps")] == ["b", "d"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recordings": ()}, r"recordings = \(\) is not allowed"),
        ({"recordings": (TINY, TINY)}, "one or more of different names"),
        ({"controllers": ("orca",)}, "two or more, each once"),
        ({"controllers": ("orca", "orca")}, "two or more, each once"),
    ],
)
def test_impossible_boards_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Leaderboard(**{"recordings": (TINY,), **changes})


def test_every_controller_that_goes_somewhere_is_on_the_board():
    assert {"potential_field", "replay_irl", "mpc", "selector", "mpdm", "orca"} <= set(CONTROLLERS)
    assert "stand_still" not in CONTROLLERS
    learned = Leaderboard(recordings=("students003", "plaza")).rosters()
    assert learned["students003"]["replay_irl"] == "replay_irl(policy='students003_continuous_seed0')"
    assert learned["plaza"]["replay_irl"] == "replay_irl"


def test_command_runs_ranks_and_publishes_no_episode(tmp_path, capsys):
    out, public = tmp_path / "out", tmp_path / "results"
    command = ["leaderboard", "--recordings", TINY, "--scenarios", "1", "4", "--draws", "3", "--jobs", "1"]
    command += ["--controllers", "go_straight", "potential_field", "--also", "social_force"]
    main([*command, "--out", str(out), "--publish", str(public)])
    assert "leaderboard:" in capsys.readouterr().out
    assert sorted(path.name for path in public.iterdir()) == ["README.md", "figures", "provenance.json", "tables"]
    rows = list(csv.DictReader((public / "tables" / "leaderboard.csv").open()))
    assert {row["controller"] for row in rows} == {"go_straight", "potential_field", "social_force", "human"}
    ranked = [row for row in rows if row["measure"] == "success" and row["controller"] != "human"]
    assert len(ranked) == 2 * 3
    assert all(1 <= int(row["lowest_rank"]) <= int(row["highest_rank"]) <= 3 for row in ranked)
    page = (public / "README.md").read_text()
    for text in ("scenario 4: 90 % agents", "social_force | ", "## Ranks over recordings and scenarios", "| human |"):
        assert text in page
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")}
    main([*command, "--out", str(out)])
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")} == before
