"""The work of a control step does not grow unnoticed: counts of it stay below stored ones, on any machine."""

import json
import subprocess
import sys
from pathlib import Path

from counts import FILE, SLACK, grown

STORED = json.loads(FILE.read_text(encoding="utf-8"))


def test_no_count_of_a_short_episode_has_grown():
    """In a process of its own, where no other test has left threads, caches or hooks."""
    script = Path(__file__).parent / "counts.py"
    result = subprocess.run([sys.executable, str(script), "--print"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    now = json.loads(result.stdout)
    assert {scenario: list(counts) for scenario, counts in now.items()} == {
        scenario: list(counts) for scenario, counts in STORED.items()
    }, "other things are counted than tests/data/counts.json has; write it anew: python tests/counts.py"
    assert not grown(now, STORED), "\n".join(grown(now, STORED))


def test_growth_is_told_with_what_grew_and_how_the_file_is_brought_up_to_date():
    name = "contacts per control step"
    stored = {"scenario_1": {name: 10.0, "slots per control step": 11.0}}
    assert not grown({"scenario_1": {name: 10.0 * SLACK, "slots per control step": 0.0}}, stored)
    (line,) = grown({"scenario_1": {name: 11.6, "slots per control step": 11.0}}, stored)
    assert line.startswith("scenario_1: contacts per control step grew from 10.0 to 11.6 (allowed: 11.5); ")
    assert line.endswith("python tests/counts.py")
