"""The whole experiment on the smallest crowd: planned, run, resumed, written, published."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest
from agents import experiment_table
from toy_policies import write_toy

from socialnav_mj.cli import main
from socialnav_mj.controllers import make_controller
from socialnav_mj.episode import EpisodeError
from socialnav_mj.report import style
from socialnav_mj.report.intervals import ONE_RECORDING
from socialnav_mj.report.results import Results
from socialnav_mj.studies.claims import CLAIMS
from socialnav_mj.studies.files import publish
from socialnav_mj.studies.paper import outputs, plan
from socialnav_mj.studies.paper.outputs import PUBLIC, agents_of, write_outputs
from socialnav_mj.studies.paper.plan import DEFAULT, SWEEP, VARIANTS, Experiment, shipped_for
from socialnav_mj.studies.study import read_runs, reproduce, run_folder

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")


@pytest.fixture(scope="module")
def policies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("policies")
    return tuple(write_toy(folder, f"p{seed}", seed=seed) for seed in (1, 0))


@pytest.fixture(scope="module")
def of_both_limits(policies, tmp_path_factory):
    folder = tmp_path_factory.mktemp("policies")
    return *policies, write_toy(folder, "slow", seed=5, turn_limit="per_second")


@pytest.fixture
def experiment(policies):
    return Experiment(dataset=TINY, policies=policies, scenarios=("scenario_1", "scenario_4"), draws=2)


@pytest.fixture
def whole(experiment, of_both_limits):
    return replace(experiment, policies=of_both_limits, variants=plan.OTHERS)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 40)


def test_plan_runs_every_method_of_every_training_in_the_default_setting(experiment):
    (run,) = experiment.runs()
    methods = [(entry.method, entry.training_seed) for entry in run.roster]
    learned = [(method, seed) for method in ("replay_irl", "mixed") for seed in (0, 1)]
    fields = [("potential_field", None), ("potential_field_capped", None)]
    assert methods == [*fields, *learned, ("human", None)]
    assert len(experiment.jobs()) == 2 * 2 * 7


def test_plan_names_controllers_as_the_tables_do(whole):
    for run in whole.runs():
        specs = [entry.controller for entry in run.roster if entry.method != "human"]
        assert [make_controller(spec).name for spec in specs] == specs == list(run.evaluation.controllers)


def test_variants_change_what_they_say_and_nothing_else(whole):
    runs = {run.name: run for run in whole.runs()}
    assert list(runs) == [variant.name for variant in VARIANTS] + ["switch_sweep"]
    assert runs["radii_0.25"].evaluation.task_kwargs == {"pedestrian_radius": 0.08}
    assert runs["radii_0.40"].evaluation.task_kwargs == {"pedestrian_radius": 0.23}
    assert runs["turn_per_second"].evaluation.task_kwargs == {"turn_limit": "per_second"}
    assert runs["yielding"].evaluation.task_kwargs == {"pedestrians": "yielding"}
    assert runs["unicycle"].evaluation.task_kwargs == {"plant": "unicycle"}
    assert runs["retire"].evaluation.task_kwargs == {"on_collision": "retire"}
    anyone = [make_controller(c) for c in runs["switch_anyone"].evaluation.controllers]
    assert [(c.who, c.switch_distance) for c in anyone] == [("anyone", 2.0)] * 2
    capped = [make_controller(c) for c in runs["capped"].evaluation.controllers]
    assert [c.far.name for c in capped] == ["potential_field_capped"] * 2
    default = [make_controller(c) for c in runs["default"].evaluation.controllers]
    assert [c.far.name for c in default[-2:]] == ["potential_field"] * 2
    slow = [(e.method, e.training_seed) for e in runs["turn_per_second"].roster if e.training_seed is not None]
    assert slow == [("replay_irl", 5), ("mixed", 5)]
    swept = [make_controller(c).switch_distance for c in runs["switch_sweep"].evaluation.controllers]
    assert swept == [d for d in SWEEP for _ in range(2)] and 2.0 not in SWEEP


def test_only_the_variants_that_are_asked_for_are_run(experiment):
    some = replace(experiment, variants=("switch_sweep", "yielding"))
    assert [run.name for run in some.runs()] == ["default", "yielding", "switch_sweep"]
    assert [variant.name for variant in some.settings] == ["default", "yielding"]
    with pytest.raises(ValueError, match=r"variants: 'default' is not allowed; allowed: turn_per_second, capped"):
        replace(experiment, variants=("default",))


def test_variants_may_have_fewer_draws_and_trainings_than_the_default_setting(whole):
    wide = replace(whole, draws=3, variant_draws=2, variant_trainings=1, seed=5)
    assert [run.evaluation.draws for run in wide.runs()] == [3, 3, 3, 2, 2, 2, 2, 2, 2, 2]
    trainings = [sorted({e.training_seed for e in run.roster} - {None}) for run in wide.runs()]
    assert trainings == [[0, 1], [5], [0, 1], [0], [0], [0], [0], [0], [0], [0]]
    table = experiment_table(n_draws=9, n_agents=2, trainings=(0, 1))
    spec = next(e.controller for e in wide.roster(DEFAULT) if e.method == "potential_field")
    table = table.set_column(
        table.schema.get_field_index("controller"), "controller", pa.array([spec] * table.num_rows)
    )
    variant = next(v for v in VARIANTS if v.name == "switch_anyone")
    empty = Results(agents=table.slice(0, 0), contacts=pa.table({}), overlaps={}, sources=())
    results = {"default": replace(empty, agents=table), variant.name: empty}
    assert max(agents_of(wide, variant, results)["draw"].to_pylist()) == 6
    with pytest.raises(ValueError, match="variant_draws = 4 is not allowed; allowed: 1 to draws = 3"):
        replace(wide, variant_draws=4)
    with pytest.raises(ValueError, match="variant_trainings = 0 is not allowed"):
        replace(wide, variant_trainings=0)


def test_variant_takes_unchanged_methods_from_the_default_setting(experiment):
    variant = next(v for v in VARIANTS if v.name == "switch_anyone")
    table = experiment_table(n_draws=1, n_agents=2, trainings=(0, 1))
    roster = {e.method + str(e.training_seed): e.controller for e in experiment.roster(DEFAULT)}
    known = {
        "irl0": "replay_irl0",
        "irl1": "replay_irl1",
        "cap": "potential_field_cappedNone",
        "mix0": "mixed0",
        "mix1": "mixed1",
        "pf": "potential_fieldNone",
        "human": "humanNone",
    }
    controllers = pa.array([roster[known[name]] for name in table["controller"].to_pylist()])
    table = table.set_column(table.schema.get_field_index("controller"), "controller", controllers)
    results = {
        name: Results(agents=table, contacts=pa.table({}), overlaps={}, sources=())
        for name in ("default", variant.name)
    }
    results[variant.name] = replace(results[variant.name], agents=table.slice(0, 0))
    taken = set(agents_of(experiment, variant, results)["controller"].to_pylist())
    assert taken == {"potential_field", "potential_field_capped", roster["replay_irl0"], roster["replay_irl1"]}
    assert agents_of(experiment, DEFAULT, results).num_rows == table.num_rows


def test_experiment_refuses_no_policy_two_of_a_seed_and_unknown_recordings(policies):
    with pytest.raises(ValueError, match="one or more trained policies"):
        Experiment(dataset=TINY, policies=())
    with pytest.raises(ValueError, match=r"training seeds \[1, 1\]; allowed: one of each"):
        Experiment(dataset=TINY, policies=(policies[0], policies[0]))
    with pytest.raises(ValueError, match="there is none for: turn limit per second"):
        Experiment(dataset=TINY, policies=policies, variants=plan.OTHERS)
    with pytest.raises(ValueError, match="no shipped policy was trained on 'nowhere' with 'continuous' features"):
        shipped_for("nowhere")


def test_command_runs_goes_on_and_publishes_no_episode(policies, tmp_path, capsys):
    """One training: of more there are as many more episodes."""
    out, public = tmp_path / "out", tmp_path / "results"
    command = ["reproduce", "--dataset", TINY, "--policies", policies[0], "--scenarios", "1", "4", "--draws", "1"]
    command += ["--seed", "0"]
    command += ["--jobs", "1", "--out", str(out), "--publish", str(public)]
    main(command)
    assert "claims:" in capsys.readouterr().out.replace("\n", " ")
    episodes = sorted((out / "runs" / "default" / "episodes").glob("*.npz"))
    assert len(episodes) == 2 * 5
    before = {path: path.stat().st_mtime_ns for path in episodes}
    tables = {path.name: path.read_bytes() for path in (out / "tables").iterdir()}
    episodes[3].unlink()
    main(command)
    after = {path: path.stat().st_mtime_ns for path in episodes}
    assert [path for path in episodes if after[path] != before[path]] == [episodes[3]]
    assert {path.name: path.read_bytes() for path in (out / "tables").iterdir()} == tables

    assert sorted(path.name for path in public.iterdir()) == sorted(
        ["README.md", "claims.md", "figures", "provenance.json", "tables"]
    )
    shown = (out / "report.html").read_text()
    assert 'href="claims.html"' in shown and "socialnav-mj view runs/default/episodes/" in shown
    assert (out / "claims.html").is_file()
    assert not list(public.rglob("*.npz")) and not list(public.rglob("*.parquet"))
    assert {p.name for p in public.glob("tables/*")} == {
        "levels.csv",
        "claims.csv",
        "held_out.csv",
        "switch_distance.csv",
    }
    page = (public / "README.md").read_text()
    assert ONE_RECORDING in page and " claims are undecided. *To decide*: " in page
    (heading,) = (
        line for line in page.splitlines() if line.startswith("| scenario | controller | success | first collision")
    )
    assert heading.endswith("| same agents |")
    found = re.findall(r"\| (\d+) of (\d+)(?: \(\d+ %\))? \|$", page, flags=re.MULTILINE)
    assert len(found) == 2 * 5 and all(int(count) <= int(total) for count, total in found)
    linked = [part.split(")")[0] for part in page.split("](")[1:]]
    assert len(linked) >= 7 and all((public / name).is_file() for name in linked)


def test_variants_and_sweep_are_run_and_judged(whole, of_both_limits, tmp_path, monkeypatch):
    swept = (SWEEP[0], SWEEP[-1])
    for module in (plan, outputs):
        monkeypatch.setattr(module, "SWEEP", swept)
    experiment = replace(whole, policies=of_both_limits[1:], scenarios=("scenario_4",), draws=1)
    done = list(reproduce(experiment, tmp_path, command="made so", n_jobs=1))
    assert len(done) == len(experiment.jobs()) and all(d.error is None for d in done)
    page = write_outputs(experiment, tmp_path, command="made so", n_jobs=1)
    claims = list(csv.DictReader((tmp_path / "tables" / "claims.csv").open()))
    assert {row["variant"] for row in claims} == {variant.name for variant in VARIANTS}
    rows = list(csv.DictReader((tmp_path / "tables" / "switch_distance.csv").open()))
    assert {float(row["switch_distance"]) for row in rows} == {*swept, 2.0}
    assert {row["method"] for row in rows} == {"mixed"}
    assert (tmp_path / "figures" / "figure_6_switch_distance.svg").is_file()
    assert "## Switch distance" in page.read_text()
    assert "turn limit per second" in (tmp_path / "figures" / "figure_8_variants.svg").read_text()
    text = (tmp_path / "claims.md").read_text()
    assert all(variant.title in text for variant in VARIANTS) and all(f"## ({c.key}) " in text for c in CLAIMS)
    provenance = json.loads((tmp_path / "provenance.json").read_text())
    assert provenance["command"] == "made so"
    assert all(len(facts["sha256"]) == 64 for facts in provenance["policies"].values())
    assert all(run["versions"][0]["mujoco"] for run in provenance["runs"].values())


def test_fewer_draws_than_the_folder_holds_are_read_alone(experiment, tmp_path):
    experiment = replace(experiment, policies=experiment.policies[:1], scenarios=("scenario_4",))
    list(reproduce(experiment, tmp_path, n_jobs=1))
    for draws in (2, 1):
        results = read_runs(replace(experiment, draws=draws), tmp_path, n_jobs=1)["default"]
        assert len(results.sources) == 5 * draws and {s.draw for s in results.sources} == {*range(draws)}


def test_other_settings_in_the_same_folder_are_refused_before_anything_runs(experiment, of_both_limits, tmp_path):
    experiment = replace(experiment, scenarios=("scenario_1",), draws=1)
    list(reproduce(experiment, tmp_path, n_jobs=1))
    (run_folder(tmp_path, "default")).rename(tmp_path / "runs" / "radii_0.25")
    with pytest.raises(EpisodeError, match=r"pedestrian_radius = 0.15, but 0.08 is asked for"):
        reproduce(replace(experiment, policies=of_both_limits, variants=plan.OTHERS), tmp_path, n_jobs=1)
    assert not run_folder(tmp_path, "default").joinpath("episodes").exists()


def test_publishing_needs_outputs(tmp_path):
    with pytest.raises(FileNotFoundError):
        publish(tmp_path / "nothing", tmp_path / "results", PUBLIC)
