"""The leaderboard: ranks of made-up draws, and the command on the smallest crowd."""

import csv
import shlex
from pathlib import Path

import numpy as np
import pytest
from agents import rows_of, table_of

from socialnav_mj.cli import main
from socialnav_mj.episode import Episode
from socialnav_mj.report import style
from socialnav_mj.report.blocks import digest_of
from socialnav_mj.studies.leaderboard.board import board_of
from socialnav_mj.studies.leaderboard.families import Family, compare, families_of, there, verdict
from socialnav_mj.studies.leaderboard.page import leaderboard_page
from socialnav_mj.studies.leaderboard.ranks import critical, rank
from socialnav_mj.studies.leaderboard.study import Leaderboard
from socialnav_mj.studies.panel import Entry
from socialnav_mj.studies.study import CONTROLLERS

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 40)


def draws_of(levels, *, n_draws=20, spread=0.01, seed=0):
    """Draws have luck of their own, which all controllers share, and each deviates a little."""
    random = np.random.default_rng(seed)
    luck = random.normal(0.0, 0.1, (n_draws, 1))
    return (np.array(levels) + luck + random.normal(0.0, spread, (n_draws, len(levels))))[:, None]


def test_clear_differences_have_one_rank_each_whatever_draws_have_in_common():
    ranks = rank(draws_of([0.5, 0.9, 0.7]), more_is_better=True)
    assert ranks.lowest.tolist() == ranks.highest.tolist() == [3, 1, 2]
    assert ranks.improvement[1].tolist() == [1.0, 0.5, 1.0] and ranks.at_most[1].tolist() == [1.0, 1.0, 1.0]
    worse = rank(draws_of([0.5, 0.9, 0.7]), more_is_better=False)
    assert worse.lowest.tolist() == [1, 3, 2]


def test_ties_share_ranks():
    ranks = rank(draws_of([0.7, 0.7005, 0.2], spread=0.05), more_is_better=True)
    assert list(zip(ranks.lowest.tolist(), ranks.highest.tolist(), strict=True)) == [(1, 2), (1, 2), (3, 3)]
    same = rank(np.full((5, 1, 3), 0.5), more_is_better=True)
    assert same.lowest.tolist() == [1, 1, 1] and same.highest.tolist() == [3, 3, 3]
    assert (same.improvement == 0.5).all() and (same.at_most == 1.0).all()


def test_two_draws_rank_nobody():
    ranks = rank(draws_of([0.1, 0.9], n_draws=2), more_is_better=True)
    assert ranks.lowest.tolist() == [1, 1] and ranks.highest.tolist() == [2, 2]


@pytest.mark.parametrize("n_draws", [3, 5, 20])
def test_rank_sets_of_all_equal_controllers_leave_nobody_out_in_nineteen_of_twenty_studies(n_draws):
    """Eight equal controllers: no pair is told apart but in 5 % of studies; 200 studies, 0.05 +- 0.015."""
    told_apart = [
        rank(draws_of([0.5] * 8, n_draws=n_draws, spread=0.05, seed=seed), more_is_better=True).better.any()
        for seed in range(200)
    ]
    assert np.mean(told_apart) < 0.1
    # Shares of 43 agents are not normal, and often the same.
    shares = [np.random.default_rng(seed).binomial(43, 0.97, (n_draws, 1, 8)) / 43 for seed in range(200)]
    assert np.mean([rank(cells, more_is_better=True).better.any() for cells in shares]) < 0.1


def test_the_largest_of_one_pairs_t_is_students():
    """Two controllers have one pair: the two-sided 95 % quantile of t with 4 and 19 degrees of freedom."""
    assert critical(5, 2) == pytest.approx(2.776, rel=0.05) and critical(20, 2) == pytest.approx(2.093, rel=0.05)
    # Of three alike with many draws it is Tukey's, 3.314 / sqrt(2).
    assert critical(400, 3) == pytest.approx(2.344, rel=0.05)


def test_a_difference_that_is_the_same_in_every_draw_tells_nobody_apart():
    cells = np.repeat([[[0.5, 0.6]]], 5, axis=0)
    assert not rank(cells, more_is_better=True).better.any()


