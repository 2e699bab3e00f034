"""Killed commands, repeated, leave what undisturbed ones leave; `make kill` runs as many rounds as one likes."""

import signal
import subprocess
import sys

import kill
import pytest
from kill import COMMANDS, SIGNALS, Blow, BrokenError, Forked, blows_of, contents, run_round, strike, undisturbed, wait

ALL = [*COMMANDS]


@pytest.mark.parametrize(("name", "seed"), [("evaluate", 2), ("fetch", 1)])
def test_killed_command_leaves_in_the_end_what_an_undisturbed_one_does(name, seed, tmp_path):
    chosen, sent = run_round(seed, tmp_path, name)
    assert chosen == name and signal.SIGKILL in {blow.number for blow in sent}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 12))
@pytest.mark.parametrize("name", ALL)
def test_every_command_survives_its_kills(name, seed, tmp_path):
    if name == "train":
        pytest.importorskip("stable_baselines3")
    run_round(seed, tmp_path, name)


def test_rounds_strike_every_command_with_every_signal_at_times_and_at_changes():
    rounds = [blows_of(seed) for seed in range(200)]
    blows = [blow for _, own in rounds for blow in own]
    assert {name for name, _ in rounds} == {*COMMANDS} and blows_of(7) == blows_of(7)
    assert {blow.number for blow in blows} == {*SIGNALS}
    assert {blow.to_all for blow in blows} == {blow.change is None for blow in blows} == {True, False}


def test_round_that_ends_otherwise_is_noticed(tmp_path, monkeypatch):
    expected, duration = undisturbed("fetch")
    altered = {**expected, "out/made/a.txt": "another hash"}
    monkeypatch.setattr(kill, "undisturbed", lambda name: (altered, duration))
    with pytest.raises(BrokenError, match=r"fetch leaves otherwise than undisturbed: out/made/a\.txt"):
        run_round(2, tmp_path, "fetch")


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import sys; sys.exit(3)", "exit code 3 after"),
        ("import signal, time; signal.signal(15, lambda *_: exit(4)); open('x', 'w'); time.sleep(60)", "exit code 4"),
        (
            "import subprocess, sys, time; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']); "
            "open('x', 'w'); time.sleep(60)",
            r"processes \[\d+\] outlive their command",
        ),
    ],
)
def test_command_that_ends_badly_or_leaves_processes_is_noticed(code, message, tmp_path, monkeypatch):
    monkeypatch.setattr(kill, "GRACE", 0.5)
    blow = Blow(number=signal.SIGTERM, to_all=False, share=0.0, change=1)
    process = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, start_new_session=True, text=True)
    with pytest.raises(BrokenError, match=message):
        strike(process, blow, tmp_path, 1.0)


def test_two_commands_in_one_folder_leave_what_one_does(tmp_path):
    """They write the same files at the same time; each file is the whole of one of them."""
    expected, _ = undisturbed("evaluate")
    folder = tmp_path / "run"
    folder.mkdir()
    both = [Forked("evaluate", folder) for _ in range(2)]
    assert [wait(process) for process in both] == [0, 0], folder.with_name("run.log").read_text()
    assert contents(folder) == expected
