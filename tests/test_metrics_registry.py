"""Metrics keep what they declare; tables, summaries and pages follow the declarations."""

import math
import re
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from declarations import broken, comfort, constant
from encounters import encounters
from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj import metrics
from socialnav_mj.contact import FORCE_COLUMNS
from socialnav_mj.episode import Outcome, Partner
from socialnav_mj.learning import shipping
from socialnav_mj.metrics import METRICS, Kind, Mean, Missing, Need
from socialnav_mj.metrics.missing import NEVER
from socialnav_mj.metrics.registry import check_metrics, per_agent
from socialnav_mj.report import columns, power
from socialnav_mj.report.agents import SCHEMA, agents_schema, agents_table
from socialnav_mj.report.estimates import MEASURES, measures_of, summarise
from socialnav_mj.studies import claims, held_out, levels
from socialnav_mj.studies.leave_one_out import comparison
from socialnav_mj.studies.panel import COMMON
from socialnav_mj.studies.paper import figures

EAST = line((0, 0), (4, 0), 20)


def standing(where, n_samples):
    return Pedestrian(positions=np.tile(where, (n_samples, 1)))


def crowd():
    """Agents of every outcome among people; collisions of every fault, one clamped, one wedged, one repeated."""
    agents = [
        Agent(positions=EAST, goal=(4.4, 0), delay_steps=2, spawn_step=2),
        Agent(positions=[*line((0, 1), (2, 1), 10), *line((2, 1), (0, 1), 10)], goal=(9, 1), outcome=Outcome.TIMED_OUT),
        Agent(positions=np.full((5, 2), 2.0), goal=(5, 5), outcome=Outcome.UNFINISHED),
        Agent(positions=[(0, 3)], goal=(3, 3), outcome=Outcome.NEVER_SPAWNED),
        Agent(positions=line((4, 4), (0, 4), 20), goal=(0, 4)),
        Agent(positions=line((0, 5), (3, 5), 12), goal=(9, 5), outcome=Outcome.OVERTURNED),
    ]
    people = [standing((2, 0.3), 24), Pedestrian(positions=line((4, 1.2), (0, 1.2), 20)), standing((2, 2.2), 24)]
    touches = [
        Touch(agent=0, partner=0, step=11.5, impact_force=150.0),
        Touch(agent=0, partner=0, step=14, impact_force=90.0),
        Touch(agent=1, partner=1, step=9, duration=0.8, impact_force=300.0),
        Touch(agent=2, partner=2, step=2, duration=0.8, impact_force=9000.0, squeeze=8000.0),
        Touch(agent=2, partner=1, step=3, duration=0.8, impact_force=8000.0),
        *(Touch(agent=0, partner=other, step=step, kind=Partner.AGENT) for other, step in ((4, 9), (1, 6), (2, 3))),
    ]
    return build_episode(agents, people, touches)


def as_human_row(episode):
    nothing = np.full(len(episode.contact_time), np.nan)
    return replace(episode, **{f"contact_{name}": nothing for name in FORCE_COLUMNS})


def pushing():
    """Two agents, one of which is told to stop after 0.6 s; a person between them leaves its track, more and more."""
    way = np.stack([np.array([0.0, 0.2, 0.4, 0.6, 0.75, 0.8, 0.8, 0.8, 0.8]), np.zeros(9)], axis=1)
    told = np.stack([np.array([1.0] * 3 + [0.0] * 5), np.zeros(8)], axis=1)
    stopping = Agent(positions=way, goal=(9, 0), outcome=Outcome.UNFINISHED, twist=told)
    waiting = Agent(positions=np.full((9, 2), (0.0, 2.2)), goal=(9, 2), outcome=Outcome.UNFINISHED)
    off = np.stack([np.linspace(0.0, -0.8, 9), np.linspace(0.0, 0.4, 9)], axis=1)
    person = Pedestrian(positions=np.array([0.0, 1.0]) + 0.01 * np.arange(9)[:, None] * (1.0, 0.0), deviation=off)
    return build_episode([stopping, waiting], [person])


