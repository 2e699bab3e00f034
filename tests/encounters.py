"""Five constructed encounters, and what every metric is for them, worked out by hand and by scalar sums.

All run for 8 s or 5 s at 0.2 s a step, along the x axis, with the default radii (0.17 + 0.15 = 0.32 m). `hand` uses
plain `math` on the positions written down here and none of the package's metrics.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj.episode import Episode, Outcome

DT, CONTACT = 0.2, 0.32
GOAL = (8.5, 0.0)
INF, NAN = math.inf, math.nan


@dataclass(frozen=True)
class Encounter:
    """One agent among few people."""

    episode: Episode
    where: Callable[[int], tuple[float, float, float]]
    """Step -> the agent's x, and the offset of the nearest person."""
    steps: int
    hand: dict[str, float] = field(default_factory=dict)
    """Values of the metrics that are not those of `ORDINARY`."""

    def nearest(self) -> list[float]:
        return [math.hypot(*self.where(k)[1:]) for k in range(self.steps)]


def encounters() -> dict[str, Encounter]:
    """By name, in the order of the columns of docs/metrics.md."""
    run = line((0, 0), (8, 0), 40)
    stop_and_go = np.concatenate([line((0, 0), (3, 0), 15), np.tile((3, 0), (10, 1)), line((3, 0), (8, 0), 25)[1:]])
    group = [Pedestrian(positions=np.tile((4, y), (41, 1))) for y in (0.9, 1.7, 2.5)]
    walk_in = [Pedestrian(positions=line((4.1, 0), (-0.9, 0), 25))]
    stand = Agent(positions=np.zeros((26, 2)), goal=(5, 0), outcome=Outcome.TIMED_OUT)
    touch = Touch(agent=0, partner=0, step=18.9, duration=0.3, impact_impulse=8.0, impact_force=180.0, push_impulse=6.0)

    def waiting(k: int) -> float:
        return 0.2 * k if k <= 15 else 3.0 if k <= 25 else 3.0 + 0.2 * (k - 25)

    return {
        "head-on pass": Encounter(
            episode=build_episode(
                [Agent(positions=run, goal=GOAL)], [Pedestrian(positions=line((8, 0.6), (0, 0.6), 40))]
            ),
            where=lambda k: (0.2 * k, 8.0 - 0.4 * k, 0.6),
            steps=40,
            hand={
                "minimum_distance": 0.6,  # abreast at step 20
                "intimate_intrusions": 5,  # |8 - 0.4 k| < sqrt(1.2^2 - 0.6^2) = 1.039: steps 18 to 22
                "minimum_time_to_collision": INF,  # 0.6 m aside is more than 0.32 m
            },
        ),
        "overtaking": Encounter(
            episode=build_episode(
                [Agent(positions=run, goal=GOAL)], [Pedestrian(positions=line((2, 0.8), (6, 0.8), 40))]
            ),
            where=lambda k: (0.2 * k, 2.0 - 0.1 * k, 0.8),
            steps=40,
            hand={
                "minimum_distance": 0.8,  # abreast at step 20
                "intimate_intrusions": 17,  # |2 - 0.1 k| < sqrt(1.2^2 - 0.8^2) = 0.894: steps 12 to 28
                "minimum_time_to_collision": INF,
            },
        ),
        "crossing": Encounter(
            episode=build_episode(
                [Agent(positions=stop_and_go, goal=GOAL)], [Pedestrian(positions=line((4, -4), (4, 6), 50))]
            ),
            where=lambda k: (waiting(k), 4.0 - waiting(k), 0.2 * k - 4.0),
            steps=50,
            hand={
                "minimum_distance": 1.0,  # the person passes at x = 4 while the agent waits at x = 3
                # Waiting, sqrt(1 + (0.2 k - 4)^2) < 1.2: |0.2 k - 4| < 0.663, steps 17 to 23.
                "intimate_intrusions": 7,
                # Both towards (4, 0) at 1 m/s: (sqrt(2) (4 - t) - 0.32) / sqrt(2), last at t = 2.8 s.
                "minimum_time_to_collision": 1.2 - 0.32 / math.sqrt(2.0),
                "completion_time": 10.0,
                "completion_steps": 50,
                "time_under_way": 10.0,
                "active_steps": 50,
                "average_speed": 0.8,
                "time_not_moving": 2.0,  # 10 steps
                "mean_acceleration": 2 * 5.0 / 50,  # from 1 to 0 m/s within a step, and back, in 50 differences
                "maximum_acceleration": 5.0,
                "mean_jerk": 4 * 25.0 / 49,  # each change is +-1 m/s in two of 49 second differences
                "maximum_jerk": 25.0,
                "unmet_share": 2 / 50,  # velocities are forward differences: a step early at the stop and at the start
            },
        ),
        "standing group": Encounter(
            episode=build_episode([Agent(positions=run, goal=GOAL)], group),
            where=lambda k: (0.2 * k, 4.0 - 0.2 * k, 0.9),
            steps=40,
            hand={
                "minimum_distance": 0.9,  # abreast of the first at step 20
                "intimate_intrusions": 7,  # |4 - 0.2 k| < sqrt(1.2^2 - 0.9^2) = 0.794: steps 17 to 23
                "minimum_time_to_collision": INF,
            },
        ),
        "walked into": Encounter(
            episode=build_episode([stand], walk_in, [touch]),
            where=lambda k: (0.0, 4.1 - 0.2 * k, 0.0),
            steps=25,
            hand={
                "success": 0,
                "success_if_ghosts_count": 0,
                "arrived": 0,
                "timed_out": 1,
                "completion_time": NAN,
                "completion_steps": NAN,
                "time_under_way": 5.0,
                "completion_censored": 1,
                "active_steps": 25,
                "displacement": 5.0,
                "path_length": 0.0,
                "distance_to_displacement": NAN,
                "spl": 0.0,
                "average_speed": 0.0,
                "maximum_speed": 0.0,
                "time_not_moving": 5.0,
                "minimum_distance": 0.1,  # the person walks through it between steps 20 and 21
                "intimate_intrusions": 10,  # |4.1 - 0.2 k| < 1.2: steps 15 to 24
                "minimum_time_to_collision": 0.0,  # 0.18 s at step 18, overlapping at step 19
                "collisions_pedestrian": 1,
                "collisions_pedestrian_by_partner": 1,
                "collisions_under_transient": 1,  # 180 N for 0.3 s
                "first_partner": 0,
                "struck_standing": 1,
                "largest_closing_speed": 1.0,
                "largest_impact_force": 180.0,
                "largest_impact_impulse": 8.0,
                "push_duration": 0.2,  # 0.3 s less the 0.1 s of the impact
                "push_impulse": 6.0,
                "largest_held_back": 0.0,
            },
        ),
    }


