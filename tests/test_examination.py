"""The checker of controllers: a tick for each promise, or the input that breaks it."""

import sys
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.cli import main
from socialnav_mj.controllers import GoStraight, make_controller
from socialnav_mj.controllers.examination import examine

SOUND = """
import numpy as np

class Mine:
    name = "mine"

    def reset(self, limits, *, seed=0):
        self.limits, self.count = limits, 0

    def act(self, observation):
        ahead, left = observation["goal"].T
        return self.limits.wheel_speed(np.stack([0.5 + 0.0 * ahead, np.arctan2(left, ahead)], axis=1))
"""


class Wrong(GoStraight):
    """What one of its functions does is named by its field."""

    def __init__(self, how) -> None:
        super().__init__()
        self.how = how

    def act(self, observation):
        return self.how(super().act(observation), observation)


def nan_when_met(action, seen):
    return np.where(seen["pedestrian_mask"].any(axis=1)[:, None], np.nan, action)


def by_place_in_the_order(action, seen):
    return action * np.linspace(0.5, 1.0, len(action))[:, None]


BROKEN = {
    "takes every": lambda action, seen: action[:, :1],
    "finite": nan_when_met,
    "within": lambda action, seen: action + 100.0,
    "deterministic": lambda action, seen: action * np.random.default_rng().uniform(0.5, 1.0),
    "the same in every order": by_place_in_the_order,
    "the same in every frame": lambda action, seen: action * (0.9 - 0.1 * np.sign(seen["position"][:, :1])),
}


def test_sound_controllers_pass_and_their_time_is_told() -> None:
    findings = list(examine(lambda: make_controller("go_straight")))
    assert all(finding.passed for finding in findings), findings
    assert findings[-1].question.startswith("time") and " us (60 agents" in findings[-1].told


def test_an_exception_of_the_controller_is_told_once() -> None:
    def slip(action, seen):
        raise NameError("name 'ahed' is not defined")

    (finding,) = examine(lambda: Wrong(slip))
    assert not finding.passed and "NameError: name 'ahed' is not defined (" in finding.told
    assert finding.told.endswith("; the other questions were not asked")


@pytest.mark.parametrize("question", BROKEN)
def test_each_broken_promise_is_told_with_its_input(question: str) -> None:
    broken = [finding for finding in examine(lambda: Wrong(BROKEN[question])) if not finding.passed]
    first = broken[0]
    assert first.question.startswith(question) and first.told.startswith("walk '") and first.observation is not None
    if question not in ("takes every", "deterministic"):
        assert [finding.question for finding in broken] == [first.question]
        assert "agent " in first.told and "expected" in first.told and "It saw goal" in first.told


def test_command_prints_ticks_and_ends_with_1_and_the_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    monkeypatch.setattr(sys, "path", [*sys.path])
    Path("mine.py").write_text(SOUND)
    main(["check", "mine:Mine"])
    assert capsys.readouterr().out.count("\u2713") == 7
    Path("odd.py").write_text(SOUND.replace("0.5 + 0.0 * ahead", "np.sqrt(ahead)"))
    with pytest.raises(SystemExit) as end, np.errstate(all="ignore"):
        main(["check", "odd:Mine", "--save", "seen.npz"])
    told = capsys.readouterr().out
    assert end.value.code == 1 and "\u2717 finite: walk 'crowd'" in told
    with np.load("seen.npz") as seen:
        assert seen["goal"].shape == (5, 2)
