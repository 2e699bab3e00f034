"""report.html by itself: what is drawn, shaded and escaped, where rows come from, and that nothing is loaded or run."""

import json

import lxml.html
import numpy as np
import pyarrow as pa
import pytest
from episodes import Agent, Pedestrian, build_episode, line

from socialnav_mj.config import Scenario
from socialnav_mj.report.agents import agents_table
from socialnav_mj.report.blocks import Cell, Row, Table, cell_of, digest_of
from socialnav_mj.report.html import html_page
from socialnav_mj.report.origins import command_of_row
from socialnav_mj.report.run_file import RunFile
from socialnav_mj.report.ties import standings
from socialnav_mj.report.writer import write_report

PLACE = ("made_up", "by_hand", "scenario_1")
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="10" height="10"><text>figure</text></svg>'


def episode(controller, draw, *, steps):
    """One agent that needs some steps for 4 m, beside a person who stands far away."""
    agents = [Agent(positions=line((0, 0), (4, 0), steps))]
    scenario = Scenario(share=0.1, seed=draw)
    people = [Pedestrian(positions=np.full((40, 2), 9.0))]
    options = {"scenario": scenario, "scenario_name": "scenario_1", "controller": controller, "draw": draw}
    return build_episode(agents, people, [], **options)


@pytest.fixture(autouse=True)
def no_traces(monkeypatch):
    """Their writing has tests of its own."""
    monkeypatch.setattr("socialnav_mj.trace.writer.write_trace", lambda episode, path: None)


@pytest.fixture
def run(tmp_path):
    """Four draws: `fast` needs 20 to 23 steps, `slow` 10 more each, `fickle` is sometimes faster, sometimes slower."""
    extra = {"fast": (0, 0, 0, 0), "slow": (10, 10, 11, 10), "fickle": (5, -3, 4, -2), "human": (2, 2, 2, 2)}
    for controller, own in extra.items():
        for draw, more in enumerate(own):
            episode(controller, draw, steps=20 + draw + more).save(tmp_path / "episodes" / f"{controller}.{draw}.npz")
    names = sorted(path.name for path in (tmp_path / "episodes").iterdir())
    command = "/usr/bin/socialnav-mj evaluate --scenarios 1 --draws 4 --controllers fast slow a:F --out x"
    content = {"command": command, "controllers": ["fast", "slow", "fickle", "human"], "episodes": names}
    (tmp_path / "run.json").write_text(json.dumps(content))
    return tmp_path


def tree(page):
    return lxml.html.fromstring(page.decode())


def test_report_draws_intervals_shades_ties_and_says_where_rows_come_from(run):
    shown = tree(write_report(run).page.read_bytes())
    table = shown.xpath("//table")[0]
    headings = [th.text_content() for th in table.xpath(".//th")]
    column = headings.index("time, censored [s]")
    told = [th.get("title") for th in table.xpath(".//th")]
    assert (
        told[0] is None
        and "lower bound" in told[column]
        and told[headings.index("time of successes [s]")] != told[column]
    )
    rows = {tr.xpath("./td")[0].text_content(): tr.xpath("./td") for tr in table.xpath("./tbody/tr")}
    assert list(rows) == ["fast", "slow", "fickle", "human"]
    looks = {name: cells[column].get("class").split() for name, cells in rows.items()}
    assert looks == {"fast": ["number", "best"], "slow": ["number"], "fickle": ["number", "tie"], "human": ["number"]}
    cell = rows["slow"][column]
    assert float(cell.get("data-sort")) == pytest.approx(0.2 * np.mean([30, 31, 33, 33]))
    assert len(cell.xpath(".//svg/circle")) == 1 and "95 % interval" in cell.get("title")
    origin = rows["fickle"][1].text_content()
    hashes = [
        json.loads((run / "summary.json").read_text())["groups"][2]["episodes"][k]["state_hash"] for k in range(4)
    ]
    assert digest_of(hashes) in origin and "traces/fickle.0.rrd" in origin
    assert "socialnav-mj evaluate --scenarios 1 --draws 4 --controllers a:F" in origin


def test_page_needs_no_other_file_and_names_the_scripts_that_may_run(run):
    shown = tree(write_report(run).page.read_bytes())
    links = [*shown.xpath("//@src"), *shown.xpath("//link/@href")]
    assert links and all(link.startswith("data:") for link in links)
    assert len(shown.xpath("//script")) == 2 and not shown.xpath("//script/@src")
    policy = shown.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")[0]
    assert policy.startswith("default-src 'none'") and policy.count("'sha256-") == 2


def test_warnings_come_first(run):
    (run / "episodes" / "slow.3.npz").unlink()
    shown = tree(write_report(run).page.read_bytes())
    main = [element for element in shown.xpath("//main/*") if element.tag != "h1"]
    assert main[0].get("class") == "warning" and "different draws" in main[0].text_content()
    assert len(shown.xpath("//p[starts-with(., 'Warning')]")) == 1


