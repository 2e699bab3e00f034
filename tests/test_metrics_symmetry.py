"""Metrics do not depend on where the map lies, on its orientation and handedness, or on the order of agents."""

from dataclasses import fields, replace

import numpy as np
from declarations import broken
from episodes import Agent, Pedestrian, Touch, build_episode
from hypothesis import given, settings
from hypothesis import strategies as st

from socialnav_mj import metrics
from socialnav_mj.episode import Outcome, Partner
from socialnav_mj.metrics.dialects import DIALECTS, compute

N_STEPS = 30


@st.composite
def casts(draw):
    """Random walks of agents and people, and touches among them."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, m = draw(st.integers(1, 5)), draw(st.integers(0, 4))
    agents = [
        Agent(
            positions=np.cumsum(random.normal(0, 0.2, (random.integers(2, N_STEPS), 2)), axis=0)
            + random.normal(0, 1, 2),
            spawn_step=int(random.integers(3, 8)),
            delay_steps=int(random.integers(0, 3)),
            outcome=Outcome(random.choice([Outcome.ARRIVED, Outcome.TIMED_OUT, Outcome.NEVER_SPAWNED])),
            goal=random.normal(0, 3, 2),
        )
        for _ in range(n)
    ]
    people = [Pedestrian(positions=np.cumsum(random.normal(0, 0.2, (N_STEPS, 2)), axis=0)) for _ in range(m)]
    touches = []
    for i, agent in enumerate(agents):
        for kind, count in ((Partner.PEDESTRIAN, m), (Partner.AGENT, n)):
            partner = int(random.integers(count)) if count else i
            either = kind is Partner.AGENT and agents[partner].outcome is Outcome.NEVER_SPAWNED
            if count and agent.outcome is not Outcome.NEVER_SPAWNED and not either and (kind, partner) != (1, i):
                touches.append(Touch(agent=i, partner=partner, kind=kind, step=float(random.uniform(3, N_STEPS))))
    return agents, people, touches


def build(cast):
    return build_episode(*cast, n_samples=N_STEPS + 10)


def everything(episode):
    """Metrics and dialects; SocNavBench's irregularity is left out, as it does depend on the map's origin."""
    values = metrics.per_agent(episode)
    for dialect in DIALECTS:
        values |= {f"{dialect}.{name}": value for name, value in compute(episode, dialect).items()}
    del values["socnavbench.path_irregularity"]
    return values


def same(a, b):
    moved = everything(b)
    for name, value in everything(a).items():
        np.testing.assert_allclose(moved[name], value, rtol=1e-9, atol=1e-9, err_msg=name)


@settings(max_examples=40, deadline=None)
@given(
    cast=casts(), angle=st.floats(-7, 7), shift=st.tuples(st.floats(-50, 50), st.floats(-50, 50)), flip=st.booleans()
)
def test_metrics_are_invariant_when_the_map_is_rotated_moved_or_mirrored(cast, angle, shift, flip):
    episode = build(cast)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ np.diag([1, -1 if flip else 1])
    points = ("_position", "_start", "_goal")
    moved = {}
    for name in (f.name for f in fields(episode)):
        value = getattr(episode, name)
        if value is None:
            continue
        if name.endswith(points):
            moved[name] = value @ turn.T + shift
        elif name.endswith(("_velocity", "_normal", "_deviation")):
            moved[name] = value @ turn.T
        elif name.endswith("_heading"):
            moved[name] = angle + (-value if flip else value)
        elif name == "agent_wheel_speed" and flip:
            moved[name] = value[..., ::-1].copy()
        elif name == "agent_yaw_rate" and flip:
            moved[name] = -value
    same(episode, replace(episode, **moved))


@settings(max_examples=40, deadline=None)
@given(cast=casts(), random=st.randoms(use_true_random=False))
def test_metrics_follow_the_agents_when_their_order_changes(cast, random):
    agents, people, touches = cast
    order = random.sample(range(len(agents)), len(agents))
    place = np.argsort(order)
    renamed = [
        replace(t, agent=int(place[t.agent]), partner=int(place[t.partner]) if t.kind is Partner.AGENT else t.partner)
        for t in touches
    ]
    before = everything(build((agents, people, touches)))
    after = everything(build(([agents[i] for i in order], people, renamed)))
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value[order], err_msg=name)


@settings(max_examples=40, deadline=None)
@given(cast=casts())
def test_metrics_stay_in_their_ranges_and_keep_their_identities(cast):
    values = metrics.per_agent(build(cast))
    share, ratio = values["intrusion_share"], values["distance_to_displacement"]
    assert np.all(np.isnan(share) | ((share >= 0) & (share <= 1)))
    assert np.array_equal(np.isnan(ratio), np.isnan(values["completion_time"]))
    touched = values["collisions_pedestrian"] + values["collisions_agent"] > 0
    assert np.array_equal(values["success"], values["arrived"] & ~touched)
    assert np.array_equal(values["first_partner"] >= 0, touched)
    assert np.array_equal((values["minimum_distance"] < metrics.INTIMATE_DISTANCE), values["intimate_intrusions"] > 0)
    zones = sum(values[f"{zone}_zone_share"] for zone in metrics.ZONES)
    assert np.array_equal(np.isnan(zones), np.isnan(share)) and np.all(np.isnan(zones) | (np.abs(zones - 1) < 1e-9))
    for kind in ("pedestrian", "agent"):
        faults = sum(values[f"collisions_{kind}_by_{who.name.lower()}"] for who in metrics.Fault)
        assert np.array_equal(faults, values[f"collisions_{kind}"])
    severe = sum(values[f"collisions_{what.name.lower()}"] for what in metrics.Severity)
    assert np.array_equal(severe, values["collisions_pedestrian"])
    assert not np.any(values["mean_distance"] < values["minimum_distance"] - 1e-12)
    assert not np.any(values["time_not_moving"] > values["time_under_way"] + 1e-9)
    assert np.all((values["spl"] >= 0) & (values["spl"] <= values["success"]))
    assert not np.any((values["path_irregularity"] < 0) | (values["path_irregularity"] > np.pi))
    assert not np.any(values["mean_acceleration"] > values["maximum_acceleration"] + 1e-9)
    under_way = values["arrived"].astype(int) + values["completion_censored"] + values["never_spawned"]
    assert np.all(under_way == 1)


@settings(max_examples=40, deadline=None)
@given(cast=casts())
def test_metrics_keep_their_declared_type_range_and_nan_rule(cast):
    episode = build(cast)
    # Some of the touches are with somebody who is not there: no real contact is without velocities.
    velocities = ("contact_agent_velocity", "contact_partner_velocity")
    episode = replace(episode, **{name: np.nan_to_num(getattr(episode, name)) for name in velocities})
    assert [line for metric in metrics.METRICS for line in broken(metric, episode)] == []
