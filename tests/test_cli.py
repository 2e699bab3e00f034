"""The command as a user types it: what goes to which stream, exit codes, and what an interruption leaves."""

import functools
import hashlib
import importlib
import json
import logging
import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import version
from pathlib import Path

import pytest

from socialnav_mj import benchmark, growth
from socialnav_mj.cli import main
from socialnav_mj.config import SETTINGS
from socialnav_mj.episode import read_header
from socialnav_mj.recordings import catalogue as catalogue_module

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
QUICK = ("evaluate", "--dataset", TINY, "--scenarios", "1", "--draws", "1", "--jobs", "1")
COMMAND = (sys.executable, "-c", "from socialnav_mj.cli import main; main()")
SLOW = """
import time
from socialnav_mj.config import SETTINGS
from socialnav_mj.controllers import GoStraight

class Slow(GoStraight):
    def __init__(self):
        super().__init__(name="slow")

    def act(self, observation):
        time.sleep(0.5)
        return super().act(observation)
"""


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(sys, "argv", ["socialnav-mj", "as it was typed"])
    monkeypatch.setenv("COLUMNS", "80")


def fails(capsys, *args):
    """Runs a command that has to fail; its errors, on one line."""
    with pytest.raises(SystemExit) as caught:
        main([*args])
    output, errors = capsys.readouterr()
    assert caught.value.code == 2 and output == "" and "Traceback" not in errors
    return re.sub(r"[\s│]+", " ", errors)


# evaluate and report


def test_command_of_the_issue_is_accepted(capsys, monkeypatch):
    import socialnav_mj.evaluation as module

    asked = []

    def note(evaluation, out, *, command, n_jobs, on_change):
        asked.append((evaluation, str(out), n_jobs))
        raise ValueError("that will do")

    monkeypatch.setattr(module, "evaluate", note)
    typed = "evaluate --dataset plaza --scenarios 1 2 3 4 --controllers potential_field go_straight --draws 3 --seed 0"
    assert "that will do" in fails(capsys, *typed.split(), "--jobs", "2", "--out", "runs/first")
    assert "that will do" in fails(capsys, "evaluate")
    (evaluation, out, jobs), (default, default_out, default_jobs) = asked
    assert (out, jobs, default_out, default_jobs) == ("runs/first", 2, "runs/plaza", -1)
    assert evaluation == default
    assert evaluation.scenarios == ("scenario_1", "scenario_2", "scenario_3", "scenario_4")
    assert evaluation.controllers == ("potential_field", "go_straight") and (evaluation.draws, evaluation.seed) == (
        3,
        0,
    )


def test_evaluate_prints_tables_and_writes_everything_and_report_does_it_again(capsys):
    main([*QUICK])
    output, errors = capsys.readouterr()
    assert "episodes 3/3\n" in errors
    assert "episodes" not in output
    assert max(map(len, output.splitlines())) <= 80
    for name in ("tiny (text), scenario_1", "potential_field", "go_straight", "human", "success", "path"):
        assert name in output
    assert "report: runs/tiny/report.html (report.md beside it)\ntraces: socialnav-mj view runs/tiny" in output
    folder = Path("runs/tiny")
    assert {path.name for path in folder.iterdir()} >= {
        *("agents.parquet", "summary.csv", "summary.json", "report.md", "run.json", "episodes", "traces")
    }
    assert json.loads((folder / "run.json").read_text()) == {
        "command": "socialnav-mj 'as it was typed'",
        "controllers": ["potential_field", "go_straight", "human"],
        "episodes": sorted(path.name for path in (folder / "episodes").glob("*.npz")),
    }
    written = (folder / "report.md").read_bytes()
    main(["report", "runs/tiny", "--jobs", "1"])
    assert capsys.readouterr().out == output and (folder / "report.md").read_bytes() == written
    main(["report", "runs/tiny", "--jobs", "1", "--dialect", "paper", "crowdnav"])
    assert {path.name for path in (folder / "tables").glob("dialect_*")} == {
        "dialect_paper.csv",
        "dialect_crowdnav.csv",
    }