EDGES = {
    "pushing": pushing(),
    "no agents": build_episode([], [standing((0, 0), 3)]),
    "nobody at all": build_episode([]),
    "never spawned": build_episode([Agent(positions=[(0, 0)], outcome=Outcome.NEVER_SPAWNED, goal=(3, 4))]),
    "never spawned among people": build_episode(
        [Agent(positions=[(0, 0)], outcome=Outcome.NEVER_SPAWNED, goal=(3, 4))], [standing((0, 0), 5)]
    ),
    "timed out": build_episode([Agent(positions=EAST, goal=(9, 0), outcome=Outcome.TIMED_OUT)], [standing((2, 0), 21)]),
    "no pedestrians": build_episode([Agent(positions=EAST)]),
    "pedestrians come at the end's sample": build_episode(
        [Agent(positions=EAST)], [Pedestrian(positions=[(4, 0.2)], first_step=20)]
    ),
    "arrives where it spawns": build_episode([Agent(positions=[(0, 0)], goal=(0.3, 0))], [standing((1, 0), 2)]),
    "one step": build_episode([Agent(positions=EAST[:2])], [standing((1, 0), 3)]),
    "overtaken": build_episode([Agent(positions=EAST)], [Pedestrian(positions=line((-1.5, 0), (6.5, 0), 20))]),
    "two steps": build_episode([Agent(positions=EAST[:3])], [standing((1, 0), 3)]),
    "slow": build_episode([Agent(positions=line((0, 0), (8, 0), 140), goal=(9, 0), outcome=Outcome.TIMED_OUT)]),
    "round a corner": build_episode([Agent(positions=[*line((0, 0), (3, 0), 6), *line((3, 0.5), (3, 4), 7)])]),
    "two stand and touch": build_episode(
        [Agent(positions=np.full((5, 2), x), goal=(9, 9), outcome=Outcome.UNFINISHED) for x in (0.0, 0.2)],
        touches=[Touch(agent=0, partner=1, step=2, kind=Partner.AGENT)],
    ),
    "start is goal": build_episode([Agent(positions=np.zeros((4, 2)), goal=(0, 0))], [standing((0, 0), 4)]),
    "crowd": crowd(),
    "human row": as_human_row(crowd()),
    "told to stop at once": build_episode(
        [Agent(positions=[(0, 0), *[(0.2, 0)] * 5], twist=np.zeros((5, 2)), goal=(9, 0), outcome=Outcome.UNFINISHED)]
    ),
    "human row without collisions": as_human_row(build_episode([Agent(positions=EAST)], [standing((2, 1), 9)])),
    "touched after the end": build_episode(
        [Agent(positions=EAST)], [standing((4, 0), 30)], [Touch(agent=0, partner=0, step=25)]
    ),
    **{name: encounter.episode for name, encounter in encounters().items()},
}


@pytest.mark.parametrize("name", EDGES)
def test_every_metric_keeps_its_type_range_and_nan_rule(name):
    assert [line for metric in METRICS for line in broken(metric, EDGES[name])] == []


def test_edges_show_every_nan_rule_at_work():
    """A rule that is never true in these episodes would not be tested by them."""
    idle = [
        metric.name
        for metric in METRICS
        if metric.missing is not NEVER and not any(metric.missing.where(episode).any() for episode in EDGES.values())
    ]
    there = [metric.name for metric in METRICS if all(metric.missing.where(e).all() for e in EDGES.values())]
    assert idle == [] and there == []


def test_agents_pay_for_the_way_that_they_push_people_off_and_for_the_stop_that_takes_long():
    """The deviation grows by |(-.8, .4)| / 8 a step; the standing agent, at 1.2 m, is nearer from step 4 on."""
    values = per_agent(EDGES["pushing"])
    step = np.hypot(0.1, 0.05)
    np.testing.assert_allclose(values["deviation_imposed"], [4 * step, 4 * step])
    # Behind by 0.1 m a step along the heading; the recorded track goes by (0.11, -0.05) m a step.
    late = 0.1 / (np.hypot(0.11, 0.05) / 0.2)
    np.testing.assert_allclose(values["delay_imposed"], [4 * late, 4 * late])
    assert values["stopping_distance"][0] == pytest.approx(0.2) and np.isnan(values["stopping_distance"][1])
    # Told to stop and 0.15 and 0.05 m farther in two of eight steps.
    np.testing.assert_allclose(values["tracking_error"], [0.2 / 8, 0.0], atol=1e-9)
    # Not as commanded at the ends of steps 2 (0.75 m/s for 1), 3 and 4 (0.25 m/s for 0).
    assert values["unmet_share"].tolist() == [2 / 8, 0.0] and values["side_slip"].tolist() == [0.0, 0.0]


