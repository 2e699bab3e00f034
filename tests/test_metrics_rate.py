"""How far metrics move when the same motion is logged at another rate; the bounds are those of docs/metrics.md."""

from dataclasses import replace

import numpy as np
import pytest
from episodes import Agent, Pedestrian, build_episode
from hypothesis import given, settings
from hypothesis import strategies as st

from socialnav_mj import metrics
from socialnav_mj.config import Scenario
from socialnav_mj.metrics.social_force import social_force

DURATION, FINE = 8.0, 0.0125
GOAL = np.array([20.0, 0.0])
MARGIN = 1.05
"""The maxima that the bounds take are read off the fine log."""


class Motion:
    """x = u t + a sin(w t + p), y = y0 + b sin(v t + q), with all derivatives."""

    def __init__(self, speed, amplitude, frequency, phase, offset=(0.0, 0.0)):
        self.speed, self.offset = np.array(speed), np.array(offset)
        self.amplitude, self.frequency, self.phase = map(np.array, (amplitude, frequency, phase))

    def at(self, t, order=0):
        wave = self.amplitude * self.frequency**order
        wave = wave * np.sin(self.frequency * t[:, None] + self.phase + order * np.pi / 2)
        return wave + (self.offset + self.speed * t[:, None], self.speed, 0.0, 0.0, 0.0)[order]


@st.composite
def motions(draw, forward):
    def value(low, high):
        return draw(st.floats(low, high, allow_subnormal=False))

    return Motion(
        (forward * value(0.6, 1.0), 0.0),
        (value(0, 0.3), value(0, 0.5)),
        (value(0.1, 1.2), value(0.1, 1.5)),
        (value(0, 6), value(0, 6)),
        (0.0, 0.0) if forward > 0 else (8.0, value(-1.0, 1.0)),
    )


def logged(agent, person, dt):
    """The same two walkers, logged every dt, with their true velocities and headings."""
    t = dt * np.arange(round(DURATION / dt) + 1)
    scenario = Scenario(control_timestep=dt, physics_timestep=FINE, turn_limit="per_second")
    episode = build_episode(
        [Agent(positions=agent.at(t), goal=GOAL)], [Pedestrian(positions=person.at(t))], scenario=scenario
    )
    velocity = agent.at(t, 1)
    return replace(
        episode,
        agent_velocity=velocity[:, None],
        agent_heading=np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))[:, None],
        pedestrian_velocity=person.at(t, 1)[:, None],
    )


def largest(vectors):
    return MARGIN * float(np.linalg.norm(vectors, axis=-1).max())


def crossings(values, limit):
    return int(np.count_nonzero(np.diff(values > limit)))


def turn_rate(angles):
    return MARGIN * float(np.abs(np.diff(np.unwrap(angles))).max()) / FINE


@settings(max_examples=30, deadline=None)
@given(agent=motions(1.0), person=motions(-1.0), dt=st.sampled_from([0.1, 0.2, 0.4]))
def test_metrics_are_nearly_the_same_at_another_log_rate(agent, person, dt):
    coarse, fine = (metrics.per_agent(logged(agent, person, step)) for step in (dt, FINE))
    t = FINE * np.arange(round(DURATION / FINE) + 1)
    offset, relative = person.at(t) - agent.at(t), person.at(t, 1) - agent.at(t, 1)
    distance, own = np.linalg.norm(offset, axis=1), np.linalg.norm(agent.at(t, 1), axis=1)
    u, a, j, snap = largest(relative), *(largest(agent.at(t, order)) for order in (2, 3, 4))
    heading = np.arctan2(*agent.at(t, 1).T[::-1])
    to_goal = np.arctan2(*(GOAL - agent.at(t)).T[::-1])
    force = np.linalg.norm(social_force(offset, relative), axis=1)
    share = dt / DURATION
    bounds = {
        "minimum_distance": u * dt / 2,
        "mean_distance": u * dt,
        "intrusion_share": (crossings(distance, 1.2) + 1) * share,
        "space_compliance": (crossings(distance, 0.5) + 1) * share,
        **{
            f"{name}_zone_share": (crossings(distance, low) + crossings(distance, high) + 1) * share
            for name, (low, high) in metrics.ZONES.items()
        },
        "time_not_moving": (crossings(own, 0.1) + 1) * dt,
        "path_length": a**2 * DURATION * dt**2 / (8 * own.min()),
        "maximum_speed": a * dt / 2,
        "mean_acceleration": j * dt,
        "maximum_acceleration": j * dt,
        "mean_jerk": 2 * snap * dt,
        "maximum_jerk": 2 * snap * dt,
        "path_irregularity": 2 * (turn_rate(heading) + turn_rate(to_goal)) * dt,
        "social_work": dt * 2 * MARGIN * np.abs(np.diff(force)).sum(),
    }
    for name, bound in bounds.items():
        difference = abs(float(coarse[name][0] - fine[name][0]))
        # The fine log has its own, smaller error of the same form.
        assert difference <= bound * (1 + FINE / dt) + 1e-9, (name, difference, bound)
    for name in ("completion_time", "time_under_way", "displacement", "success", "spawn_delay"):
        assert coarse[name] == pytest.approx(fine[name]), name


def test_counts_of_steps_scale_with_the_rate():
    straight = Motion((1.0, 0.0), (0.0, 0.0), (1.0, 1.0), (0.0, 0.0))
    person = Motion((0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (0.0, 0.0), (4.05, 0.6))
    slow, fast = (metrics.per_agent(logged(straight, person, dt)) for dt in (0.2, 0.1))
    assert fast["completion_steps"] == 2 * slow["completion_steps"]
    assert fast["intimate_intrusions"] == pytest.approx(2 * slow["intimate_intrusions"], abs=2)