def test_trainings_that_differ_leave_controllers_tied_that_one_training_tells_apart():
    """0.9 and 0.8 in every draw; the second one's trainings spread by .1, so that others might be better."""
    random = np.random.default_rng(3)
    fixed, learned = (level + random.normal(0.0, 0.005, (20, 3)) for level in (0.9, 0.8))
    fixed[:] = fixed[:, :1]
    alike = rank(np.stack([fixed, learned], axis=2), more_is_better=True)
    assert alike.better.tolist() == [[False, True], [False, False]]
    spread = rank(np.stack([fixed, learned + np.array([-0.1, 0.0, 0.1])], axis=2), more_is_better=True)
    assert not spread.better.any()
    assert spread.improvement[0, 1] == 1.0 and 0.5 < spread.at_most[0, 0] < 1.0


def test_controller_with_fewer_trainings_is_compared_by_those_that_it_has():
    cells = np.stack([draws_of([0.9, 0.9], spread=0.001)[:, 0], np.full((20, 2), 0.5)], axis=2)
    cells[:, 1, 1] = np.nan
    ranks = rank(cells, more_is_better=True)
    assert ranks.lowest.tolist() == ranks.highest.tolist() == [1, 2]


def luck_of(name, n_draws):
    """0 in half of the draws and 1 in the others, in an order of the controller's own."""
    return np.random.default_rng(len(name)).permutation(n_draws) % 2


def rows_for(levels, *, n_draws=10):
    """Agents of made-up controllers: {name: (share that succeeds, steps within 1.2 m, time)}; draws differ a little."""
    return [
        row
        for name, (success, steps, time) in levels.items()
        for draw in range(n_draws)
        for row in rows_of(
            name,
            "scenario_1",
            draw,
            {
                "success": [k < 100 * success - luck_of(name, n_draws)[draw] for k in range(100)],
                "intimate_intrusions": [steps + luck_of(name, n_draws)[draw]] * 100,
                "active_steps": 100,
                "intrusion_share": (steps + luck_of(name, n_draws)[draw]) / 100.0,
                "time_under_way": time + 0.1 * (draw * len(name) % 5),
            },
        )
    ]


MADE = {
    "potential_field": (0.70, 40, 15.0),
    "replay_irl": (0.80, 30, 16.0),
    "hybrid": (0.79, 31, 15.5),
    "mpc": (0.99, 20, 11.0),
    "mpc(preset='calm')": (0.96, 10, 15.5),
}


def board_of_made():
    roster = [Entry(controller=name, method=name) for name in MADE]
    return board_of(table_of(rows_for(MADE)), roster, recording="made")


def test_marks_are_given_to_whoever_reaches_them():
    """Strong: success >= .97, fewer steps than ReplayIRL, less time than the field. Calm: >= .95 and half the steps."""
    marks = {mark.controller: mark for mark in board_of_made().marks}
    assert [name for name, mark in marks.items() if mark.is_strong] == ["mpc"]
    assert [name for name, mark in marks.items() if mark.is_calm] == ["mpc(preset='calm')"]
    assert marks["mpc"].steps.mean == pytest.approx(-10.0, abs=1.0) and marks["mpc"].time.mean == pytest.approx(
        -4.0, abs=0.5
    )
    some = board_of(table_of(rows_for({"mpc": MADE["mpc"]})), [Entry(controller="mpc", method="mpc")], recording="made")
    assert some.marks == ()


def test_mixtures_are_compared_with_all_their_parts():
    families = families_of((*MADE, "selector", "mpdm"))
    found = {family.child: family for family in families}
    assert found["hybrid"].parents == ("replay_irl", "potential_field") and not found["hybrid"].missing
    assert found["selector"].parents == ("mpc(preset='calm')", "hybrid") and found["selector"].missing == (
        "mpc(preset='free')",
    )
    assert found["mpdm"].parents == ("replay_irl", "hybrid")
    assert set(found["mpdm"].missing) == {"potential_field_capped", "social_force", "stand_still"}
    board = board_of_made()
    assert verdict(board, found["hybrid"], "scenario_1") == "no"
    better = Family(child="mpc", parents=("potential_field", "replay_irl"), missing=())
    assert verdict(board, better, "scenario_1") == "success"
    calm = Family(child="mpc(preset='calm')", parents=("mpc", "replay_irl"), missing=())
    assert verdict(board, calm, "scenario_1") == "nearness"
    rows = compare(board, calm)
    assert len(rows) == 2 * 3
    assert rows[0]["difference"] == pytest.approx(-0.03) and rows[0]["verdict"] == -1


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
        ({"settings": ("icy",)}, "unknown setting 'icy'; available: default, turn_per_second"),
        ({"trainings": 0}, "trainings = 0 is not allowed"),
        ({"other_draws": 11}, "other_draws = 11 is not allowed; allowed: 1 to draws = 10"),
        ({"setting_controllers": ("orcas",)}, "setting_controllers has 'orcas'; allowed: the controllers, "),
        ({"setting_controllers": ("orca",)}, "none, or two or more, each once"),
    ],
)
def test_impossible_boards_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Leaderboard(**{"recordings": (TINY,), **changes})