def test_recording_is_read_as_the_command_says_and_verified_so(tmp_path, capsys):
    """A table in centimetres at 12.5 Hz, in another order of columns, with a gap of 320 s."""
    rows = [line.split() for line in Path(TINY).read_text().splitlines() if not line.startswith("#")]
    lines = [f"{100 * float(x)},{i},{int(f) // 2},{100 * float(y)}" for f, i, x, y in rows]
    path = tmp_path / "mine.csv"
    path.write_text("\n".join([*lines, "0,9,0,0", "0,9,4000,0"]))
    read = ["--frame-rate", "12.5", "--units", "cm", "--columns", "x", "id", "frame", "y"]
    assert "person 9 is not seen for 320 s" in fails(capsys, *QUICK, "--dataset", str(path), *read)
    main([*QUICK, "--dataset", str(path), *read, "--max-gap", "400", "--controllers", "go_straight", "--out", "o"])
    assert "recording mine, variant text: 4 people, 320.0 s, frame rate 12.5 Hz (given)" in capsys.readouterr().err
    metadata = read_header(next(Path("o/episodes").glob("*.npz")))["metadata"]["recording"]
    assert metadata["frame_rate"] == 12.5
    assert metadata["reading"] == {"columns": ["x", "id", "frame", "y"], "units": "cm"}
    main(["verify", "o", "--dataset", str(path), "--max-gap", "400", "--jobs", "1"])
    assert "12 of 12 files say what their re-simulation says" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["verify", "o", "--dataset", str(path), "--jobs", "1"])
    assert "--max-gap lifts it" in capsys.readouterr().out


def test_evaluate_warns_once_of_a_frame_rate_that_makes_people_run(capfd, caplog):
    main([*QUICK, "--frame-rate", "100", "--out", "o", "--jobs", "2"])
    (warning,) = [record.getMessage() for record in caplog.records if "people walk at" in record.getMessage()]
    assert "probably the frame rate of 100 Hz (given) is wrong" in warning
    assert "people walk at" not in capfd.readouterr().err  # of the processes that run the episodes
    assert logging.lastResort.format(logging.makeLogRecord({"levelname": "WARNING", "msg": "x"})) == "WARNING: x"


def test_settings_of_the_command_reach_the_episodes():
    options = ["--robot-radius", "0.18", "--pedestrian-radius", "0.2", "--turn-limit", "per_second"]
    options += ["--on-collision", "retire", "--control-timestep", "0.1", "--seed", "4", "--out", "o"]
    options += ["--goal-radius", "0.3", "--robot-max-speed", "0.8"]
    main([*QUICK, *options, "--controllers", "potential_field(attraction_limit=None)"])
    name = "scenario_1.potential_field-attraction_limit=None-.draw_004.npz"
    metadata = read_header(Path("o/episodes") / name)["metadata"]
    scenario = metadata["scenario"]
    assert (scenario["robot"]["radius"], scenario["pedestrian_radius"], scenario["turn_limit"]) == (
        0.18,
        0.2,
        "per_second",
    )
    assert (scenario["on_collision"], scenario["control_timestep"], scenario["seed"]) == ("retire", 0.1, 4)
    assert (scenario["goal_radius"], scenario["robot"]["max_speed"]) == (0.3, 0.8)
    assert metadata["controller_config"]["attraction_limit"] is None