def altered(episode, need):
    """An episode that differs in one thing that a metric may read."""
    if need is Need.GOAL:
        return replace(episode, agent_start=episode.agent_start - 0.7, agent_goal=(0, 5) - episode.agent_goal)
    if need is Need.POSITION:
        # Sideways, more from sample to sample.
        drift = 0.03 * np.arange(len(episode.time))[:, None, None] ** 1.5 * np.array([0.2, 1.0])
        return replace(episode, agent_position=episode.agent_position + drift)
    if need is Need.HEADING:
        return replace(episode, agent_heading=episode.agent_heading + 0.6)
    if need is Need.VELOCITY:
        growth = np.linspace(0.05, 3.0, len(episode.time))[:, None, None] ** 2
        return replace(episode, agent_velocity=episode.agent_velocity * growth)
    if need is Need.TILT:
        return replace(episode, agent_tilt=0.9 * episode.agent_tilt + 0.2)
    if need is Need.PEDESTRIANS:
        return replace(episode, pedestrian_position=0.4 * episode.pedestrian_position + (0.1, 0.3))
    if need is Need.DEVIATIONS:
        growth = 0.1 * np.arange(len(episode.time))[:, None, None] * np.array([-1.0, 0.3])
        off = episode.pedestrian_deviation
        return episode if off is None else replace(episode, pedestrian_deviation=off + growth)
    if need is Need.DRIVE:
        return replace(episode, agent_wheel_speed=0.0 * episode.agent_wheel_speed)
    if need is Need.CONTACTS:
        names = [name for name in vars(episode) if name.startswith("contact_")]
        return replace(episode, **{name: getattr(episode, name)[:0] for name in names})
    return as_human_row(episode)


VALUES = {name: per_agent(episode) for name, episode in EDGES.items()}


@pytest.mark.parametrize("need", Need)
def test_metrics_read_what_they_say_they_need_and_nothing_else(need):
    read = set()
    for name, episode in EDGES.items():
        for metric, values in per_agent(altered(episode, need)).items():
            if not np.array_equal(values, VALUES[name][metric], equal_nan=True):
                read.add(metric)
    assert read == {metric.name for metric in METRICS if need in metric.needs}


def test_registry_holds_the_declarations_of_all_modules():
    files = sorted(Path(metrics.__file__).parent.glob("*.py"))
    declaring = [path.stem for path in files if re.search(r"^METRICS = \($", path.read_text("utf-8"), re.MULTILINE)]
    modules = [sys.modules[f"{metrics.__name__}.{name}"] for name in declaring]
    assert len(modules) >= 10 and [m for module in modules for m in module.METRICS] == list(METRICS)
    assert list(per_agent(EDGES["crowd"])) == [m.name for m in METRICS]


def test_metric_of_a_user_gets_a_column_and_a_summary_without_another_line():
    own = (*METRICS, comfort(paired=True, means=(Mean(), Mean(name="comfort_of_steps", weight="active_steps"))))
    table = agents_table(EDGES["crowd"], metrics=own)
    names = SCHEMA.names
    paired, file = names.index("human_completion_time"), names.index("episode")
    expected = [*names[:paired], "comfort", *names[paired:file], "human_comfort", *names[file:]]
    assert table.schema.names == expected == agents_schema(own).names
    assert table["comfort"].to_pylist() == [0.25] * 6 and table["human_comfort"].to_pylist() == [None] * 6
    found = {e.measure: e for e in summarise(table, measures_of(own))}
    assert list(found) == [*MEASURES, "comfort", "comfort_of_steps"]
    assert (found["comfort"].mean, found["comfort"].n_agents) == (0.25, 6)
    assert (found["comfort_of_steps"].mean, found["comfort_of_steps"].n_agents) == (0.25, 5)
    assert measures_of(own)["comfort"].heading == "comfort [m]"