ORDINARY: dict[str, float] = {
    "success": 1,
    "success_if_ghosts_count": 1,
    "ghost_overlaps": 0,
    "arrived": 1,
    "timed_out": 0,
    "overturned": 0,
    "never_spawned": 0,
    "completion_time": 8.0,
    "completion_steps": 40,
    "time_under_way": 8.0,
    "completion_censored": 0,
    "active_steps": 40,
    "displacement": 8.5,
    "path_length": 8.0,
    "distance_to_displacement": 8.0 / 8.5,
    "spl": 1.0,
    "path_irregularity": 0.0,
    "failures_to_progress": 0,
    "average_speed": 1.0,
    "maximum_speed": 1.0,
    "maximum_tilt": 0.0,
    "mean_acceleration": 0.0,
    "maximum_acceleration": 0.0,
    "mean_jerk": 0.0,
    "maximum_jerk": 0.0,
    "time_not_moving": 0.0,
    "collisions_pedestrian": 0,
    "collisions_agent": 0,
    **{f"collisions_{k}_by_{w}": 0 for k in ("pedestrian", "agent") for w in ("agent", "partner", "both", "neither")},
    **{f"collisions_{name}": 0 for name in ("under_quasi_static", "under_transient", "over", "clamped")},
    "first_partner": -1,
    "wedged_collisions": 0,
    "repeated_collisions": 0,
    "struck_standing": 0,
    "largest_closing_speed": NAN,
    "largest_impact_force": NAN,
    "largest_impact_impulse": NAN,
    "push_duration": 0.0,
    "push_impulse": 0.0,
    "shoved_standing": 0,
    "time_shoved_standing": 0.0,
    "largest_held_back": NAN,
    "spawn_delay": 0.0,
    "deviation_imposed": 0.0,
    "delay_imposed": 0.0,
    "tracking_error": 0.0,
    "unmet_share": 0.0,
    "side_slip": 0.0,
    "stopping_distance": NAN,
}
"""Of an agent that drives 8 m straight at 1 m/s to within 0.5 m of its goal and touches nobody."""


