"""The gain sweep on the smallest crowd: planned, run, written."""

import csv
from pathlib import Path

import numpy as np
import pytest
from toy_policies import write_toy

from socialnav_mj.cli import main
from socialnav_mj.controllers import make_controller
from socialnav_mj.report import style
from socialnav_mj.studies.gains.ranges import OF_THE_FIELD, sweep_of
from socialnav_mj.studies.gains.study import FORMS, RANGES, GainSweep
from socialnav_mj.studies.panel import CAPPED, POTENTIAL_FIELD
from socialnav_mj.studies.study import read_runs, reproduce

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 40)


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    return write_toy(tmp_path_factory.mktemp("policies"), "p", seed=0)


def study_of(policy, **changes) -> GainSweep:
    kwargs = {"settings": 3, "draws": 1, "scenarios": ("scenario_4",), **changes}
    return GainSweep(recordings=(TINY,), policies=(policy,), **kwargs)


def test_gains_fill_their_ranges_evenly_and_are_the_same_every_time(policy):
    """In each of 40 equal parts of the logarithm of a range lies one value; rounding may move it over an edge."""
    study = study_of(policy, settings=40)
    assert study.gains == study_of(policy, settings=40).gains
    for name, (low, high) in RANGES.items():
        part = np.log([gains[name] / low for gains in study.gains]) / np.log(high / low) * 40
        np.testing.assert_allclose(np.sort(part), np.arange(40) + 0.5, atol=0.65)
    defaults = make_controller(POTENTIAL_FIELD)
    for name, (low, high) in RANGES.items():
        assert np.sqrt(low * high) == pytest.approx(getattr(defaults, name))


def test_both_forms_have_the_same_gains_and_differ_in_the_cap(policy):
    (run,) = study_of(policy).runs()
    fields = [[make_controller(name) for name in study_of(policy).fields(form)] for form in FORMS]
    for printed, capped in zip(*fields, strict=True):
        assert [getattr(printed, name) for name in RANGES] == [getattr(capped, name) for name in RANGES]
        assert (printed.attraction_limit, capped.attraction_limit) == (None, 1.0)
    names = list(run.evaluation.controllers)
    assert len(names) == len(set(names)) == 2 * 4 + 1 + 2
    assert {POTENTIAL_FIELD, CAPPED} < set(names)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"settings": 0}, "settings = 0 is not allowed; allowed: integers >= 1"),
        ({"copies": 0}, r"policies = \(\) is not allowed"),
        ({"copies": 2}, r"training seeds \[0, 0\]; allowed: one of each"),
    ],
)
def test_impossible_sweeps_are_refused(policy, changes, message):
    copies = changes.pop("copies", 1)
    with pytest.raises(ValueError, match=message):
        GainSweep(recordings=(TINY,), policies=(policy,) * copies, **changes)


def test_sweep_tells_each_setting_its_own_values_and_which_claims_it_supports(policy, tmp_path):
    study = study_of(policy, scenarios=("scenario_1", "scenario_2", "scenario_3", "scenario_4"))
    list(reproduce(study, tmp_path, n_jobs=1))
    (results,) = read_runs(study, tmp_path, n_jobs=1).values()
    rosters = {field: study.roster(CAPPED, field) for field in study.fields(CAPPED)}
    sweep = sweep_of(results.agents, recording="tiny", form=CAPPED, rosters=rosters)
    agents = results.agents.to_pylist()
    for k, field in enumerate(sweep.fields):
        own = [a for a in agents if a["controller"] == field and a["scenario"] == "scenario_4"]
        assert sweep.values("scenario_4", "success")[k] == pytest.approx(np.mean([a["success"] for a in own]))
    assert set(sweep.points) == {claim.key for claim in OF_THE_FIELD} and "a" in sweep.points
    assert all(len(each) in (0, 4) for each in sweep.points.values())
    faster = [
        all(
            sweep.values(scenario, "average_speed")[k] > sweep.learned(scenario, method, "average_speed")
            for scenario in sweep.scenarios
            for method in ("replay_irl", "mixed")
        )
        for k in range(4)
    ]
    assert list(sweep.points["b1"]) == faster


def test_command_runs_and_publishes_no_episode(policy, tmp_path, capsys):
    out, public = tmp_path / "out", tmp_path / "results"
    command = ["gains", "--recordings", TINY, "--policies", policy, "--settings", "2", "--scenarios", "1", "4"]
    main([*command, "--draws", "1", "--jobs", "1", "--out", str(out), "--publish", str(public)])
    assert "report:" in capsys.readouterr().out
    assert sorted(path.name for path in public.iterdir()) == ["README.md", "figures", "provenance.json", "tables"]
    assert 'src="data:image/svg+xml' in (out / "report.html").read_text()
    rows = list(csv.DictReader((public / "tables" / "gains.csv").open()))
    assert len(rows) == 2 * 3 * 2 and {row["form"] for row in rows} == set(FORMS)
    page = (public / "README.md").read_text()
    for text in ("capped field", "## Claims about the potential field", "scenario 4: 90 % agents", "of 3 ("):
        assert text in page