@pytest.mark.parametrize(
    "name", ["<script>alert(1)</script>", "<img src=x onerror=alert(1)>", '"><b>', "[a](b)", "`a`"]
)
def test_names_from_files_are_text(name, tmp_path):
    for draw in range(3):
        episode(name, draw, steps=20).save(tmp_path / "episodes" / f"{draw}.npz")
    content = {"command": f"socialnav-mj evaluate {name}", "controllers": [name], "episodes": []}
    (tmp_path / "run.json").write_text(json.dumps(content))
    shown = tree(write_report(tmp_path).page.read_bytes())
    assert len(shown.xpath("//script")) == 2 and not shown.xpath("//b | //img[@onerror] | //a[text()='a']")
    assert shown.xpath("//table")[0].xpath(".//td")[0].text_content() == name


def test_figures_are_put_in_and_none_from_outside_the_folder(tmp_path):
    folder = tmp_path / "page"
    folder.mkdir()
    (folder / "a.svg").write_text(SVG)
    (tmp_path / "secret.svg").write_text(SVG)
    shown = tree(html_page(["# T\n\n![one](a.png)\n\n![two](../secret.svg)\n\n[c](claims.md)"], folder))
    sources = shown.xpath("//img/@src")
    assert sources[0].startswith("data:image/svg+xml;base64,") and sources[1] == "data:,"
    assert shown.xpath("//main//a/@href") == ["claims.html"] and shown.xpath("//img/@alt") == ["one", "two"]


@pytest.mark.parametrize(
    ("text", "value", "interval", "tied"),
    [
        ("0.750 (0.612 to 0.861)", 0.75, (0.612, 0.861), False),
        ("0.000 (0.000 to 0.123) (x 2.1)", 0.0, (0.0, 0.123), False),
        ("+0.012 (-0.010 to +0.034)", 0.012, (-0.01, 0.034), True),
        ("-0.020 (-0.050 to +0.010)", -0.02, (-0.05, 0.01), True),
        ("-0.020 (-0.050 to -0.010)", -0.02, (-0.05, -0.01), False),
        ("1,234", 1234.0, None, False),
        ("0.1 / 0.2", 0.1, None, False),
        ("12.5 ± 0.3", 12.5, None, False),
        ("1-3", 1.0, None, True),
        ("2-3", 2.0, None, False),
        ("1", 1.0, None, False),
    ],
)
def test_cells_of_markdown_tables_are_read(text, value, interval, tied):
    cell = cell_of(text)
    assert (cell.value, cell.tied, cell.is_text, cell.has_interval) == (value, tied, False, interval is not None)
    assert interval is None or (cell.low, cell.high) == interval


@pytest.mark.parametrize(("text", "key"), [("human", None), ("-", ""), ("3d view", None), ("1.50", "1.5")])
def test_cells_without_a_number_are_sorted_as_text_and_missing_ones_last(text, key):
    assert cell_of(text).key == key


def test_intervals_of_a_column_share_a_scale_and_zero_is_marked_within():
    rows = [(-1.0, 1.0), (0.0, 3.0)]
    cells = [Cell(shown="", value=sum(ends) / 2, low=ends[0], high=ends[1]) for ends in rows]
    scale = Table(headings=("a",), rows=tuple(Row(cells=(cell,)) for cell in cells)).scale(0)
    assert (scale.place(-1.0), scale.place(3.0), scale.place(1.0), scale.zero) == ("4.0", "96.0", "50.0", 27.0)
    lone = Table(headings=("a",), rows=(Row(cells=(Cell(shown="", value=1.0, low=1.0, high=1.0),)),)).scale(0)
    assert lone.place(1.0) == "50.0" and lone.zero is None


def test_ties_need_three_shared_draws():
    few = [agents_table(episode(name, draw, steps=steps)) for name, steps in (("a", 20), ("b", 25)) for draw in (0, 1)]
    assert standings(pa.concat_tables(few)) == {}
    more = [agents_table(episode(name, 2, steps=steps)) for name, steps in (("a", 20), ("b", 25))]
    found = standings(pa.concat_tables([*few, *more]))
    assert found[PLACE, "success"].ties == {"b"} and found[PLACE, "time_under_way"].best == "a"
    assert found[PLACE, "time_under_way"].ties == frozenset()


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (
            "x/socialnav-mj evaluate --controllers one two(a=1) --seed=5",
            "--seed 5 --scenarios 2 --controllers 'two(a=1)'",
        ),
        ("socialnav-mj evaluate --out r --draws 3", "--draws 3 --scenarios 2 --controllers b"),
    ],
)
def test_command_of_a_row_is_the_runs_own_for_it_alone(command, expected):
    run = RunFile(command=command, controllers=("a", "b", "human"), episodes=())
    found = command_of_row(run, "scenario_2", "b")
    assert found == f"socialnav-mj evaluate {expected}"
    assert "--controllers" not in command_of_row(run, "scenario_2", "human")


@pytest.mark.parametrize("command", ["", "unclosed '", "socialnav-mj reproduce --draws 3"])
def test_command_that_is_no_evaluation_stays_as_it_is(command):
    run = RunFile(command=command, controllers=("a",), episodes=())
    assert command_of_row(run, "scenario_1", "a") == command
