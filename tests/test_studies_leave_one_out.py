"""Leave one recording out: who is held out where, on which agents, and what of it may be published."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from agents import rows_of, table_of
from toy_policies import write_toy

from socialnav_mj.cli import main
from socialnav_mj.controllers import make_controller
from socialnav_mj.studies.leave_one_out import study as leave_one_out
from socialnav_mj.studies.leave_one_out.comparison import side_by_side
from socialnav_mj.studies.leave_one_out.study import LeaveOneOut, shipped_leaving_one_out, write_leave_one_out
from socialnav_mj.studies.panel import Entry
from socialnav_mj.studies.study import read_runs, reproduce

TINY = Path(__file__).parent / "data" / "tiny" / "tiny.txt"
NAMES = ("east", "north", "west")
PAIRS = (("north", "west"), ("east", "west"), ("east", "north"))
"""What the policy learned from that left out the recording of the same place in NAMES."""
TRAIN_END = 0.1
"""Of the tiny recording: people 1 and 2 are there from the beginning, person 3 comes after 0.15 of it."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    return tuple(str(shutil.copy(TINY, folder / f"{name}.txt")) for name in NAMES)


@pytest.fixture(scope="module")
def policies(tmp_path_factory):
    """One for each pair, each of another training seed's weights, so that no two drive alike, but of seed 0."""
    folder = tmp_path_factory.mktemp("policies")
    return tuple(toy(folder, pair, turn=k) for k, pair in enumerate(PAIRS))


def toy(folder, pair, *, seed=0, turn=0, **settings):
    name = f"{'_'.join(pair)}_continuous_seed{seed}"
    path = write_toy(folder, name, seed=turn, datasets=pair, **{"train_end": TRAIN_END, **settings})
    card = Path(path).with_suffix(".json")
    content = json.loads(card.read_text())
    content["config"]["seed"] = seed
    card.write_text(json.dumps(content))
    return path


@pytest.fixture
def study(recordings, policies):
    return LeaveOneOut(recordings=recordings, policies=policies, scenarios=("scenario_4",), draws=1)


def table_rows(out):
    return list(csv.DictReader((out / "tables" / "leave_one_out.csv").open()))


def test_every_recording_is_driven_by_all_policies_in_a_run_of_its_own(study, recordings, policies):
    runs = study.runs()
    assert [run.name for run in runs] == list(NAMES)
    assert [run.evaluation.dataset for run in runs] == list(recordings)
    for run in runs:
        specs = [entry.controller for entry in run.roster if entry.method != "human"]
        assert list(run.evaluation.controllers) == specs == [make_controller(spec).name for spec in specs]
        assert set(specs) == {"potential_field", *(f"replay_irl(policy={policy!r})" for policy in policies)}
    east = {entry.controller: entry.method for entry in runs[0].roster}
    assert east[f"replay_irl(policy={policies[0]!r})"] == study.method("east") == "replay_irl(north+west)"
    assert len(study.jobs()) == 3 * 5


def test_all_training_seeds_of_a_recording_left_out_count(study, policies, tmp_path):
    more = (*policies, *(toy(tmp_path, pair, seed=1) for pair in PAIRS))
    for run in replace(study, policies=more[::-1]).runs():
        assert len(run.roster) == 8
        assert [e.training_seed for e in run.roster if e.method == "replay_irl(east+west)"] == [0, 1]


