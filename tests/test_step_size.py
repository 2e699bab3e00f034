"""The same agents at several physics steps: what is compared, and how much hangs on the step."""

import os
from pathlib import Path

import pyarrow as pa
import pytest
from agents import rows_of, table_of

from socialnav_mj.cli import main
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.studies.step_size import compare, evaluations, run, side_by_side, step_table

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
needs_ucy = pytest.mark.skipif(
    not os.environ.get("SOCIALNAV_MJ_DATA"), reason="needs the UCY recordings: SOCIALNAV_MJ_DATA is not set"
)


def table(outcomes):
    """A table with a draw for each list of successes."""
    rows = [row for draw, own in enumerate(outcomes) for row in rows_of("pf", "scenario_1", draw, {"success": own})]
    return table_of(rows)


def test_steps_are_settings_of_the_same_evaluation():
    planned = evaluations(Evaluation(dataset=TINY, task_kwargs={"turn_limit": "per_second"}), (0.01, 0.2 / 21))
    assert list(planned) == ["10 ms", "9.52 ms"]
    assert planned["9.52 ms"].task_kwargs == {"turn_limit": "per_second", "physics_timestep": 0.2 / 21}


def test_flips_are_counted_agent_by_agent_and_means_draw_by_draw():
    """Two of six agents end otherwise, in opposite directions: nothing of it is seen in the mean."""
    before = table([[True, False], [True, True], [False, False]])
    after = table([[False, False], [True, True], [True, False]])
    first, second = side_by_side({"10 ms": before, "5 ms": after})
    assert (first.flipped, first.shift.mean) == (0.0, 0.0)
    assert (second.flipped, second.shift.mean) == (pytest.approx(2 / 6), 0.0)
    assert second.means["success"] == pytest.approx(0.5) and (second.n_agents, second.n_draws) == (6, 3)
    lines = step_table([first, second]).splitlines()
    assert lines[2].startswith("| scenario_1 | pf | 10 ms | 0.500 | - | - |")
    assert lines[3].startswith("| scenario_1 | pf | 5 ms | 0.500 | +0.000 (-1.242 to +1.242) | 0.333 |")


def test_other_agents_are_refused():
    with pytest.raises(ValueError, match="'5 ms' and '10 ms' have different agents"):
        side_by_side({"10 ms": table([[True]]), "5 ms": table([[True, True]])})
    two = pa.concat_tables([table([[True]])])
    assert len(side_by_side({"10 ms": two, "5 ms": two})) == 2


def test_command_runs_every_step_and_prints_the_table(tmp_path, capsys):
    command = ["step-size", "--dataset", TINY, "--scenarios", "4", "--controllers", "go_straight", "--draws", "2"]
    main([*command, "--steps", "0.01", "0.005", "--jobs", "1", "--out", str(tmp_path / "out")])
    output = capsys.readouterr().out
    for step in ("10 ms", "5 ms"):
        assert f"| scenario_4 | go_straight | {step} | " in output
    assert "human" not in output
    assert len(list((tmp_path / "out").glob("*/episodes/*.npz"))) == 2 * 2 * 2


@pytest.mark.slow
@needs_ucy
def test_a_quarter_of_the_physics_step_moves_means_and_outcomes_no_more_than_the_docs_say(tmp_path):
    """Ten draws of students003, 10 ms against 2.5 ms; docs/simulation.md has the table."""
    flips = {"potential_field_capped": 0.12, "replay_irl(policy='students003_continuous_seed0')": 0.25}
    planned = evaluations(
        Evaluation(dataset="students003", scenarios=("scenario_1",), controllers=(*flips,), draws=10), (0.01, 0.0025)
    )
    assert all(done.error is None for done in run(planned, tmp_path))
    rows = [row for row in compare(planned, tmp_path) if row.step == "2.5 ms"]
    assert [(row.controller, row.n_draws) for row in rows] == [(name, 10) for name in flips]
    for row in rows:
        assert abs(row.shift.mean) <= 0.03 and row.shift.low < 0.0 < row.shift.high
        assert row.flipped <= flips[row.controller]
