"""Studies of conditions: rank correlations by hand, and both commands on the smallest crowd."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kendalltau

from socialnav_mj.cli import main
from socialnav_mj.config import Scenario
from socialnav_mj.recordings import load_recording
from socialnav_mj.report import style
from socialnav_mj.studies.conditions import ConditionStudy
from socialnav_mj.studies.kendall import kendall, tau_b
from socialnav_mj.studies.plant.study import PLANT
from socialnav_mj.studies.ranking import TURNED
from socialnav_mj.studies.reaction.people_as_robots import people_as_robots
from socialnav_mj.studies.reaction.study import REACTION

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 40)


def test_tau_of_clear_rankings_is_that_of_the_means_and_of_noise_wide():
    random = np.random.default_rng(0)
    clear = np.array([0.1, 0.3, 0.5, 0.9]) + random.normal(0.0, 0.001, (10, 4))
    same = kendall(clear, clear + random.normal(0.2, 0.001, (10, 4)))
    assert (same.mean, same.low, same.high, same.told_apart, same.turned_over) == (1.0, 1.0, 1.0, 6, ())
    reverse = kendall(clear, -clear)
    assert (reverse.mean, reverse.low, reverse.high, reverse.told_apart) == (-1, -1, -1, 6)
    assert {*reverse.turned_over} == {(1, 0), (2, 0), (3, 0), (2, 1), (3, 1), (3, 2)}
    # 3 of 6 pairs change over if the last becomes the first: tau = (3 - 3) / 6.
    moved = kendall(clear, clear[:, [3, 0, 1, 2]])
    assert moved.mean == moved.low == moved.high == pytest.approx(0.0)
    assert {*moved.turned_over} == {
        (1, 0),
        (2, 0),
        (3, 0),
    }
    noise = kendall(random.normal(size=(10, 4)), random.normal(size=(10, 4)))
    assert noise.high - noise.low > 0.5
    few = kendall(clear[:2], clear[:2])
    assert few.mean == 1.0 and np.isnan(few.low)


def test_a_pair_that_draws_do_not_tell_apart_can_have_any_order():
    random = np.random.default_rng(2)
    clear = np.array([0.1, 0.5, 0.9, 0.9]) + random.normal(0.0, 0.001, (10, 4))
    clear[:, 3] = clear[:, 2] + np.tile([-0.01, 0.01], 5)
    tau = kendall(clear, clear)
    assert (tau.told_apart, tau.low, tau.high) == (5, pytest.approx(2 / 3), 1.0)


@pytest.mark.parametrize("n_draws", [3, 5, 10])
@pytest.mark.parametrize("moved", [0.0, 0.05])
def test_interval_of_tau_holds_that_of_the_rankings_behind_the_draws(n_draws, moved):
    """Nineteen controllers, half of them close together, as on the leaderboard; .95 is asked for."""
    covered = 0
    for k in range(200):
        random = np.random.default_rng(k)
        one = np.concatenate([random.uniform(0.4, 0.9, 9), random.uniform(0.95, 0.99, 10)])
        two = one + random.normal(0.0, moved, 19)
        varied = np.where(one < 0.94, 0.05, 0.01)
        own, common = random.normal(size=(2, n_draws, 19)), random.normal(size=(n_draws, 19))
        studies = [mean + varied * (0.7 * common + 0.7 * noise) for mean, noise in zip((one, two), own, strict=True)]
        tau = kendall(*studies)
        covered += bool(tau.low - 1e-9 <= tau_b(one, two) <= tau.high + 1e-9)
    assert covered / 200 >= 0.95


def test_kendalls_tau_is_scipys_also_with_ties():
    random = np.random.default_rng(1)
    one, two = random.integers(0, 4, size=(2, 200, 6)).astype(float)
    two[0] = 1.0
    expected = [kendalltau(a, b).statistic for a, b in zip(one, two, strict=True)]
    assert np.isnan(expected[0])
    np.testing.assert_allclose(tau_b(one, two), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recordings": ()}, r"recordings = \(\) is not allowed"),
        ({"controllers": ("orca",)}, "two or more, each once"),
        ({"draws": 3, "other_draws": 4}, "other_draws = 4 is not allowed; allowed: 1 to draws = 3"),
    ],
)
def test_impossible_studies_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        ConditionStudy(**{"recordings": (TINY,), "conditions": REACTION.conditions, **changes})


def test_recordings_behind_the_first_can_have_fewer_draws():
    study = ConditionStudy(recordings=("students003", "zara01"), conditions=REACTION.conditions, draws=5, other_draws=3)
    assert [(run.name, run.evaluation.draws) for run in study.runs() if "weak" in run.name] == [
        ("students003_weak", 5),
        ("zara01_weak", 3),
    ]


@pytest.mark.parametrize("conditions", [REACTION.conditions, PLANT.conditions])
def test_first_condition_is_the_default_setting_and_all_others_are_allowed(conditions):
    scenarios = [Scenario().changed(**condition.task_kwargs) for condition in conditions]
    assert scenarios[0] == Scenario() and len({str(s.as_dict()) for s in scenarios}) == len(conditions)


@pytest.mark.parametrize(("name", "conditions"), [("reaction", REACTION.conditions), ("plant", PLANT.conditions)])
def test_command_runs_resumes_and_publishes_no_episode(name, conditions, tmp_path, capsys):
    out, public = tmp_path / "out", tmp_path / "results"
    command = [name, "--recordings", TINY, "--scenarios", "1", "4", "--draws", "3", "--jobs", "1"]
    command += ["--controllers", "go_straight", "--also", "social_force"]
    main([*command, "--out", str(out), "--publish", str(public)])
    assert "report:" in capsys.readouterr().out
    assert sorted(path.name for path in public.iterdir()) == ["README.md", "figures", "provenance.json", "tables"]
    rows = list(csv.DictReader((public / "tables" / "levels.csv").open()))
    assert {row["condition"] for row in rows} == {condition.name for condition in conditions}
    assert {row["controller"] for row in rows} == {"go_straight", "social_force"}
    changes = list(csv.DictReader((public / "tables" / "differences.csv").open()))
    # A difference of paired means is the difference of the means where every agent has both values.
    mean = {(r["scenario"], r["controller"], r["condition"], r["measure"]): float(r["mean"] or "nan") for r in rows}
    for row in changes:
        if row["measure"] == "success":
            first, other = (
                mean[row["scenario"], row["controller"], condition, "success"]
                for condition in (conditions[0].name, row["condition"])
            )
            assert float(row["difference"]) == pytest.approx(other - first, abs=1e-5)
    page = (public / "README.md").read_text()
    for text in ("scenario 4: 90 % agents", "## Does the ranking hold?", "Kendall's tau", "| social_force | "):
        assert text in page
    assert (public / "tables" / "turned_over.csv").read_text().split("\n")[0] == ",".join(TURNED)
    shown = re.findall(r"!\[.*\]\((.*)\)", page)
    assert len(shown) >= 3 and {public / name for name in shown} == {*public.glob("figures/*.png")}
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")}
    assert len(before) == 2 * 3 * 3 * len(conditions)
    main([*command, "--out", str(out)])
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")} == before


def test_ideal_plant_tracks_and_real_ones_do_not_in_the_studys_table(tmp_path):
    out = tmp_path / "out"
    command = ["plant", "--recordings", TINY, "--scenarios", "1", "--draws", "1", "--jobs", "1", "--out", str(out)]
    main([*command, "--controllers", "go_straight", "social_force"])
    rows = csv.DictReader((out / "tables" / "levels.csv").open())
    error = {r["condition"]: float(r["mean"]) for r in rows if r["measure"] == "tracking_error"}
    assert error["unicycle"] < 1e-9 < error["wheels"] < error["heavy"]


def test_people_as_robots_move_nobody_at_strength_0_and_somebody_at_a_great_one():
    recording = load_recording(TINY)
    still, moved = people_as_robots(recording, 0.0)
    assert (still.mean_displacement, still.ks_speed, still.ks_nearest) == (0.0, 0.0, 0.0)
    assert still.touches == still.touches_recorded and not moved.any()
    strong = [people_as_robots(recording, 50.0, late=late)[0] for late in (0.0, 1.0)]
    assert all(outcome.tracks == still.tracks for outcome in strong)


def test_people_as_robots_command_writes_a_table_and_a_figure(tmp_path, capsys):
    out = tmp_path / "test"
    main(["people-as-robots", "--recordings", TINY, "--late", "1.0", "--out", str(out)])
    assert "k = 1.5 (yielding), on time" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "tables" / "people_as_robots.csv").open()))
    assert len(rows) == 2 * 2 and (out / "figures" / "displacement.png").is_file()
    with pytest.raises(SystemExit):
        main(["people-as-robots", "--recordings", TINY, "--late", "0.0", "--out", str(out)])