def test_everything_that_can_be_set_is_an_option_that_says_what_it_is(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        main(["evaluate", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    for name in set(SETTINGS) - {"share"}:
        assert f"--{name.replace('_', '-')} " in text
    assert "An agent has arrived when its centre is this near its goal [m]" in text
    assert "Distance between the wheels' contact points [m]" in text


def test_failing_controller_is_told_once_and_the_others_are_kept(capsys):
    Path("mine.py").write_text(
        "class Failing:\n    name = 'failing'\n    def reset(self, limits, *, seed=0): self.steps = 0\n"
        "    def act(self, observation):\n        self.steps += 1\n"
        "        return observation['nothing' if self.steps > 9 else 'goal'] * 0.0\n"
    )
    errors = fails(capsys, *QUICK, "--out", "o", "--controllers", "go_straight", "mine:Failing")
    assert errors.count("KeyError: 'nothing'") == 1 and "mine.py:6" in errors
    assert "1 of 3 episodes failed, the others are kept; the same command runs the failed ones again" in errors
    assert len(list(Path("o/episodes").iterdir())) == 2


@pytest.mark.parametrize(
    ("args", "named"),
    [
        (["evaluate", "--dataset", "nowhere"], "error: no recording 'nowhere': it is neither in the catalogue"),
        ([*QUICK, "--controllers", "nobody"], "unknown controller 'nobody'; available: potential_field"),
        ([*QUICK, "--controllers", "no.such:Thing"], "cannot be imported from 'no.such:Thing': No module named 'no'"),
        ([*QUICK, "--controllers"], "controllers = () is not allowed"),
        ([*QUICK, "--scenarios", "5"], "invalid choice '5' for argument '--scenarios'"),
        ([*QUICK, "--draws", "0"], "draws = 0 is not allowed; allowed: integers >= 1"),
        ([*QUICK, "--draws", "many"], "invalid"),
        ([*QUICK, "--jobs", "0"], "n_jobs = 0 is not allowed"),
        ([*QUICK, "--variant", "vsp"], "tiny.txt needs its homography (pixels to metres), a file H.txt beside it"),
        ([*QUICK, "--robot-radius", "-1"], "Robot.radius = -1.0 is not allowed; allowed: numbers in [0.1, 0.4]"),
        ([*QUICK, "--robot-radius", "2"], "Robot.radius = 2.0 is not allowed; allowed: numbers in [0.1, 0.4]"),
        ([*QUICK, "--pedestrian-radius", ".01"], "pedestrian_radius = 0.01 is not allowed; allowed: numbers in [0.05"),
        ([*QUICK, "--control-timestep", "100"], "control_timestep = 100.0 is not allowed; allowed: at most 1 s,"),
        ([*QUICK, "--control-timestep", "0.013"], "control_timestep = 0.013 is not allowed"),
        ([*QUICK, "--turn-limit", "none"], "invalid choice 'none' for argument '--turn-limit'"),
        ([*QUICK, "--out", TINY], f"output folder {TINY!r} is not allowed: {TINY} is a file; allowed: a folder"),
        ([*QUICK, "--out", f"{TINY}/x"], f"{TINY} is a file"),
        (["train", "replay-irl", "--out", TINY], f"{TINY} is a file"),
        (["train", "replay-irl", "--scene-steps", "0"], "scene_steps = 0 is not allowed"),
        ([*QUICK, "--again", "--keep"], "--again and --keep are both given"),
        (["report", "nowhere"], "error: no episodes in nowhere/episodes; expected *.npz files"),
        (["data", "info", "nowhere"], "no recording 'nowhere'"),
        (["data", "fetch", "nowhere"], "unknown recording 'nowhere'; available: "),
        (["bench", "--dataset", "nowhere"], "no recording 'nowhere'"),
        (["bench", "--dataset", TINY, "--controller", "nobody"], "unknown controller 'nobody'"),
        (["dance"], "Unrecognized options: dance"),
        ([], "Expected one of {evaluate, report, "),
    ],
)
def test_bad_input_is_one_clear_message(capsys, args, named):
    assert named in fails(capsys, *args)
    assert not Path("runs").exists()


def test_path_in_a_message_is_not_broken_by_the_terminals_width(tmp_path, capsys):
    folder = tmp_path / ("long_" * 30)
    with pytest.raises(SystemExit):
        main(["report", str(folder)])
    assert f"{folder}/episodes" in capsys.readouterr().err


def alive(group):
    """Processes of a group that still run; a test's init may leave the dead ones unburied."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # gone meanwhile
            state, _, pgrp = path.read_text().rpartition(")")[2].split()[:3]
            if int(pgrp) == group and state not in "ZX":
                found.append(int(path.parent.name))
    return found


def interrupted(folder, jobs, number=signal.SIGINT, *, all_of_them=True):
    """Start a run whose second controller is slow, and send it a signal when the first is done.

    Args:
        folder: Of the run.
        jobs: Processes.
        number: The signal; SIGINT is Ctrl-C.
        all_of_them: Send it to the workers as well, as a terminal does.

    Returns:
        Exit code and errors, when no process of the run is left.
    """
    Path("slow.py").write_text(SLOW)
    args = ("evaluate", "--dataset", TINY, "--scenarios", "1", "--draws", "2", "--out", folder, "--jobs", jobs)
    process = subprocess.Popen(
        [*COMMAND, *args, "--controllers", "go_straight", "slow:Slow"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell that runs the tests in the background makes them, and all they start, deaf to Ctrl-C.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    episodes = Path(folder) / "episodes"
    deadline = time.monotonic() + 300.0
    while len(list(episodes.glob("[!.]*.npz"))) < 2 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    (os.killpg if all_of_them else os.kill)(process.pid, number)
    output, errors = process.communicate(timeout=300)
    # A slow episode takes 15 s, and each worker has one of its own.
    deadline = time.monotonic() + 5.0
    while alive(process.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    left = alive(process.pid)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert output == "" and not left
    return process.returncode, errors


@pytest.mark.parametrize(
    ("jobs", "number", "all_of_them"),
    [
        ("1", signal.SIGINT, True),
        pytest.param("2", signal.SIGINT, True, marks=pytest.mark.slow),
        pytest.param("1", signal.SIGTERM, False, marks=pytest.mark.slow),
        ("2", signal.SIGTERM, False),
        pytest.param("2", signal.SIGTERM, True, marks=pytest.mark.slow),
        ("2", signal.SIGHUP, True),
    ],
)
def test_signal_leaves_finished_episodes_and_no_process_and_the_next_run_goes_on(jobs, number, all_of_them, capsys):
    code, errors = interrupted("o", jobs, number, all_of_them=all_of_them)
    assert code == 128 + number, errors
    assert "interrupted; repeat the command to resume" in errors and "Traceback" not in errors
    kept = {path.name: path.stat().st_mtime_ns for path in Path("o/episodes").iterdir()}
    assert set(kept) == {"scenario_1.go_straight.draw_000.npz", "scenario_1.go_straight.draw_001.npz"}
    main([*QUICK, "--draws", "2", "--out", "o", "--controllers", "go_straight"])
    after = {path.name: path.stat().st_mtime_ns for path in Path("o/episodes").glob("[!.]*.npz")}
    assert len(after) == 4 and {name: after[name] for name in kept} == kept
    assert "4/4" in capsys.readouterr().err


def test_killed_command_leaves_no_process_and_no_file_changes_any_more():
    code, _ = interrupted("o", "2", signal.SIGKILL, all_of_them=False)
    assert code == -signal.SIGKILL
    left = {path.name: path.stat().st_mtime_ns for path in Path("o/episodes").iterdir()}
    time.sleep(1.0)
    assert {path.name: path.stat().st_mtime_ns for path in Path("o/episodes").iterdir()} == left


def test_json_gives_one_object_and_quiet_only_errors(capsys):
    main(["list", "--json"])
    out = json.loads(capsys.readouterr().out)
    controllers = next(table for table in out["tables"] if table["title"] == "controllers")
    assert {"controller": "go_straight", "settings and their defaults": "none"} in controllers["rows"]
    main([*QUICK, "--controllers", "go_straight", "--out", "o", "--json", "--quiet"])
    shown = capsys.readouterr()
    assert shown.err == ""
    found = json.loads(shown.out)
    names = {(e["controller"], e["measure"]) for e in found["estimates"]}
    (row, *_) = found["tables"][0]["rows"]
    assert isinstance(row["touched a person"], float) and not any("\n" in heading for heading in row)
    assert ("go_straight", "success") in names and found["lines"][0].startswith("report: o/report.html")
    main(["verify", "o", "--dataset", TINY, "--jobs", "1", "--json", "--quiet"])
    assert all(file["same"] for file in json.loads(capsys.readouterr().out)["files"])
    main(["list"])
    assert capsys.readouterr().out.startswith("tasks")
    assert "no episodes in" in fails(capsys, "report", "nowhere", "--quiet")


def test_output_that_is_no_terminal_has_no_colours(capsys):
    main(["list"])
    main(["check", "go_straight"])
    main([*QUICK, "--controllers", "go_straight", "--out", "o"])
    shown = capsys.readouterr()
    assert "\x1b" not in shown.out + shown.err + fails(capsys, "report", "nowhere")
    # A bar is for terminals; others get lines.
    assert "episodes 2/2\ntables and traces\n" in shown.err


SPIN = """
class Spin:
    name = "spin"

    def __init__(self, margin=0.5):
        self.margin = margin

    def reset(self, limits, *, seed=0):
        self.limits = limits

    def act(self, observation):
        return observation["goal"] * self.margin
"""


def run_spin(*options, source=SPIN, spec="mine:Spin"):
    """As the next process runs it: the module is read anew."""
    Path("mine.py").write_text(source)
    sys.modules.pop("mine", None)
    importlib.invalidate_caches()
    main([*QUICK, "--out", "o", "--controllers", spec, *options])


def spun():
    """Name: SHA-256 of the states of each episode."""
    headers = [read_header(path)["metadata"] for path in sorted(Path("o/episodes").glob("*.npz"))]
    return {metadata["controller"]: metadata["state_hash"] for metadata in headers}


def test_edited_controller_is_told_before_anything_runs_and_run_anew_or_kept(capsys):
    edited = SPIN.replace("* self.margin", "* 2.0 * self.margin")
    run_spin()
    before, report = spun(), Path("o/report.md").read_bytes()
    for change in ({"source": edited}, {"source": SPIN.replace("margin=0.5", "margin=0.25")}):
        with pytest.raises(SystemExit) as end:
            run_spin(**change)
        told = capsys.readouterr().err
        assert end.value.code == 2 and "spin has changed since these episodes were run" in told
        assert "--again runs them anew, --keep keeps both" in told and "in mine.py = " in told
    assert "margin = 0.5, but 0.25" in told
    assert (spun(), Path("o/report.md").read_bytes()) == (before, report)

    run_spin("--keep", source=edited)
    both = spun()
    (new,) = both.keys() - before.keys()
    assert re.fullmatch("spin@[0-9a-f]{6}", new) and both["spin"] == before["spin"] != both[new]
    text = Path("o/report.md").read_text()
    assert "differs from" in text and "in mine.py = " in text and new in text
    run_spin("--keep", source=edited)
    assert spun() == both
    with pytest.raises(SystemExit):
        main(["verify", "o", "--dataset", TINY, "--trust", "mine:Spin", "--jobs", "1"])
    told = capsys.readouterr().out
    assert "12 of 14 files say" in told and "DIFFERS: controller_config.sources.mine:Spin in mine.py = " in told

    (kept,) = Path("o/episodes").glob("*spin-*.npz")
    kept.unlink()
    run_spin("--again", source=edited)
    assert spun() == {"spin": both[new], "human": before["human"]}
    (aside,) = Path("o/superseded").rglob("*.npz")
    assert read_header(aside)["metadata"]["state_hash"] == before["spin"]
    run_spin(source=edited)


def test_controller_renamed_in_its_source_is_not_taken_for_the_old_one(capsys):
    run_spin()
    with pytest.raises(SystemExit):
        run_spin(source=SPIN.replace('name = "spin"', 'name = "other"'))
    assert "other has changed" in capsys.readouterr().err


def test_slip_in_a_controller_is_found_before_anything_runs(capsys):
    with pytest.raises(SystemExit):
        run_spin(source=SPIN.replace("observation", "obsrvation", 1).replace("self.limits = limits", "pass"))
    told = capsys.readouterr().err
    assert "controller 'spin', tried before anything is run, fails in the empty scene: NameError" in told
    assert "mine.py:12" in told and not Path("o").exists()


def test_settings_of_one_class_stand_in_one_table_under_their_names():
    Path("mine.py").write_text(SPIN)
    sys.modules.pop("mine", None)
    main([*QUICK, "--out", "o", "--controllers", "mine:Spin", "mine:Spin(margin=1)", "fast=mine:Spin(margin=2)"])
    assert set(spun()) == {"spin", "mine:Spin(margin=1)", "fast", "human"}


def test_version_is_that_of_the_package(capsys):
    main(["--version"])
    assert capsys.readouterr().out == f"socialnav-mj {version('socialnav-mj')}\n"


# train


def test_trainings_of_several_seeds_have_folders_of_their_own(capsys, monkeypatch):
    from socialnav_mj.learning import training

    seen = []

    def train(config, folder, *, data_dir):
        seen.append((config.seed, str(folder), data_dir))
        return Path(folder) / "best.safetensors"

    monkeypatch.setattr(training, "train", train)
    main(["train", "replay-irl", "--seeds", "3", "4", "--jobs", "1", "--out", "t", "--data-dir", "d"])
    main(["train", "replay-irl", "--seeds", "5", "--jobs", "1"])
    assert seen == [(3, "t/seed3", "d"), (4, "t/seed4", "d"), (5, "runs/train/plaza_continuous_seed5", None)]
    assert "replay_irl(policy='t/seed4/best.safetensors')" in capsys.readouterr().out
    assert "seeds = (3, 3) is not allowed; allowed: each once" in fails(
        capsys, "train", "replay-irl", "--seeds", "3", "3"
    )


# list, data, bench


def test_list_shows_tasks_controllers_and_recordings(capsys):
    main(["list"])
    output = capsys.readouterr().out
    for name in ("scenario_1", "10%", "scenario_4", "90%", "potential_field", "go_straight", "package.module:Class"):
        assert name in output
    assert "switch_distance=2.0" in output and "preset='social'" in output and "attraction_limit=None" in output
    assert "plaza" in output and "students003" in output and max(map(len, output.splitlines())) <= 80


def test_data_list_shows_where_recordings_come_from_and_whole_checksums(capsys, tmp_path):
    main(["data", "list", "--data-dir", str(tmp_path)])
    output = capsys.readouterr().out
    joined = re.sub(r"[\s│]+", "", output)
    for row in catalogue_module.catalogue().values():
        assert row.name in output and f"{row.frame_rate:g} Hz" in output
        for files in row.variants.values():
            told = {"unknown": "notverified:nosha256isknown"}
            assert all(told.get(checksum, checksum) in joined for checksum in files.values())
    assert "CC0-1.0" in output and "OpenTraj" in output


def test_data_info_shows_the_facts_of_any_recording(capsys):
    main(["data", "info", TINY])
    output = capsys.readouterr().out
    assert re.search(r"people\s+3\b", output)
    assert "0.25/0.32/0.4 m" in output
    assert "recording tiny, variant text: 3 people, 7.6 s, frame rate 25 Hz (assumed); --frame-rate sets" in output
    assert f"checksum {hashlib.sha256(Path(TINY).read_bytes()).hexdigest()}" in output


def test_simulated_crowd_is_called_so_wherever_it_is_named(capsys):
    main(["data", "info", "plaza", "--until", "4"])
    assert "simulated crowd plaza, variant vsp: " in capsys.readouterr().out
    main([*QUICK[:2], "plaza", *QUICK[3:], "--until", "4", "--controllers", "go_straight", "--out", "o"])
    shown = capsys.readouterr()
    assert "plaza (vsp, simulated crowd), scenario_1" in " ".join(shown.out.split())
    report = Path("o/report.md").read_text()
    assert "## plaza (vsp, simulated crowd), scenario\\_1" in report or "simulated crowd), scenario_1" in report
    assert "**human**: the simulated people themselves" in report and "recorded people" not in report
    main(["verify", "o", "--jobs", "1"])
    assert read_header(next(Path("o/episodes").glob("*.npz")))["metadata"]["recording"]["reading"] == {"until": 4.0}


def test_data_fetch_downloads_into_the_folder_that_is_given(capsys, tmp_path, monkeypatch):
    (tmp_path / "served" / "there").mkdir(parents=True)
    content = Path(TINY).read_bytes()
    (tmp_path / "served" / "there" / "tiny.txt").write_bytes(content)

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *args):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=tmp_path / "served"))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    row = catalogue_module.CatalogueRow(
        name="little",
        title="t",
        source="s",
        licence="l",
        scale="m",
        axis_order="xy",
        frame_rate=25.0,
        folder="there",
        url=f"http://127.0.0.1:{server.server_port}/there/",
        variants={"text": {"tiny.txt": hashlib.sha256(content).hexdigest()}},
    )
    monkeypatch.setattr(catalogue_module, "catalogue", lambda: {"little": row})
    try:
        main(["data", "fetch", "little", "--data-dir", str(tmp_path / "data")])
    finally:
        server.shutdown()
        server.server_close()
    assert capsys.readouterr().out.split() == [str(tmp_path / "data" / "there" / "tiny.txt")]
    assert (tmp_path / "data" / "there" / "tiny.txt").read_bytes() == content


def test_bench_prints_and_writes_the_cost_beside_bare_steps(capsys):
    command = ["bench", "--dataset", TINY, "--scenarios", "4", "--repetitions", "2", "--pedestrians", "yielding"]
    main([*command, "--out", "bench.json"])
    output = capsys.readouterr().out
    assert "episode / mj_step" in output and "real-time factor" in output and "trace [MB]" in output
    content = json.loads(Path("bench.json").read_text())
    (cost,) = content["costs"]
    assert cost["scenario"] == "scenario_4" and cost["n_agents"] == 3
    assert cost["ratio_low"] <= cost["ratio"] <= cost["ratio_high"]
    assert "as built, with parked / mj_step" in output and cost["parked_ratio"] > 0.0
    assert "people's reaction / mj_step" in output and cost["reaction_ratio"] > 0.0
    assert content["settings"]["pedestrians"] == "yielding"
    assert cost["real_time_factor"] == pytest.approx(cost["simulated_time"] / cost["episode_cpu"])
    assert content["recording"]["name"] == "tiny" and "mujoco" in content["versions"]


def test_bench_of_growth_sets_larger_crowds_beside_the_smallest(capsys, monkeypatch):
    short = partial(growth.measure_growth, simulated_time=1.0)
    monkeypatch.setattr(growth, "measure_growth", short)
    main(["bench", "--growth", "9", "4", "--controller", "go_straight", "--out", "bench.json"])
    out = capsys.readouterr().out
    assert "agent-step" in out
    rows = json.loads(Path("bench.json").read_text())["growth"]
    assert [row["n_agents"] for row in rows] == [4, 9]
    assert [row["agent_steps"] for row in rows] == [4 * 5, 9 * 5]  # all under way for the whole second
    assert rows[0]["ratio"] == 1.0
    assert rows[1]["ratio"] == pytest.approx(rows[1]["cost"] / rows[0]["cost"])
    assert all(row["cost"] > row["physics_cost"] + row["act_cost"] > 0.0 for row in rows)


def test_bench_of_controllers_sets_each_beside_the_physics_that_it_drives(capsys, monkeypatch):
    few = partial(benchmark.measure_controllers, n_agents=4, n_pedestrians=3, control_steps=5)
    monkeypatch.setattr(benchmark, "measure_controllers", few)
    specs = ["go_straight", "mpc(preset='calm')"]
    main(["bench", "--controllers", *specs, "--repetitions", "2", "--out", "bench.json"])
    output = capsys.readouterr().out
    assert "controller / mj_step" in output and "go_straight" in output
    costs = json.loads(Path("bench.json").read_text())["controllers"]
    assert [cost["controller"] for cost in costs] == specs
    for cost in costs:
        assert cost["n_agents"] == 4 and 0.0 < cost["ratio_low"] <= cost["ratio"] <= cost["ratio_high"]


@pytest.mark.parametrize(
    ("args", "named"),
    [
        ([], ["evaluate", "report", "list", "data", "bench"]),
        (
            ["evaluate"],
            ["--dataset", "--scenarios {1,2,3,4} ...", "--controllers", "--draws", "--seed", "--jobs", "--out"],
        ),
        (["evaluate"], ["repeat the command to resume it", "rad/s", "(default: plaza)", "(default: 1 2 3 4)"]),
        (["report"], ["FOLDER", "--jobs"]),
        (["data"], ["list", "info", "fetch"]),
        (["data", "fetch"], ["NAME", "--data-dir"]),
        (["bench"], ["--repetitions", "--out FILE"]),
    ],
)
def test_help_names_the_options_and_fits_the_terminal(capsys, args, named):
    with pytest.raises(SystemExit) as caught:
        main([*args, "--help"])
    output = capsys.readouterr().out
    assert caught.value.code == 0
    for word in named:
        assert word in output
