"""Figures exist, say what they show in text, are the same for the same numbers, and survive missing ones."""

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from agents import METHOD_VALUES, experiment_table, roster_of
from toy_policies import write_toy

from socialnav_mj.cli import main
from socialnav_mj.controllers.replay_irl import load_policy
from socialnav_mj.report import style
from socialnav_mj.studies.levels import LEVEL_MEASURES, LevelTable, levels
from socialnav_mj.studies.looks import LOOKS, SHADES, looks_of
from socialnav_mj.studies.panel import METHODS, MIXED, POTENTIAL_FIELD, make_panel
from socialnav_mj.studies.paper import figures, training_curves
from socialnav_mj.studies.paper.figures import FIGURES, draw_figures, draw_sweep
from socialnav_mj.studies.paper.reward_map import (
    MOTIONS,
    REACH,
    SHOWN,
    draw_reward_maps,
    reward_map,
    rows_of,
    worth_of_company,
)
from socialnav_mj.studies.paper.training_curves import draw_training_curves, training_table

SEEDS = (0, 1, 2)


def level_table(**kwargs):
    return LevelTable(rows=tuple(levels(make_panel(experiment_table(**kwargs), roster_of(SEEDS)))))


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 40)


@pytest.fixture(scope="module")
def table():
    return level_table(noise=0.02)


def texts(path):
    """All text of an SVG."""
    return " ".join(
        "".join(element.itertext()) for element in ElementTree.parse(path).iter() if element.tag.endswith("text")
    )


def grey(colour):
    """Brightness of "#rrggbb" in [0, 1] (Rec. 601)."""
    return sum(w * int(colour[k : k + 2], 16) / 255.0 for w, k in ((0.299, 1), (0.587, 3), (0.114, 5)))


def test_levels_are_the_means_of_the_table_within_the_interval(table):
    for method, short in (
        ("potential_field", "pf"),
        ("potential_field_capped", "cap"),
        ("replay_irl", "irl"),
        ("mixed", "mix"),
        ("human", "human"),
    ):
        for place, scenario in enumerate(table.scenarios):
            level = table.find(scenario, method, "average_speed")
            assert level.interval.mean == pytest.approx(METHOD_VALUES[short]["speed"][place], rel=0.05)
            assert level.interval.low < level.interval.mean < level.interval.high
    assert len(table.rows) == 4 * (3 + 2 * 4) * len(LEVEL_MEASURES)
    each = [table.find("scenario_1", MIXED, "success", k).interval.mean for k in SEEDS]
    assert np.mean(each) == pytest.approx(table.find("scenario_1", MIXED, "success").interval.mean)


def test_intervals_of_shares_end_at_0_and_1(table):
    for row in table.rows:
        if row.measure == "success":
            assert 0.0 <= row.interval.low <= row.interval.high <= 1.0


