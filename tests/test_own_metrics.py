"""Metrics of users: named by path or entry point, in every table with their interval, refused where they are wrong."""

import json
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from socialnav_mj.cli import main
from socialnav_mj.episode import EpisodeError
from socialnav_mj.report import own_metrics as module
from socialnav_mj.report.own_metrics import own_metrics

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
MINE = """
import numpy as np

def comfort(episode):
    '''Twice the number of the agent.'''
    return 2.0 * np.arange(episode.n_agents)

def short(episode):
    return np.zeros(episode.n_agents + 1)

def failing(episode):
    return episode.nothing

success = comfort
NUMBER = 3
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "my_metrics", raising=False)
    (tmp_path / "my_metrics.py").write_text(MINE)
    return tmp_path


def test_own_metric_stands_in_every_table_and_is_verified_if_it_is_trusted(capsys: pytest.CaptureFixture[str]) -> None:
    run = ["evaluate", "--dataset", TINY, "--scenarios", "4", "--draws", "2", "--jobs", "1", "--out", "o"]
    main([*run, "--controllers", "go_straight", "--metrics", "my_metrics:comfort"])
    assert "own metrics" in capsys.readouterr().out
    agents = pyarrow.parquet.read_table("o/agents.parquet")
    assert agents["comfort"].to_pylist() == [2.0 * agent for agent in agents["agent"].to_pylist()]
    rows = [line for line in Path("o/summary.csv").read_text().splitlines() if ",comfort," in line]
    assert len(rows) == 2 and all(",2.0," in row for row in rows)  # 0, 2 and 4 in each draw
    report = Path("o/report.md").read_text()
    assert "## Own metrics" in report and "Twice the number of the agent." in report and "2.000 ± 0.000" in report
    assert json.loads(Path("o/run.json").read_text())["metrics"] == ["my_metrics:comfort"]

    with pytest.raises(SystemExit):
        main(["verify", "o", "--dataset", TINY, "--jobs", "1"])
    assert "--trust my_metrics:comfort" in capsys.readouterr().out
    main(["verify", "o", "--dataset", TINY, "--jobs", "1", "--trust", "my_metrics:comfort"])
    main(["report", "o", "--jobs", "1"])
    assert "comfort" not in Path("o/summary.csv").read_text() + Path("o/run.json").read_text()


@pytest.mark.parametrize(
    ("spec", "named"),
    [
        ("comfort", "unknown metric 'comfort'; expected package.module:function"),
        ("nowhere:comfort", "cannot be imported: No module named 'nowhere'"),
        ("my_metrics:nothing", "has no attribute 'nothing'"),
        ("my_metrics:NUMBER", "is a int; expected a function of an Episode, or a Metric"),
        ("my_metrics:success", "success declared more than once"),
    ],
)
def test_what_is_no_metric_is_refused(spec: str, named: str) -> None:
    with pytest.raises(ValueError, match=r"metric|declared") as caught:
        own_metrics([spec])
    assert named in str(caught.value)


def test_wrong_results_are_told_with_their_place() -> None:
    class Three:
        n_agents = 3

    short, failing = own_metrics(["my_metrics:short", "my_metrics:failing"])
    with pytest.raises(EpisodeError, match=r"gives shape \(4,\); expected \(3,\)"):
        short.function(Three())  # type: ignore[arg-type]
    with pytest.raises(EpisodeError, match=r"AttributeError: .*my_metrics\.py:12"):
        failing.function(Three())  # type: ignore[arg-type]


def test_installed_packages_offer_metrics_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("cosy", "my_metrics:comfort", module.ENTRY_POINT_GROUP)
    monkeypatch.setattr(module, "entry_points", lambda group: (entry,))
    (metric,) = own_metrics(["cosy"])
    assert metric.name == "comfort" and module.is_offered("cosy") and not module.is_offered("my_metrics:comfort")
    with pytest.raises(ValueError, match="or one of cosy"):
        own_metrics(["other"])
    np.testing.assert_array_equal(metric.limits, (-np.inf, np.inf))
