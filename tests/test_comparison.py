"""Two files of `bench` side by side: ratios and their range by hand, an exit code, and clear refusals."""

import json
from pathlib import Path

import pytest

from socialnav_mj.cli import main
from socialnav_mj.comparison import Change, compare

CASE = {
    "scenario": "scenario_1",
    "episode_cpus": [1.0, 2.0, 1.5],
    "physics_cpus": [1.0, 1.0, 1.0],
    "n_robots": 7,
    "trace_megabytes": 0.5,
}
FILE = {
    "recording": {"name": "tiny"},
    "settings": {"controller": "go_straight", "seed": 0},
    "versions": {"mujoco": "3.17.0"},
    "costs": [CASE],
}
CONTROLLERS = {"settings": {}, "controllers": [{"controller": "mpc", "act_cpus": [2e-6], "physics_cpus": [1e-6]}]}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")


def write(name, content):
    Path(name).write_text(content if isinstance(content, str) else json.dumps(content))
    return Path(name)


def test_ratio_is_that_of_medians_and_its_range_that_of_the_extremes():
    change = Change(case="scenario_1", measure="episode CPU [s]", before=(1.0, 2.0, 1.5), after=(3.0, 6.0, 4.5))
    assert (change.ratio, change.ratio_low, change.ratio_high) == (3.0, 1.5, 6.0)
    assert change.verdict == "more" and change.exceeds(2.9) and not change.exceeds(3.0)
    back = Change(case="scenario_1", measure="episode CPU [s]", before=change.after, after=change.before)
    assert back.verdict == "less" and back.ratio == pytest.approx(1 / 3) and not back.exceeds(0.1)


def test_growth_within_what_repetitions_differ_by_is_no_growth():
    change = Change(case="scenario_1", measure="episode CPU [s]", before=(1.0, 2.0, 1.5), after=(1.9, 3.0, 6.0))
    assert change.ratio == 2.0 and change.verdict == "-" and not change.exceeds(1.0)


def test_every_figure_is_compared_and_other_versions_are_noted():
    slower = {**CASE, "episode_cpus": [3.0, 6.0, 4.5], "n_robots": 14}
    found = compare(
        write("a.json", FILE), write("b.json", {**FILE, "costs": [slower], "versions": {"mujoco": "3.18.0"}})
    )
    assert {change.measure: round(change.ratio, 3) for change in found.changes} == {
        "episode CPU [s]": 3.0,
        "bare mj_step CPU [s]": 1.0,
        "episode / mj_step": 3.0,
        "robots built": 2.0,
        "trace [MB]": 1.0,
    }
    assert found.notes == ("versions.mujoco = '3.17.0', but '3.18.0'",)


def test_command_prints_the_table_and_its_exit_code_is_asked_for(capsys):
    write("a.json", FILE)
    write("b.json", {**FILE, "costs": [{**CASE, "episode_cpus": [3.0, 6.0, 4.5]}]})
    main(["bench", "--compare", "a.json", "b.json"])
    output = capsys.readouterr().out
    assert "3.00 (1.50 to 6.00)" in output and "more" in output and "at most" not in output
    main(["bench", "--compare", "b.json", "a.json", "--at-most", "1.1"])
    assert "0.33 (0.17 to 0.67)" in capsys.readouterr().out
    with pytest.raises(SystemExit) as caught:
        main(["bench", "--compare", "a.json", "b.json", "--at-most", "1.1"])
    output = capsys.readouterr().out
    assert caught.value.code == 1
    assert "scenario_1: episode CPU [s] is 3.00 times what it was; at most 1.1" in output
    assert "scenario_1: episode / mj_step is 3.00" in output and "robots built is" not in output


def test_file_of_the_command_itself_is_read(capsys):
    tiny = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
    main(["bench", "--dataset", tiny, "--scenarios", "1", "--repetitions", "1", "--out", "own.json"])
    main(["bench", "--compare", "own.json", "own.json", "--at-most", "1"])
    assert "not only the code differs" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ("no json", "b.json is not a file of `socialnav-mj bench --out FILE`: JSONDecodeError"),
        ("[1, 2]", "it has no costs or controllers"),
        ({"command": "x"}, "it has no costs or controllers"),
        ({**FILE, "costs": [{"scenario": "scenario_1"}]}, "KeyError('episode_cpus')"),
        ({**FILE, "costs": [{**CASE, "episode_cpus": ["1.0"]}]}, "is not a file of"),
        ({**FILE, "costs": [{**CASE, "trace_megabytes": 0.0}]}, "figures of 'scenario_1' are not numbers > 0"),
        (CONTROLLERS, "a.json has costs and b.json has none"),
        ({**FILE, "recording": {"name": "plaza"}}, "do not measure the same: recording.name = 'tiny', but 'plaza'"),
        ({**FILE, "settings": {**FILE["settings"], "seed": 1}}, "settings.seed = 0, but 1"),
        (
            {**FILE, "costs": [CASE, {**CASE, "scenario": "scenario_4"}]},
            "a.json has scenario_1, but b.json has scenario_1, scenario_4; measure the same scenarios",
        ),
    ],
)
def test_file_that_cannot_be_compared_is_refused_with_the_reason(other, told):
    with pytest.raises(ValueError) as caught:
        compare(write("a.json", FILE), write("b.json", other))
    assert told in str(caught.value)


@pytest.mark.parametrize("words", [["--at-most", "1.1"], ["--compare", "a.json", "a.json", "--at-most", "0"]])
def test_bound_is_positive_and_needs_two_files(words, capsys):
    write("a.json", FILE)
    with pytest.raises(SystemExit) as caught:
        main(["bench", *words])
    assert caught.value.code == 2 and "allowed: numbers > 0, with --compare" in capsys.readouterr().err