def test_comparison_takes_only_the_people_who_were_learned_from():
    """By hand: of people 0 to 3 who count, 2 succeed held out, 4 and 3 in-sample; of the others just the opposite."""
    successes = {
        "far": [0, 0, 0, 0, 1, 1],
        "new": [1, 0, 1, 0, 1, 1],
        "old": [1, 1, 1, 1, 0, 0],
        "other": [1, 1, 1, 0, 0, 0],
        "human": [1, 1, 1, 1, 0, 0],
    }
    rows = [
        row
        for name, values in successes.items()
        for draw in range(3)
        for row in rows_of(name, "scenario_1", draw, {"success": [v > 0 for v in values], "active_steps": 10})
    ]
    roster = [
        Entry(controller="far", method="potential_field"),
        Entry(controller="old", method="replay_irl(a+b)", training_seed=0),
        Entry(controller="other", method="replay_irl(a+c)", training_seed=0),
        Entry(controller="new", method="replay_irl(b+c)", training_seed=0),
        Entry(controller="human", method="human"),
    ]
    side = side_by_side(
        table_of(rows), roster, held_out="replay_irl(b+c)", people=range(4), recording="a", window=(0.0, 0.6)
    )
    means = {m: side.levels.find("scenario_1", m, "success") for m in side.methods}
    assert [level.interval.mean for level in means.values()] == [0.0, 1.0, 0.75, 0.5, 1.0]
    assert [level.n_values for level in means.values()] == [3 * 4] * 5
    assert [side.role(m) for m in side.methods] == ["", "in-sample", "in-sample", "held out", ""]
    found = {d.method: d for d in side.differences if d.measure == "success"}
    assert {name: d.interval.mean for name, d in found.items()} == {
        "replay_irl(b+c) - replay_irl(a+b)": -0.5,
        "replay_irl(b+c) - replay_irl(a+c)": -0.25,
        "replay_irl(b+c) - in-sample": -0.375,
    }
    assert all(d.n_values == 12 and d.interval.note == "all draws are equal" for d in found.values())


def test_differences_take_the_training_seeds_that_both_have():
    """Held out .5 and 1 with seeds 0 and 1, in-sample 0 with seed 0 alone: the difference is .5, the level .75."""
    values = {"new0": [True, False], "new1": [True, True], "old0": [False, False]}
    rows = [row for name, own in values.items() for row in rows_of(name, "scenario_1", 0, {"success": own})]
    roster = [
        Entry(
            controller=name,
            method="replay_irl(b)" if name[:3] == "new" else "replay_irl(a)",
            training_seed=int(name[3]),
        )
        for name in values
    ]
    side = side_by_side(table_of(rows), roster, held_out="replay_irl(b)", people=(0, 1), recording="a", window=(0, 1))
    assert side.levels.find("scenario_1", "replay_irl(b)", "success").interval.mean == 0.75
    assert {d.method for d in side.differences} == {"replay_irl(b) - replay_irl(a)"}
    difference = side.differences[0]
    assert (difference.interval.mean, difference.interval.n_trainings, difference.n_values) == (0.5, 1, 2)


def test_tables_hold_each_recordings_own_roles_and_the_same_agents(study, tmp_path):
    assert all(done.error is None for done in reproduce(study, tmp_path, n_jobs=1))
    page = write_leave_one_out(study, tmp_path, command="made so", n_jobs=1).read_text()
    rows = [r for r in table_rows(tmp_path) if r["measure"] == "success" and r["training"] == "all"]
    roles = {(r["recording"], r["method"]): r["role"] for r in rows if r["role"] != "difference"}
    for place, name in enumerate(NAMES):
        for left_out, pair in zip(NAMES, PAIRS, strict=True):
            role = "held out" if left_out == name else "in-sample"
            assert roles[name, f"replay_irl({'+'.join(pair)})"] == role
        assert roles[name, "potential_field"] == roles[name, "human"] == ""
        assert f"| ReplayIRL({'+'.join(PAIRS[place])}) | held out |" in page.split(f"## {name}, people who appear")[1]
    assert {r["n_values"] for r in rows} == {"2"}  # people 1 and 2, whoever drives, not person 3
    assert "## east, people who appear in 0 to 10 % of its duration" in page and "made so" in page

    results = read_runs(study, tmp_path, n_jobs=1)
    for run in study.runs():
        agents = results[run.name].agents.to_pylist()
        for entry in run.roster:
            own = [a for a in agents if a["controller"] == entry.controller and a["person"] in (1, 2)]
            expected = sum(a["intimate_intrusions"] for a in own) / sum(a["active_steps"] for a in own)
            (row,) = [
                r
                for r in table_rows(tmp_path)
                if (r["recording"], r["method"], r["measure"], r["training"])
                == (run.name, entry.method, "intrusion_share_of_steps", "all")
            ]
            assert float(row["mean"]) == pytest.approx(expected, abs=1e-6)


