"""The same agents at several physics steps: what is compared, and how much hangs on the step."""

import os
from pathlib import Path

import pyarrow as pa
import pytest
from agents import rows_of, table_of

from socialnav_mj.cli import main
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.studies.step_size import compare, evaluations, run, side_by_side, step_table, worlds

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
needs_ucy = pytest.mark.skipif(
    not os.environ.get("SOCIALNAV_MJ_DATA"), reason="needs the UCY recordings: SOCIALNAV_MJ_DATA is not set"
)


def table(outcomes):
    """A world with a draw for each list of successes."""
    rows = [row for draw, own in enumerate(outcomes) for row in rows_of("pf", "scenario_1", draw, {"success": own})]
    return table_of(rows)


def test_worlds_are_the_steps_and_a_nudge_at_the_first():
    assert worlds((0.01, 0.0025)) == {
        "10 ms": {"physics_timestep": 0.01},
        "2.5 ms": {"physics_timestep": 0.0025},
        "10 ms, people 1 um wider": {"physics_timestep": 0.01, "pedestrian_radius": pytest.approx(0.150001)},
    }


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


def test_command_runs_every_world_and_prints_the_table(tmp_path, capsys):
    command = ["step-size", "--dataset", TINY, "--scenarios", "4", "--controllers", "go_straight", "--draws", "2"]
    main([*command, "--steps", "0.01", "0.005", "--jobs", "1", "--out", str(tmp_path / "out")])
    output = capsys.readouterr().out
    for world in ("10 ms", "5 ms", "10 ms, people 1 um wider"):
        assert f"| scenario_4 | go_straight | {world} | " in output
    assert "human" not in output
    assert len(list((tmp_path / "out").glob("*/episodes/*.npz"))) == 3 * 2 * 2


@pytest.mark.slow
@needs_ucy
def test_a_quarter_of_the_physics_step_moves_means_and_outcomes_no_more_than_the_docs_say(tmp_path):
    """Ten draws of students003, 10 ms against 2.5 ms; docs/simulation.md has the table of both controllers."""
    planned = evaluations(
        Evaluation(dataset="students003", scenarios=("scenario_1",), controllers=("potential_field",), draws=10),
        (0.01, 0.0025),
    )
    assert all(done.error is None for done in run(planned, tmp_path))
    rows = compare(planned, tmp_path)
    assert [row.n_draws for row in rows] == [10, 10, 10]
    for row in rows[1:]:
        assert abs(row.shift.mean) <= 0.03 and row.flipped <= 0.12
