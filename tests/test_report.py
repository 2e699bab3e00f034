"""From episode files to tables: values by hand, equal bytes for equal episodes, clear errors, nothing lost."""

import csv
import io
import json
import math
import shutil
from dataclasses import replace

import lxml.html
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line
from markdown_it import MarkdownIt
from rich.console import Console

from socialnav_mj.cli.terminal import terminal_tables
from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode, EpisodeError, Outcome
from socialnav_mj.metrics.dialects import compute
from socialnav_mj.report import writer
from socialnav_mj.report.agents import SCHEMA, agents_table
from socialnav_mj.report.estimates import MEASURES, draw_means, estimate, summarise
from socialnav_mj.report.intervals import ONE_RECORDING
from socialnav_mj.report.page import with_error
from socialnav_mj.report.results import read_results

LABELS = {"dataset": "d", "variant": "v", "scenario": "s", "controller": "c", "measure": "m"}
CONTROLLERS = ("zigzag", "human", "potential_field")


def make(controller="potential_field", share=0.1, draw=0, **kwargs):
    """Two agents; the first hits somebody in odd draws, the second always times out."""
    agents = [
        Agent(positions=line((0, 0), (4, 0), 20 + draw)),
        Agent(positions=line((0, 3), (4, 3), 30), goal=(9, 3), outcome=Outcome.TIMED_OUT),
    ]
    touches = [Touch(agent=0, partner=0, step=2.5)] if draw % 2 else []
    name = {0.1: "scenario_1", 0.9: "scenario_4"}[share]
    options = {"scenario": Scenario(share=share, seed=draw), "scenario_name": name} | kwargs
    return build_episode(
        agents, [Pedestrian(positions=np.zeros((40, 2)))], touches, controller=controller, draw=draw, **options
    )


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    """A run of three controllers, two scenarios and four draws."""
    folder = tmp_path_factory.mktemp("template")
    for controller in CONTROLLERS:
        for share in (0.9, 0.1):
            for draw in range(4):
                make(controller, share, draw).save(folder / "episodes" / f"{controller}-{share}-{draw}.npz")
    run = {"command": "socialnav-mj evaluate", "controllers": ["zigzag"], "episodes": []}
    (folder / "run.json").write_text(json.dumps(run))
    return folder


@pytest.fixture
def run(template, tmp_path, monkeypatch):
    """A copy of the run; traces are replaced by a note of what they would show."""

    def note(episode, path):
        path.parent.mkdir(exist_ok=True)
        path.write_text(episode.metadata["state_hash"])

    monkeypatch.setattr("socialnav_mj.trace.writer.write_trace", note)
    return shutil.copytree(template, tmp_path / "run")