def test_command_goes_on_and_publishes_no_episode(recordings, policies, tmp_path, capsys):
    out, public = tmp_path / "out", tmp_path / "results"
    command = ["leave-one-out", "--recordings", *recordings, "--policies", *policies, "--scenarios", "1"]
    command += ["--draws", "1", "--jobs", "1", "--out", str(out), "--publish", str(public)]
    main(command)
    assert "to be committed:" in capsys.readouterr().out.replace("\n", " ")
    episodes = sorted(out.glob("runs/*/episodes/*.npz"))
    assert len(episodes) == 3 * 5 and {path.parts[-3] for path in episodes} == set(NAMES)
    before = {path: path.stat().st_mtime_ns for path in episodes}
    table = (out / "tables" / "leave_one_out.csv").read_bytes()
    episodes[7].unlink()
    main(command)
    assert [path for path in episodes if path.stat().st_mtime_ns != before[path]] == [episodes[7]]
    assert (out / "tables" / "leave_one_out.csv").read_bytes() == table

    files = {str(path.relative_to(public)) for path in public.rglob("*") if path.is_file()}
    assert files == {"README.md", "provenance.json", "tables/leave_one_out.csv"}
    assert "Where every row comes from" in (out / "report.html").read_text()
    provenance = json.loads((public / "provenance.json").read_text())
    assert [recording["name"] for recording in provenance["recordings"]] == list(NAMES)
    assert list(provenance["runs"]) == list(NAMES) and set(provenance["policies"]) == set(policies)


def test_policies_that_do_not_leave_out_exactly_one_recording_are_refused(recordings, policies, tmp_path):
    with pytest.raises(
        ValueError, match=r"no policy learned from east and north and left out west; given: .*north_west"
    ):
        LeaveOneOut(recordings=recordings, policies=policies[:2])
    with pytest.raises(ValueError, match=r"left out east; given: none; train one with .* --dataset north west"):
        LeaveOneOut(recordings=recordings, policies=())
    for wrong in (("east",), NAMES, ("east", "elsewhere"), ("east", "north", "elsewhere")):
        with pytest.raises(
            ValueError, match=rf"learned from {', '.join(sorted(wrong))}; allowed: all but one of east, north"
        ):
            LeaveOneOut(recordings=recordings, policies=(*policies, toy(tmp_path, wrong)))
    twin = toy(tmp_path, ("west", "north"))
    with pytest.raises(ValueError, match=r"left out the same recording and have the same training seed, 0"):
        LeaveOneOut(recordings=recordings, policies=(*policies, twin))
    longer = toy(tmp_path, ("north", "west"), seed=1, train_end=0.5)
    with pytest.raises(ValueError, match="different parts"):
        LeaveOneOut(recordings=recordings, policies=(*policies, longer))
    for given in (recordings[:1], (*recordings, recordings[0])):
        with pytest.raises(ValueError, match="two or more of different names"):
            LeaveOneOut(recordings=given, policies=policies)


def test_shipped_policies_are_chosen_by_their_cards(policies, recordings, monkeypatch):
    shipped = [*policies, write_toy(Path(policies[0]).parent, "east_continuous_seed0", seed=0, datasets=["east"])]
    monkeypatch.setattr(leave_one_out, "shipped_policies", lambda: tuple(shipped))
    assert shipped_leaving_one_out(recordings) == policies
    assert shipped_leaving_one_out(NAMES) == policies
    assert shipped_leaving_one_out(("east", "north")) == (shipped[-1],)
    assert shipped_leaving_one_out(NAMES, "risk") == ()