@pytest.fixture(scope="module")
def drawn(table, tmp_path_factory):
    """All figures, drawn coarsely."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "DOTS_PER_INCH", 40)
        return draw_figures(table, tmp_path_factory.mktemp("drawn"))


def test_five_figures_appear_as_png_and_svg_with_their_labels(drawn):
    paths, folder = drawn, drawn[0].parent
    assert sorted(p.name for p in paths) == sorted(f"{d.name}.{e}" for d in FIGURES for e in ("png", "svg"))
    for drawing in FIGURES:
        assert (folder / f"{drawing.name}.png").read_bytes().startswith(b"\x89PNG")
        text = texts(folder / f"{drawing.name}.svg")
        for method in METHODS:
            assert LOOKS[method].label in text
        for row in drawing.rows:
            assert all(line in text for line in row.label.split("\n"))
        if drawing.bars:
            assert all(f"({'abcd'[k]}) scenario {k + 1}" in text for k in range(4))
            assert "each training" in text and "human, 95 % interval" in text
    assert "1.2 m" in texts(folder / "figure_4_intrusions.svg")


def test_every_panel_is_tall_enough_for_its_values(table, tmp_path, monkeypatch):
    """Panels of a row share their axis, whichever has the greatest value: here the last, ten times the first."""
    grown = {scenario: 0.1 * 10.0 ** (place / 3.0) for place, scenario in enumerate(table.scenarios)}
    ends = ("mean", "low", "high")
    rows = [
        replace(
            row, interval=replace(row.interval, **{e: grown[row.scenario] * getattr(row.interval, e) for e in ends})
        )
        for row in table.rows
    ]
    drawn = []
    monkeypatch.setattr(figures, "save", lambda figure, folder, name: drawn.append(figure) or [])
    draw_figures(LevelTable(rows=tuple(rows)), tmp_path)
    panels = [axes for figure in drawn for axes in figure.axes]
    assert len(panels) == 4 * 5 + 3
    for axes in panels:
        bottom, top = axes.get_ylim()
        assert bottom <= axes.dataLim.y0 + 1e-9 and axes.dataLim.y1 <= top + 1e-9


def test_equal_levels_give_equal_files(table, drawn, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "FIGURES", (FIGURES[0], FIGURES[-1]))
    again = draw_figures(table, tmp_path)
    assert len(again) == 4
    for path in again:
        assert path.read_bytes() == (drawn[0].parent / path.name).read_bytes(), path.name


def test_figures_do_without_intervals_and_without_a_scenario(tmp_path):
    sparse = level_table(n_draws=1, n_agents=6, scenarios=("scenario_1", "scenario_4"))
    assert np.isnan(sparse.find("scenario_1", POTENTIAL_FIELD, "success").interval.low)
    assert len(draw_figures(sparse, tmp_path)) == 10


def test_methods_differ_in_brightness_and_hatch_or_marker():
    looks = [LOOKS[method] for method in METHODS]
    brightness = sorted(grey(look.colour) for look in looks)
    assert min(np.diff(brightness)) > 0.1
    assert len({look.hatch for look in looks[:4]}) == 4
    assert len({look.marker for look in looks}) == len({look.line for look in looks}) == 5


def test_sweep_runs_from_the_potential_field_to_the_learned_policy(table, tmp_path):
    paths = draw_sweep({1.0: table, 2.0: table, 5.0: table}, table, tmp_path)
    text = texts(paths[1])
    for label in ("switch distance [m]", "PF", "IRL", "scenario 4: 90 % agents", "share of agents that succeed"):
        assert label in text
    assert "the paper's 2 m" in text


def test_sweep_has_a_tick_at_every_distance(table, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(figures, "save", lambda figure, folder, name: drawn.append(figure) or [])
    draw_sweep({0.5: table, 1.0: table, 1.5: table, 2.0: table}, table, tmp_path)
    for axes in drawn[0].axes:
        assert [label.get_text() for label in axes.get_xticklabels()] == ["PF", "0.5", "1", "1.5", "2", "IRL"]


def test_scenarios_and_trainings_have_no_methods_colour():
    assert not {*SHADES} & {look.colour for look in LOOKS.values()}
    assert min(np.diff([grey(colour) for colour in SHADES])) > 0.1


def test_the_papers_methods_look_the_same_in_all_figures_and_nobody_else_looks_like_them():
    looks = looks_of(["mpc", "hybrid", "orca", "replay_irl"])
    assert looks["hybrid"] == LOOKS[MIXED]
    assert looks["replay_irl"] == LOOKS["replay_irl"]
    assert len({(look.colour, look.marker, look.line) for look in looks.values()}) == 4


@pytest.fixture
def shy(tmp_path):
    """Its reward is tanh(-proximity of who is straight ahead)."""

    def fill(weights):
        weights[0, 6] = -1.0

    return load_policy(write_toy(tmp_path, "shy", seed=0, reward=fill))


@pytest.mark.parametrize("motion", MOTIONS)
def test_reward_map_shows_the_reward_of_a_walker_at_each_place(shy, motion):
    drawn = reward_map(shy, motion)
    assert drawn.alone == 0.0
    row, column = np.abs(drawn.y).argmin(), np.abs(drawn.x - 1.5).argmin()
    assert drawn.reward[row, column] == pytest.approx(np.tanh(-np.exp(-1.5 / 2.0)))
    # beside and behind the agent, and outside its sector of 30 degrees, the walker changes nothing
    behind = drawn.reward[:, drawn.x < -1e-9]
    assert np.abs(behind).max() == 0.0
    np.testing.assert_allclose(drawn.reward, drawn.reward[::-1], atol=1e-12)


def test_reward_map_tells_motions_apart(tmp_path):
    """Closing speed of whoever is ahead: 1 m/s of its own and the agent's 0.8 m/s; crossing and receding are less."""

    def fill(weights):
        weights[0, 6 + 12] = 1.0

    policy = load_policy(write_toy(tmp_path, "brisk", seed=0, reward=fill))
    row = slice(60, 61)
    ahead = {motion: reward_map(policy, motion).reward[row, -1].item() for motion in MOTIONS}
    expected = {"approaching": 1.8, "crossing": 0.8, "receding": -0.2}
    assert ahead == pytest.approx({motion: np.tanh(speed / 2.0) for motion, speed in expected.items()})
    with pytest.raises(ValueError, match="unknown motion 'hovering'; available: approaching, crossing, receding"):
        reward_map(policy, "hovering")