def test_every_controller_that_goes_somewhere_is_on_the_board():
    assert {"potential_field", "replay_irl", "mpc", "selector", "mpdm", "orca"} <= set(CONTROLLERS)
    assert "stand_still" not in CONTROLLERS
    study = Leaderboard(recordings=("students003", "plaza"), trainings=1)
    learned, default = ({e.method: e.controller for e in study.roster(name)} for name in study.recordings)
    assert learned["replay_irl"] == "replay_irl(policy='students003_continuous_seed0')"
    assert default["replay_irl"] == "replay_irl"


def test_learned_controllers_stand_with_as_many_trainings_as_there_are():
    study = Leaderboard(recordings=("students003", "plaza"), controllers=("orca", "replay_irl", "hybrid"), trainings=3)
    entries = study.roster("students003")
    assert [entry.training_seed for entry in entries if entry.method == "replay_irl"] == [0, 1, 2]
    assert [entry.training_seed for entry in entries if entry.method == "hybrid"] == [0, 1, 2]
    assert any("students003_continuous_seed2" in entry.controller for entry in entries if entry.method == "hybrid")
    assert [entry.training_seed for entry in entries if entry.method == "orca"] == [None]
    assert [entry.training_seed for entry in study.roster("plaza") if entry.method == "replay_irl"] == [None]


def test_other_settings_run_on_the_first_recording_with_policies_for_their_turn_limit():
    study = Leaderboard(
        recordings=("students003", "plaza"),
        controllers=("orca", "go_straight"),
        settings=("radii_0.25", "turn_per_second"),
        draws=20,
        other_draws=5,
    )
    runs = {run.name: run.evaluation for run in study.runs()}
    assert list(runs) == ["students003", "plaza", "students003.radii_0.25", "students003.turn_per_second"]
    assert runs["students003.radii_0.25"].task_kwargs == {"pedestrian_radius": 0.08}
    assert [run.draws for run in runs.values()] == [20, 5, 5, 5]


def test_other_settings_may_have_fewer_controllers_and_their_mixtures_the_parts_that_are_there():
    names = ("orca", "hybrid", "replay_irl", "potential_field", "selector")
    some = ("hybrid", "replay_irl", "selector")
    study = Leaderboard(
        recordings=("students003",), controllers=names, settings=("retire",), setting_controllers=some, trainings=1
    )
    assert [entry.method for entry in study.roster("students003")] == [*names, "human"]
    assert [entry.method for entry in study.roster("students003", "retire")] == [*some, "human"]
    levels = {name: MADE[name] for name in ("hybrid", "replay_irl")}
    roster = [Entry(controller=name, method=name) for name in levels]
    board = board_of(table_of(rows_for(levels)), roster, recording="students003", setting="retire")
    (family,) = there(families_of(names), board)
    assert (family.child, family.parents) == ("hybrid", ("replay_irl",))
    page = leaderboard_page(
        [board_of_made(), board],
        families=families_of(names),
        costs={},
        origins=[],
        provenance={"command": "c", "experiment": {}, "recordings": [], "policies": {}, "runs": {}},
    )
    assert "students003, retire on collision" in page and "| students003" in page


