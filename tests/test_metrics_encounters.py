"""docs/metrics.md against the code: five encounters by hand, every metric defined, every dialect as tabulated."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from encounters import encounters, hand_values
from episodes import Agent, Pedestrian, build_episode, line

from socialnav_mj import metrics
from socialnav_mj.metrics.dialects import DIALECTS, compute

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "metrics.md").read_text(encoding="utf-8")
ENCOUNTERS = encounters()


def tables(page: str) -> list[list[list[str]]]:
    """Every table of the page, as rows of cells, without its line of dashes."""
    found: list[list[list[str]]] = [[]]
    for row in page.splitlines():
        if row.startswith("|"):
            found[-1].append([cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]])
        elif found[-1]:
            found.append([])
    return [[rows[0], *rows[2:]] for rows in found if rows]


def table(first: str, last: str) -> list[list[str]]:
    return next(rows for rows in tables(PAGE) if (rows[0][0], rows[0][-1]) == (first, last))


def number(cell: str) -> float:
    return math.nan if cell == "-" else float(cell)


def agrees(cell: str, value: float) -> bool:
    return number(cell) == pytest.approx(value, abs=5.1e-5, nan_ok=True)


@pytest.mark.parametrize("name", ENCOUNTERS)
def test_every_metric_has_the_value_worked_out_by_hand(name):
    encounter = ENCOUNTERS[name]
    found = {key: float(values[0]) for key, values in metrics.per_agent(encounter.episode).items()}
    assert found == pytest.approx(hand_values(name, encounter), rel=1e-9, abs=1e-9, nan_ok=True)


def test_table_of_encounters_shows_values_worked_out_by_hand():
    heading, *rows = table("metric", "walked into")
    assert heading[1:] == list(ENCOUNTERS)
    hand = {name: hand_values(name, encounter) for name, encounter in ENCOUNTERS.items()}
    assert {row[0].strip("`") for row in rows} <= set(hand["crossing"]) and len(rows) >= 53
    wrong = [
        (row[0], name, cell, hand[name][row[0].strip("`")])
        for row in rows
        for name, cell in zip(heading[1:], row[1:], strict=True)
        if not agrees(cell, hand[name][row[0].strip("`")])
    ]
    assert not wrong, wrong


def test_table_of_dialects_shows_what_they_compute():
    heading, *rows = table("dialect", "walked into")
    shown = {(row[0], row[1].strip("`")): row[2:] for row in rows}
    computed = {
        (dialect, name): [float(compute(e.episode, dialect)[name][0]) for e in ENCOUNTERS.values()]
        for dialect in DIALECTS
        for name in compute(ENCOUNTERS["crossing"].episode, dialect)
    }
    assert heading[2:] == list(ENCOUNTERS) and shown.keys() == computed.keys()
    wrong = [
        (key, cell, value)
        for key, values in computed.items()
        for cell, value in zip(shown[key], values, strict=True)
        if not agrees(cell, value)
    ]
    assert not wrong, wrong


def test_every_dialect_is_described():
    assert [row[0].strip("`") for row in table("dialect", "what is peculiar")[1:]] == list(DIALECTS)


def test_head_on_pass_has_a_time_to_collision_in_one_dialect_and_none_in_another():
    """They pass 0.6 m apart. Along the line of centres (d - 0.17) / (2 gap / d), least one step before abreast."""
    episode = ENCOUNTERS["head-on pass"].episode
    d = math.hypot(0.4, 0.6)
    assert compute(episode, "socnavbench")["time_to_collision"] == pytest.approx([(d - 0.17) * d / 0.8])
    assert compute(episode, "francis2023")["minimum_time_to_collision"].tolist() == [math.inf]


def test_head_on_pass_violates_space_on_five_two_or_no_steps():
    episode = ENCOUNTERS["head-on pass"].episode
    assert compute(episode, "paper")["intimate_intrusions"].tolist() == [5.0]
    # From the robot's surface: |gap| < sqrt(0.62^2 - 0.6^2) = 0.156, abreast; sqrt(1.37^2 - 0.6^2) = 1.232, 3 a side.
    assert compute(episode, "hunavsim")["intimate_space_intrusions"] == pytest.approx([100 / 40])
    assert compute(episode, "hunavsim")["personal_space_intrusions"] == pytest.approx([100 * 6 / 40])
    assert compute(episode, "francis2023")["space_compliance"] == pytest.approx([0.0])
    assert compute(episode, "crowdnav")["too_close"].tolist() == [0.0]


def test_space_compliance_of_francis2023_is_the_complement_of_ours():
    episode = ENCOUNTERS["walked into"].episode
    # |4.1 - 0.2 k| < 0.5: steps 19 to 22 and perhaps, at 0.5 but for rounding, 18 or 23
    ours, theirs = metrics.space_compliance(episode), compute(episode, "francis2023")["space_compliance"]
    assert ours + theirs == pytest.approx([1.0])


def test_time_to_collision_of_francis2023_ends_at_the_personal_space():
    """A person who stands 0.4 m off a straight way at 1 m/s: 0.5 m apart 0.3 m before it, and never a collision."""
    agent = Agent(positions=line((0, 0), (2, 0), 10), goal=(3, 0))
    episode = build_episode([agent], [Pedestrian(positions=np.tile((3.0, 0.4), (11, 1)))])
    assert compute(episode, "francis2023")["minimum_time_to_collision"] == pytest.approx([3.0 - 1.8 - 0.3])
    assert metrics.minimum_time_to_collision(episode).tolist() == [math.inf]


def test_hunavsim_takes_a_turn_to_the_right_for_standing():
    """abs(rate < 0.01): on the spot at 1 rad/s to the left it moves, to the right it stands, for all 10 steps."""
    episode = build_episode([Agent(positions=np.zeros((11, 2)), goal=(3, 0))], [])
    turning = {s: replace(episode, agent_yaw_rate=np.full_like(episode.agent_yaw_rate, s)) for s in (1.0, -1.0)}
    stopped = [float(compute(turning[s], "hunavsim")["time_not_moving"][0]) for s in (1.0, -1.0)]
    assert stopped == pytest.approx([0.0, 2.0])


def test_irregularity_of_socnavbench_changes_when_the_map_is_moved_and_ours_does_not():
    episode = ENCOUNTERS["crossing"].episode
    points = ("agent_position", "agent_start", "agent_goal", "pedestrian_position")
    moved = replace(episode, **{name: getattr(episode, name) + np.array([0.0, 5.0]) for name in points})
    theirs = [float(compute(e, "socnavbench")["path_irregularity"][0]) for e in (episode, moved)]
    assert abs(theirs[0] - theirs[1]) > 0.5
    assert metrics.path_irregularity(moved) == pytest.approx(metrics.path_irregularity(episode))


def test_hunavsims_social_work_is_a_sum_over_steps():
    episode = ENCOUNTERS["overtaking"].episode
    summed = compute(episode, "hunavsim")["social_work"]
    assert metrics.social_work(episode) == pytest.approx(0.2 * summed, rel=1e-6)  # one person: turning has no side


def test_unknown_dialect_and_zone_are_named():
    episode = ENCOUNTERS["crossing"].episode
    with pytest.raises(ValueError, match=r"unknown dialect 'sean'; available: paper, socnavbench"):
        compute(episode, "sean")
    with pytest.raises(ValueError, match=r"unknown zone 'near'; available: intimate, personal"):
        metrics.zone_share(episode, "near")