def test_reward_maps_are_drawn_with_titles_and_scale(shy, tmp_path):
    paths = draw_reward_maps(rows_of({"training 0": shy, "training 1": shy}), tmp_path)
    text = texts(paths[1])
    for label in ("walker approaching", "walker crossing", "walker receding", "training 1", "learned reward", "alone"):
        assert label in text
    assert "mean of 2" in text
    for words in ("Learned reward of an agent at 0.8 m/s", "with nobody there", "dashed circle: 1.2 m"):
        assert words in text
    assert paths[1].stat().st_size < 1_000_000 and REACH == 3.0
    rows = rows_of({f"training {k}": shy for k in range(SHOWN + 1)})
    many = texts(draw_reward_maps(rows, tmp_path / "many")[1])
    assert "mean of 4" in many and f"training {SHOWN - 1}" in many and f"training {SHOWN}" not in many
    assert "mean" not in texts(draw_reward_maps(rows_of({"training 0": shy}), tmp_path / "one", "own_name")[1])
    assert (tmp_path / "one" / "own_name.png").is_file()


def test_company_is_worth_the_mean_over_directions(shy):
    """Only who is in the sector of 30 degrees ahead counts: a twelfth of the directions."""
    for distance in (0.5, 1.0, 2.0):
        expected = np.tanh(-np.exp(-distance / 2.0)) / 12.0
        assert worth_of_company(shy, "approaching", distance) == pytest.approx(expected, abs=1e-9)


def history_card(kept):
    seconds = {"sac": 30.0, "reward": 6.0, "all": 60.0}
    history = [
        {"scene_steps": k, "success": k / 4e3, "intrusion_share": 0.2, "training_collided": 0.5, "seconds": seconds}
        for k in (1000, 2000, 3000)
    ]
    return {
        "scene_steps": kept,
        "transitions": 7,
        "metrics": {"held_out": {"success": 0.75, "intrusion_share": 0.125}},
        "history": history,
    }


def test_training_curves_mark_the_kept_checkpoint_and_the_table_says_where_the_time_went(tmp_path):
    cards = {0: history_card(2000), 3: history_card(3000)}
    png, svg = draw_training_curves(cards, tmp_path)
    assert png.stat().st_size > 0
    text = " ".join(ElementTree.parse(svg).getroot().itertext())
    assert text.count("each training") == 1 and "kept" in text and "mean of 2" in text and "validation success" in text
    without = draw_training_curves({0: history_card(-1), 3: history_card(-1)}, tmp_path / "b")[1]
    assert len(svg.read_text()) > len(without.read_text())  # the rings
    lines = training_table({**cards, 4: {"config": {}}})
    assert "| 3 | 3000 | 7 | - | - | 0.750 / 0.125 | 50% / 10% / 40% of 1.0 min |" in lines
    assert "| 4 | - | - | - | - | - | - |" in lines


def test_training_curves_clip_no_point(tmp_path, monkeypatch):
    """Success rises from the lower to the upper end: rings and points there are drawn whole."""
    drawn = []
    monkeypatch.setattr(training_curves, "save", lambda figure, folder, name: drawn.append(figure) or [])
    draw_training_curves({0: history_card(3000)}, tmp_path)
    for axes in drawn[0].axes:
        assert all(not line.get_clip_on() for line in axes.lines)
        assert axes.get_ylim()[1] > axes.dataLim.y1 and axes.get_xlim()[1] > axes.dataLim.x1


def test_command_draws_maps_of_titled_policies_and_tells_what_company_is_worth(shy, tmp_path, capsys):
    mine, out = f"mine={tmp_path / 'shy.safetensors'}", tmp_path / "m"
    main(["reward-maps", mine, mine, "students003_continuous_seed0", "--out", str(out), "--json"])
    (table,) = json.loads(capsys.readouterr().out)["tables"]
    expected = np.tanh(-np.exp(-np.array([0.5, 1.0, 2.0]) / 2.0)) / 12.0
    assert table["rows"][0] == {"reward": "mine (2)"} | {
        f"{motion} 0.5 / 1 / 2 m": " / ".join(f"{value:+.3f}" for value in expected) for motion in MOTIONS
    }
    assert "students003_continuous_seed0" in texts(tmp_path / "m" / "reward_maps.svg")
    with pytest.raises(SystemExit):
        main(["reward-maps", "nobody"])
    assert "nobody" in capsys.readouterr().err