def test_few_metrics_make_a_small_table():
    chosen = [metric for metric in METRICS if metric.name in ("success", "first_partner")]
    table = agents_table(EDGES["crowd"], metrics=chosen)
    assert [name for name in table.schema.names if name not in ("success", "first_partner")] == [
        name for name in SCHEMA.names if name in vars(columns).values() and name not in columns.ORDER
    ]
    assert table["first_partner"].to_pylist() == ["agent", "agent", "pedestrian", None, "agent", None]
    assert [e.measure for e in summarise(table, measures_of(chosen))] == [
        "success",
        "first_hit_pedestrian",
        "first_hit_agent",
    ]


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (comfort(name="success"), "success declared more than once"),
        (comfort(means=(Mean(name="completion_time"),)), "completion_time declared more than once"),
        (comfort(means=(Mean(weight="steps"),)), r"comfort is weighted by \['steps'\]; available: collisions_pedestr"),
    ],
)
def test_metrics_that_do_not_go_together_are_named(second, message):
    with pytest.raises(ValueError, match=message):
        check_metrics([*METRICS, second])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "my comfort"}, "name = 'my comfort' is not allowed; allowed: letters"),
        ({"kind": Kind.NAME}, "comfort: names = {} do not go with Kind.NAME"),
        ({"names": {0: "good"}}, "names = {0: 'good'} do not go with Kind.NUMBER"),
        ({"means": (Mean(share_of="good"),)}, r"share_of = \['good'\] is not allowed"),
        ({"low": 2.0}, "low = 2.0, high = 1.0, digits = 3 make no sense"),
    ],
)
def test_declaration_that_contradicts_itself_is_named(changes, message):
    with pytest.raises(ValueError, match=message):
        comfort(**changes)


def test_broken_promises_are_found():
    """The check of declarations must be able to fail."""
    episode = EDGES["crowd"]
    for changes, message in (
        ({"function": partial(constant, value=1.5)}, "allowed: 0.0 to 1.0"),
        ({"function": partial(constant, value=math.nan)}, "NaN is promised for"),
        ({"function": partial(constant, value=math.inf)}, "must be finite"),
        ({"function": partial(constant, value=1)}, "has type int64"),
        ({"kind": Kind.COUNT}, "whole numbers"),
        ({"missing": Missing(rule="always", where=partial(constant, value=True))}, "(always)"),
    ):
        assert any(message in line for line in broken(comfort(**changes), episode)), message


def test_columns_and_measures_have_the_types_of_their_metrics():
    types = {Kind.FLAG: pa.bool_(), Kind.COUNT: pa.int64(), Kind.NUMBER: pa.float64(), Kind.NAME: pa.string()}
    for metric in METRICS:
        assert SCHEMA.field(metric.name).type == types[metric.kind]
        assert (columns.human(metric.name) in SCHEMA.names) == metric.paired
    assert {m.name for m in METRICS if m.means} == {measure.metric.name for measure in MEASURES.values()}


def test_every_constant_and_every_place_is_a_column_or_a_measure():
    known = {*SCHEMA.names, *MEASURES}
    constants = {
        value for value in vars(columns).values() if isinstance(value, str) and re.fullmatch(r"[a-z_]+", value)
    }
    assert {"draw", "success"} < constants <= known
    assert set(columns.ORDER) <= known and len(set(columns.ORDER)) == len(columns.ORDER)


def test_measures_that_are_asked_for_by_name_exist():
    asked = {
        *power.TARGETS,
        *levels.LEVEL_MEASURES,
        *held_out.HELD_OUT_MEASURES,
        *comparison.MEASURES,
        *shipping.MEASURES,
        *(row.measure for drawing in figures.FIGURES for row in drawing.rows),
        *(term.measure for claim in claims.CLAIMS for part in claim.parts for term in part.terms),
    }
    assert {name.removesuffix(COMMON) for name in asked} <= set(MEASURES)