def outputs(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_agents_table_has_the_schema_and_nulls_where_a_metric_is_undefined():
    table = agents_table(make(draw=1), file="a.npz")
    assert table.schema == SCHEMA
    first, second = table.to_pylist()
    assert (first["success"], first["first_partner"], first["collisions_pedestrian"]) == (False, "pedestrian", 1)
    assert first["completion_steps"] == 21 and first["episode"] == "a.npz" and first["draw"] == 1
    assert (second["completion_time"], second["completion_steps"], second["first_partner"]) == (None, None, None)
    assert second["time_under_way"] == pytest.approx(6.0) and second["completion_censored"]


def test_agents_table_names_the_metadata_it_lacks():
    episode = make()
    lacking = {key: value for key, value in episode.metadata.items() if key != "draw"}
    with pytest.raises(EpisodeError, match="lack draw; there are controller"):
        agents_table(replace(episode, metadata=lacking))


def test_rows_are_ordered_by_scenario_then_given_controllers_then_human(run):
    table = read_results(run, controllers=["zigzag"]).agents
    seen = list(dict.fromkeys(zip(table["scenario"].to_pylist(), table["controller"].to_pylist(), strict=True)))
    assert seen == [(s, c) for s in ("scenario_1", "scenario_4") for c in ("zigzag", "potential_field", "human")]
    assert table["draw"].to_pylist()[:8] == [0, 0, 1, 1, 2, 2, 3, 3]


def test_summary_has_the_means_worked_out_by_hand(run):
    rows = {(e.scenario, e.controller, e.measure): e for e in summarise(read_results(run).agents)}
    assert len(rows) == 2 * 3 * len(MEASURES)
    success = rows["scenario_1", "potential_field", "success"]  # draws: 1/2, 0, 1/2, 0
    assert (success.mean, success.n_draws, success.n_agents) == (0.25, 4, 8)
    assert success.standard_error == pytest.approx(math.sqrt(4 * 0.25**2 / 3) / 2)
    assert 0.0 < success.low < 0.25 < success.high < 1.0
    assert rows["scenario_1", "potential_field", "first_hit_pedestrian"].mean == 0.25
    assert rows["scenario_1", "potential_field", "timed_out"].mean == 0.5
    assert rows["scenario_1", "potential_field", "completion_time"].mean == pytest.approx(0.2 * (20 + 21 + 22 + 23) / 4)
    assert rows["scenario_1", "potential_field", "completion_time_success"].mean == pytest.approx(0.2 * (20 + 22) / 2)
    # the time-out counts with the 6 s it was watched
    assert rows["scenario_1", "potential_field", "time_under_way"].mean == pytest.approx((4.3 + 6.0) / 2)
    # within 1.2 m of the origin: 6 of 20, 7 of 21 (4 / 21 * 6 = 1.14), 7 of 22 and 7 of 23; never of 30
    shares = [6 / 50, 7 / 51, 7 / 52, 7 / 53]
    assert rows["scenario_1", "potential_field", "intrusion_share_of_steps"].mean == pytest.approx(np.mean(shares))
    shares = [6 / 40, 7 / 42, 7 / 44, 7 / 46]
    assert rows["scenario_1", "potential_field", "intrusion_share"].mean == pytest.approx(np.mean(shares))


def test_human_row_of_equal_tracks_has_equal_values(run):
    rows = {(e.scenario, e.controller, e.measure): e for e in summarise(read_results(run).agents)}
    for measure in MEASURES:
        human, arrow = rows["scenario_4", "human", measure], rows["scenario_4", "potential_field", measure]
        np.testing.assert_equal((human.mean, human.standard_error), (arrow.mean, arrow.standard_error))


def test_draw_is_the_unit_and_not_the_agent():
    values = np.array([1.0, 0.0, 0.0, 0.0])
    result = estimate(values, np.ones(4), np.array([3, 5, 5, 5]), labels=LABELS)
    assert (result.mean, result.standard_error) == (0.5, 0.5)


@pytest.mark.parametrize(
    ("values", "note"),
    [
        ([], "no agent has a value"),
        ([np.nan], "no agent has a value"),
        ([1.0], "1 draw; an interval needs 3"),
        ([1.0, 2.0], "2 draws; an interval needs 3"),
        ([1.0, 2.0, np.nan], "2 draws; an interval needs 3"),
        ([0.1, 0.1, 0.1], "all draws are equal"),
        ([1.0, 2.0, 4.0], ""),
    ],
)
def test_estimate_says_why_it_has_no_interval(values, note):
    array = np.array(values, dtype=float)
    result = estimate(array, np.ones(len(array)), np.arange(len(array)), labels=LABELS)
    assert result.note == note
    assert math.isnan(result.low) == bool(note)


def test_means_of_draws_weigh_agents_and_leave_out_draws_without_values():
    values, weights = np.array([1.0, 4.0, np.nan, 2.0, 9.0]), np.array([3.0, 1.0, 1.0, 1.0, 0.0])
    draws, means = draw_means(values, weights, np.array([7, 7, 3, 5, 5]))
    assert draws.tolist() == [5, 7] and means.tolist() == [2.0, 1.75]


def test_interval_covers_the_mean_of_normal_draws_about_as_often_as_it_says():
    random = np.random.default_rng(7)
    draws, trials = np.arange(20), 100
    hits = 0
    for _ in range(trials):
        result = estimate(random.normal(0.7, 0.1, 20), np.ones(20), draws, labels=LABELS)
        hits += result.low <= 0.7 <= result.high
    assert 0.89 * trials <= hits <= trials  # three binomial standard deviations are 6.5 %


def test_share_of_nobody_is_shown_with_the_bound_of_its_agents(run):
    found = {(e.scenario, e.controller, e.measure): e for e in summarise(read_results(run).agents)}
    nobody = found["scenario_1", "human", "overturned"]
    bound = 1.959964**2 / (8 + 1.959964**2)
    assert (nobody.mean, nobody.low, nobody.high) == (0.0, 0.0, pytest.approx(bound))
    assert with_error(nobody, 3) == f"0.000 (0.000 to {bound:.3f})"
    text = writer.write_report(run).path.read_text()
    assert f"| 0.000 (0.000 to {bound:.3f}) |" in text and ONE_RECORDING in text


def test_report_mentions_every_scenario_controller_and_hash(run):
    text = writer.write_report(run).path.read_text()
    for word in ("scenario_1", "scenario_4", "10 % of", "90 % of", "socialnav-mj evaluate", "mujoco 3.17.0", "0" * 64):
        assert word in text, word
    lines = text.splitlines()
    first_cells = [row.split("|")[1].strip() for row in lines if row.startswith("|")]
    assert [cell for cell in first_cells if cell in CONTROLLERS] == 2 * ["zigzag", "potential_field", "human"]
    for path in (run / "episodes").iterdir():
        assert f"| {path.name} |" in text and Episode.load(path).metadata["state_hash"] in text
    assert "Warning" not in text


def test_report_writes_tables_that_agree_with_each_other(run):
    writer.write_report(run)
    assert pq.read_table(run / "agents.parquet").schema == SCHEMA
    summary = json.loads((run / "summary.json").read_text())
    rows = list(csv.DictReader((run / "summary.csv").open()))
    assert len(rows) == 6 * len(MEASURES)
    groups = {(g["scenario"], g["controller"]): g for g in summary["groups"]}
    for row in rows:
        value = groups[row["scenario"], row["controller"]]["estimates"][row["measure"]]["mean"]
        assert (float(row["mean"]) if row["mean"] else None) == value
    group = groups["scenario_4", "potential_field"]
    assert group["draws"] == [0, 1, 2, 3] and group["scenario_configuration"]["share"] == 0.9
    assert "seed" not in group["scenario_configuration"] and group["controller_configuration"] == {"gain": 1.0}
    assert summary["recordings"][0]["name"] == "made_up"


def test_traces_show_the_first_draw_of_every_scenario_and_controller(run):
    writer.write_report(run)
    traces = {path.name for path in (run / "traces").iterdir()}
    assert traces == {f"{c}-{s}-0.rrd" for c in CONTROLLERS for s in (0.1, 0.9)}
    first = Episode.load(run / "episodes" / "potential_field-0.9-0.npz")
    assert (run / "traces" / "potential_field-0.9-0.rrd").read_text() == first.metadata["state_hash"]


def test_equal_episodes_give_equal_bytes_whatever_the_number_of_processes(run):
    writer.write_report(run)
    before = outputs(run)
    assert set(before) == {"agents.parquet", "summary.csv", "summary.json", "report.html", "report.md", "run.json"}
    writer.write_report(run, n_jobs=2)
    assert outputs(run) == before


def test_damaged_episode_is_named_and_nothing_already_there_is_lost(run):
    writer.write_report(run)
    before = outputs(run)
    victim = run / "episodes" / "potential_field-0.1-2.npz"
    victim.write_bytes(victim.read_bytes()[:2000])
    for n_jobs in (1, 2):
        with pytest.raises(EpisodeError, match=r"potential_field-0\.1-2\.npz is not a readable episode"):
            writer.write_report(run, n_jobs=n_jobs)
    assert outputs(run) == before


def test_interrupted_write_leaves_the_old_file_and_no_remains(run, monkeypatch):
    writer.write_report(run)
    before = outputs(run)

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("socialnav_mj.files.os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        writer.write_report(run)
    assert outputs(run) == before


def test_folder_without_episodes_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no episodes in .*episodes; expected \*\.npz"):
        writer.write_report(tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"command": 1, "controllers": []}', '{"command": "x"}'])
def test_damaged_run_file_is_named(run, text):
    (run / "run.json").write_text(text)
    with pytest.raises(ValueError, match=r"run\.json"):
        writer.write_report(run)


def test_only_named_episodes_are_read(run):
    names = [path.name for path in sorted((run / "episodes").glob("*.npz")) if "0.1-" in path.name]
    table = read_results(run, files=names).agents
    assert set(table["episode"].to_pylist()) == {*names} and set(table["scenario"].to_pylist()) == {"scenario_1"}
    with pytest.raises(FileNotFoundError, match=r"2 of 14 episodes are not there, the first is .*episodes.no\.npz$"):
        read_results(run, files=[*names, "no.npz", "none.npz"])


def test_same_draw_twice_is_refused(run):
    make("potential_field", 0.1, 2).save(run / "episodes" / "copy.npz")
    with pytest.raises(EpisodeError, match=r"copy\.npz and potential_field-0\.1-2\.npz are both draw 2 of made_up"):
        read_results(run)


@pytest.mark.parametrize("controller", ["potential_field", "another"])
def test_episodes_of_different_scenario_settings_are_not_compared(run, controller):
    other = Scenario(share=0.1, seed=9, turn_limit="per_second")
    make(controller, 0.1, 9, scenario=other).save(run / "episodes" / "other.npz")
    with pytest.raises(EpisodeError, match=r"other\.npz.* different config.* scenario / scenario_1: .*per_second"):
        read_results(run)


def test_episodes_of_different_recordings_of_one_name_are_not_compared(run):
    make("potential_field", 0.1, 9, recording={"checksum": "f" * 64}).save(run / "episodes" / "other.npz")
    with pytest.raises(EpisodeError, match=r"other\.npz.* different configurations of made_up / by_hand / recording: "):
        read_results(run)


def test_episodes_of_different_controller_settings_are_not_compared(run):
    episode = make("potential_field", 0.1, 9)
    other = replace(episode, metadata=episode.metadata | {"controller_config": {"gain": 2.0}})
    other.save(run / "episodes" / "other.npz")
    with pytest.raises(EpisodeError, match=r"other\.npz.* controller / potential_field: gain = 1\.0, but 2\.0"):
        read_results(run)


def test_uneven_draws_are_pointed_out(run):
    (run / "episodes" / "potential_field-0.1-3.npz").unlink()
    text = writer.write_report(run).path.read_text()
    assert "**Warning**: the rows of made_up / by_hand / scenario_1 have different draws" in text


def test_dialects_get_tables_with_the_same_draws_as_units(run):
    """One of two agents arrives, and hits somebody in every other draw: success to the paper, not to Francis et al."""
    writer.write_report(run, dialects=("paper", "francis2023"), n_jobs=2)
    for dialect, success in (("paper", 0.25), ("francis2023", 0.5)):
        rows = list(csv.DictReader((run / "tables" / f"dialect_{dialect}.csv").open()))
        found = {(r["scenario"], r["controller"], r["measure"]): r for r in rows}
        assert len(found) == len(rows) == 6 * len(compute(make(), dialect))
        for scenario in ("scenario_1", "scenario_4"):
            for controller in CONTROLLERS:
                row = found[scenario, controller, "success"]
                assert (float(row["mean"]), row["n_draws"], row["n_agents"]) == (success, "4", "8")
    ours = {r["measure"]: r for r in csv.DictReader((run / "summary.csv").open()) if r["scenario"] == "scenario_4"}
    last = {r["measure"]: r for r in csv.DictReader((run / "tables" / "dialect_paper.csv").open())}
    for name in ("intimate_intrusions", "average_speed", "success"):
        assert last[name] == ours[name]
    shutil.rmtree(run / "tables")
    with pytest.raises(ValueError, match=r"unknown dialect 'esperanto'; available: paper, socnavbench"):
        writer.write_report(run, dialects=("esperanto",))
    assert not (run / "tables").exists()


@pytest.mark.parametrize("width", [80, 120])
def test_terminal_tables_fit_and_name_every_row(run, width):
    console = Console(width=width, record=True, file=io.StringIO())
    for table in terminal_tables(writer.write_report(run).estimates):
        console.print(table)
    text = console.export_text()
    for word in (*CONTROLLERS, "scenario_1", "scenario_4", "0.25", "0.14", "4 draws", "[s]", "[m/s]"):
        assert word in text, word
    assert "…" not in text and max(map(len, text.splitlines())) <= width
    assert "speed" in text and text.count("±") == 2 + 6


def test_table_of_an_empty_episode_has_no_rows():
    table = agents_table(build_episode([], [Pedestrian(positions=[(0, 0)])]))
    assert table.num_rows == 0 and table.schema == SCHEMA and summarise(pa.concat_tables([table])) == []


HOSTILE_NAMES = ("<script>alert(1)</script>", "[a](javascript:alert(1))", "`` ` <b>", "a|b")


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_names_from_files_stay_text_in_the_report(name, tmp_path):
    make(name).save(tmp_path / "episodes" / "a.npz")
    run = {"command": f"evaluate {name}", "controllers": [], "episodes": ["a.npz"]}
    (tmp_path / "run.json").write_text(json.dumps(run))
    text = writer.write_report(tmp_path).path.read_text()
    shown = lxml.html.fromstring(MarkdownIt("commonmark").enable("table").render(text))
    assert not shown.xpath("//script | //b | //a")
    cells = [cell.text_content() for cell in shown.xpath("//td[1]")]
    assert any(name.replace("`", "") in cell.replace("`", "") for cell in cells)


@pytest.mark.parametrize("name", ["# a\n# b", "x" * 201, "a\x1b[31m", "a\u2028b"])
def test_names_that_are_no_names_are_refused(name, tmp_path):
    make(name).save(tmp_path / "episodes" / "a.npz")
    with pytest.raises(EpisodeError, match=r"a\.npz.*controller.*printable"):
        writer.write_report(tmp_path)