def test_command_runs_ranks_and_publishes_no_episode(tmp_path, capsys):
    out, public = tmp_path / "out", tmp_path / "results"
    command = ["leaderboard", "--recordings", TINY, "--scenarios", "1", "4", "--draws", "3", "--jobs", "1"]
    command += ["--controllers", "go_straight", "potential_field", "--also", "social_force"]
    command += [
        "--settings",
        "radii_0.40",
        "--other-draws",
        "2",
        "--setting-controllers",
        "go_straight",
        "social_force",
        "--costs",
        str(tmp_path / "costs.json"),
    ]
    (tmp_path / "costs.json").write_text('{"controllers": [{"controller": "social_force", "ratio": 0.123}]}')
    main([*command, "--out", str(out), "--publish", str(public)])
    assert "leaderboard:" in capsys.readouterr().out
    assert sorted(path.name for path in public.iterdir()) == ["README.md", "figures", "provenance.json", "tables"]
    assert 'src="data:image/svg+xml' in (out / "report.html").read_text()
    rows = list(csv.DictReader((public / "tables" / "leaderboard.csv").open()))
    assert {row["controller"] for row in rows} == {"go_straight", "potential_field", "social_force", "human"}
    ranked = [row for row in rows if row["measure"] == "success" and row["controller"] != "human"]
    assert len(ranked) == 2 * (3 + 2)
    assert all(1 <= int(row["lowest_rank"]) <= int(row["highest_rank"]) <= 3 for row in ranked)
    assert all(float(row["rank_at_most_1"]) <= float(row["rank_at_most_3"]) <= 1.0 for row in ranked)
    assert {float(row["rank_at_most_3"]) for row in ranked} == {1.0}
    successes = [row for row in rows if row["measure"] == "success"]
    people = {(row["setting"], row["scenario"]): row for row in successes if row["controller"] == "human"}
    for row in ranked:
        own = float(row["mean"]) - float(people[row["setting"], row["scenario"]]["mean"])
        assert float(row["minus_human"]) == pytest.approx(own, abs=1e-5)
    page = (public / "README.md").read_text()
    for text in (
        "scenario 4: 90 % agents",
        "social_force | ",
        "## Ranks over recordings and scenarios",
        "| human |",
        "0.12",
    ):
        assert text in page
    rows = [
        line.split(" | ") for line in page.split("## A row by itself")[1].splitlines() if "socialnav-mj eval" in line
    ]
    found = {(row[0].strip("| "), row[1]): (row[2].strip("`"), row[3].strip("| ").split(" / ")) for row in rows}
    assert len(found) == 4 + 3 and len({tuple(digests) for _, digests in found.values()}) == 4 + 3
    # The command of a row makes the episodes of that row.
    line, digests = found["tiny.radii_0.40", "social_force"]
    main([*shlex.split(line)[1:], "--jobs", "1", "--out", str(tmp_path / "row")])
    for scenario, digest in zip((1, 4), digests, strict=True):
        files = sorted((tmp_path / "row" / "episodes").glob(f"scenario_{scenario}.social_force.draw_*.npz"))
        assert len(files) == 2
        assert digest_of([Episode.load(path).metadata["state_hash"] for path in files])[:12] == digest
    assert list((tmp_path / "row").rglob("*.rrd"))
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")}
    main([*command, "--out", str(out)])
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")} == before


OWN = """from dataclasses import dataclass

from socialnav_mj.controllers.go_straight import GoStraight


class Mine(GoStraight):
    pass


@dataclass(kw_only=True)
class Other(GoStraight):
    name: str = "other_name"
"""


@pytest.mark.parametrize("study", ["leaderboard", "reaction"])
def test_a_controller_of_a_users_own_joins_under_whatever_name_it_gives_itself(study, tmp_path, monkeypatch, capsys):
    """Its class calls it go_straight, or other_name, and so do its episodes; the board, as it was asked for."""
    module = f"joins_{study}"
    (tmp_path / f"{module}.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    names = [f"{module}:Mine", f"{module}:Other", "potential_field"]
    command = [study, "--recordings", TINY, "--scenarios", "4", "--draws", "3", "--jobs", "1", "--out", "out"]
    main([*command, "--controllers", *names])
    table = "leaderboard" if study == "leaderboard" else "levels"
    rows = list(csv.DictReader((tmp_path / "out" / "tables" / f"{table}.csv").open()))
    found = {row["controller"] for row in rows if row["measure"] == "success" and row["mean"]}
    assert found - {"human"} == {*names}