def hand_values(name: str, encounter: Encounter) -> dict[str, float]:
    """Every metric of an encounter, from `ORDINARY`, its own list, and scalar sums over its steps."""
    near, n = encounter.nearest(), encounter.steps
    own = encounter.hand
    sums = {
        "intrusion_share": own["intimate_intrusions"] / n,
        "mean_distance": sum(near) / n,
        "intimate_zone_share": sum(d < 0.45 for d in near) / n,
        "personal_zone_share": sum(0.45 <= d < 1.2 for d in near) / n,
        "social_zone_share": sum(1.2 <= d < 3.6 for d in near) / n,
        "public_zone_share": sum(d >= 3.6 for d in near) / n,
        "space_compliance": sum(d >= 0.5 for d in near) / n,
        "social_work": social_work(name, encounter),
        "braking_imposed": braking_imposed(encounter),
    }
    return {**ORDINARY, **sums, **own}


def braking_imposed(encounter: Encounter) -> int:
    """Pair by pair with complex numbers; whether discs meet within 4 s is tried every millisecond."""
    episode, count = encounter.episode, 0
    for k in range(encounter.steps):
        p, v = complex(*episode.agent_position[k, 0]), complex(*episode.agent_velocity[k, 0])
        hard = False
        for j in range(episode.n_pedestrians):
            q, w = complex(*episode.pedestrian_position[k, j]), complex(*episode.pedestrian_velocity[k, j])
            gap, e = abs(q - p) - 0.32, (p - q) / abs(q - p)
            if min(abs(q - p + (w - v) * t / 1000.0) for t in range(4001)) > 0.32:
                continue
            towards = max(0.0, min((w * e.conjugate()).real, ((w - v) * e.conjugate()).real))
            hard |= towards > 0.0 if gap <= 0.0 else towards**2 / (2.0 * gap) > 1.0
        count += hard
    return count


def social_work(name: str, encounter: Encounter) -> float:
    """Moussaid's forces, pair by pair with complex numbers, summed over the steps."""
    episode, total = encounter.episode, 0.0
    for k in range(encounter.steps):
        forces = []
        p, v = complex(*episode.agent_position[k, 0]), complex(*episode.agent_velocity[k, 0])
        for j in range(episode.n_pedestrians):
            q, w = complex(*episode.pedestrian_position[k, j]), complex(*episode.pedestrian_velocity[k, j])
            e = (q - p) / abs(q - p)
            interaction = 2.0 * (v - w) + e
            t = interaction / abs(interaction)
            theta = math.atan2((t / e).imag, (t / e).real)
            b = 0.35 * abs(interaction)
            side = 0.0 if abs(math.sin(theta)) < 1e-9 else math.copysign(1.0, theta)
            brake = math.exp(-abs(q - p) / b - (3.0 * b * theta) ** 2)
            turn = math.exp(-abs(q - p) / b - (2.0 * b * theta) ** 2)
            forces.append(-2.1 * (brake * t + side * turn * 1j * t))
        total += abs(sum(forces)) + sum(abs(f) for f in forces)
    return DT * total
