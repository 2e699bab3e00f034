"""Make the embedded recording: a crowd that crosses a square, simulated with JuPedSim (not needed at run time).

    pip install jupedsim==1.4.2
    python data/plaza/make_plaza.py

Everybody walks under JuPedSim's anticipation velocity model (Xu et al. 2021, doi 10.1016/j.trc.2021.103464) from one
gate at the square's edge to another. What the model lacks is added by steering: companions keep side by side, some
people stop on the way, some come in and turn back. The numbers below were chosen so that the summary figures of
README.md come near those of students003; no position or time of that recording went in.
"""

from dataclasses import dataclass, field
from pathlib import Path

import jupedsim
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEED = 1
WIDTH, DEPTH = 15.5, 13.9
"""Of the square [m]."""
DURATION = 216.0
LAST_ENTRY = 210.0
"""[s]."""
N_PAIRS, N_TRIPLES, N_SINGLES = 92, 20, 190
"""434 people, 244 of them in company."""
N_AT_ONCE = 20
"""Groups that are on the square when the recording begins."""
N_PAUSING = 42
"""Groups that stop on the way."""
N_TURNING_BACK = 7
"""Single people who come in, wait, and leave where they came from."""
GATES: tuple[tuple[float, float, float, float], ...] = (
    (0.0, 0.40, 1.4, 4.0),
    (0.0, 0.75, 1.0, 1.5),
    (1.0, 0.45, 1.6, 4.0),
    (1.0, 0.85, 1.0, 1.5),
    (2.0, 0.55, 1.5, 2.2),
    (3.0, 0.35, 1.5, 2.2),
)
"""Edge (0 left, 1 right, 2 bottom, 3 top), place along it as a share, half width [m], weight."""
COMPANION_GAP = 0.57
"""Between neighbours in a group [m]."""
NEAR_GOAL = 4.5
"""Goals lie 2 m outside the square; people nearer than this to theirs leave when they cross the edge [m]."""
LOOK_AHEAD = 1.0
"""People steer for a point this far ahead of their group; the nearer, the stronger they keep together [m]."""
SPEED_MEDIAN, SPEED_SPREAD = 0.98, 0.45
"""Desired speed of single people: log-normal, median [m/s] and sigma."""
GROUP_SPEED = 0.9
"""Companions walk at this share of it."""
RADIUS_RANGE = (0.12, 0.20)
"""Body radius [m]."""
SPAWN_GAP = 0.45
"""Free distance that somebody who enters needs [m]."""

SIMULATION_STEP, STEERING_STEP = 0.01, 0.2
"""[s]."""
FRAME_RATE, FRAMES_PER_POINT = 25, 20
"""Frames a second, and frames between two stored control points."""
METRES_PER_PIXEL = 0.02


@dataclass(eq=False)
class Group:
    """One to three people who enter and leave together."""

    size: int
    entry_time: float
    start: Array
    side: Array
    """Unit vector along which the group lines up when it enters."""
    goal: Array
    speed: float
    stop: Array | None = None
    """Where the group pauses, if it does."""
    pause: float = 0.0
    """How long [s]."""
    agents: list[int] = field(default_factory=list)
    paused_since: float | None = None


def main() -> None:
    """Simulate and write `annotation.vsp` and `H.txt` beside this file."""
    tracks = simulate(np.random.default_rng(SEED))
    write(tracks, Path(__file__).resolve().parent)


def simulate(random: np.random.Generator) -> list[list[tuple[int, float, float]]]:
    """Tracks as (frame, x, y) in metres, in order of appearance."""
    margin = 4.0
    corners = [
        (-margin, -margin),
        (WIDTH + margin, -margin),
        (WIDTH + margin, DEPTH + margin),
        (-margin, DEPTH + margin),
    ]
    simulation = jupedsim.Simulation(
        model=jupedsim.AnticipationVelocityModel(rng_seed=SEED), geometry=corners, dt=SIMULATION_STEP
    )
    stage = simulation.add_direct_steering_stage()
    journey = simulation.add_journey(jupedsim.JourneyDescription([stage]))
    waiting = sorted(make_groups(random), key=lambda group: group.entry_time)
    inside: list[Group] = []
    tracks: dict[int, list[tuple[int, float, float]]] = {}
    steps_per_frame = round(1.0 / FRAME_RATE / SIMULATION_STEP)
    for frame in range(int(DURATION * FRAME_RATE) + 1):
        time = frame / FRAME_RATE
        if frame % round(STEERING_STEP * FRAME_RATE) == 0:
            for group in [group for group in waiting if group.entry_time <= time]:
                if enter(simulation, journey, stage, group, random):
                    waiting.remove(group)
                    inside.append(group)
            for group in inside:
                steer(simulation, group, time)
        for group in inside:
            for agent_id in list(group.agents):
                x, y = simulation.agent(agent_id).position
                tracks.setdefault(agent_id, []).append((frame, x, y))
                outside = not (0.0 <= x <= WIDTH and 0.0 <= y <= DEPTH)
                if outside and np.hypot(*(group.goal - (x, y))) < NEAR_GOAL:
                    group.agents.remove(agent_id)
                    simulation.mark_agent_for_removal(agent_id)
        inside = [group for group in inside if group.agents]
        simulation.iterate(steps_per_frame)
    if waiting:
        raise RuntimeError(f"{len(waiting)} groups found no place to enter")
    return list(tracks.values())


def make_groups(random: np.random.Generator) -> list[Group]:
    """Draw who enters when, from where to where and how fast."""
    sizes = random.permutation([2] * N_PAIRS + [3] * N_TRIPLES + [1] * N_SINGLES)
    early = set(random.choice(len(sizes), N_AT_ONCE, replace=False).tolist())
    pausing = set(random.choice(len(sizes), N_PAUSING, replace=False).tolist())
    singles = [i for i in np.flatnonzero(sizes == 1) if i not in pausing and i not in early]
    turning_back = set(random.choice(singles, N_TURNING_BACK, replace=False).tolist())
    centre = np.array([WIDTH, DEPTH]) / 2.0
    groups = []
    for i, size in enumerate(sizes.tolist()):
        origin, target = draw_gates(random)
        start, goal = point_in_gate(random, origin, -0.1), point_in_gate(random, target, 2.0)
        side = np.array([0.0, 1.0] if GATES[origin][0] < 2 else [1.0, 0.0])
        if (frame_of(goal - start)[1] @ side) < 0.0:
            side = -side
        speed = SPEED_MEDIAN * float(np.exp(SPEED_SPREAD * random.normal())) * (GROUP_SPEED if size > 1 else 1.0)
        group = Group(
            size,
            float(random.uniform(0.0, LAST_ENTRY)),
            start,
            side,
            goal,
            float(np.clip(speed, 0.25, 1.2 if size > 1 else 1.9)),
        )
        if i in early:
            group.entry_time = 0.0
            group.start = start + random.uniform(0.05, 0.8) * (goal - start) * 0.8
        if i in pausing:
            group.stop = start + random.uniform(0.2, 0.7) * (goal - start) + random.normal(scale=1.0, size=2)
            group.stop = np.clip(group.stop, 1.0, np.array([WIDTH, DEPTH]) - 1.0)
            group.pause = float(np.clip(random.exponential(12.0), 3.0, 45.0))
        if i in turning_back:
            inward = (centre - start) / np.linalg.norm(centre - start)
            group.stop, group.pause = start + 1.5 * inward, float(random.uniform(8.0, 20.0))
            group.goal = start - 2.0 * inward
        groups.append(group)
    return groups


def draw_gates(random: np.random.Generator) -> tuple[int, int]:
    """An entrance and an exit at different edges."""
    weight = np.array([gate[3] for gate in GATES])
    origin = int(random.choice(len(GATES), p=weight / weight.sum()))
    weight[[gate[0] == GATES[origin][0] for gate in GATES]] = 0.0
    return origin, int(random.choice(len(GATES), p=weight / weight.sum()))


def point_in_gate(random: np.random.Generator, gate: int, outside: float) -> Array:
    """A point of a gate, moved outside the square by a distance [m] (inside, if negative)."""
    edge, share, half_width, _ = GATES[gate]
    length = DEPTH if edge < 2 else WIDTH
    along = float(np.clip(share * length + random.uniform(-half_width, half_width), 0.8, length - 0.8))
    across = -outside if edge in (0, 2) else (WIDTH if edge == 1 else DEPTH) + outside
    return np.array([across, along] if edge < 2 else [along, across])


def enter(simulation: jupedsim.Simulation, journey: int, stage: int, group: Group, random: np.random.Generator) -> bool:
    """Put a group on the square if all its places are free."""
    direction, _ = frame_of(group.goal - group.start)
    places = [group.start + offset * group.side for offset in offsets(group.size)]
    others = np.array([agent.position for agent in simulation.agents()]).reshape(-1, 2)
    for place in places:
        if len(others) and np.linalg.norm(others - place, axis=1).min() < SPAWN_GAP:
            return False
    for place in places:
        parameters = jupedsim.AnticipationVelocityModelAgentParameters(
            position=(float(place[0]), float(place[1])),
            desired_speed=group.speed,
            radius=float(random.uniform(*RADIUS_RANGE)),
            time_gap=0.4,
            journey_id=journey,
            stage_id=stage,
        )
        agent_id = simulation.add_agent(parameters)
        target = place + 2.0 * direction
        simulation.agent(agent_id).target = (float(target[0]), float(target[1]))
        group.agents.append(agent_id)
    return True


def steer(simulation: jupedsim.Simulation, group: Group, time: float) -> None:
    """Targets and speeds: towards the goal or the stop, side by side, halting during the pause."""
    agents = [simulation.agent(agent_id) for agent_id in group.agents]
    positions = np.array([agent.position for agent in agents])
    centre = positions.mean(axis=0)
    aim = group.goal
    if group.stop is not None:
        aim = group.stop
        if group.paused_since is None and np.linalg.norm(centre - group.stop) < 0.6:
            group.paused_since = time
        if group.paused_since is not None and time - group.paused_since > group.pause:
            group.stop = None
    halting = group.stop is not None and group.paused_since is not None
    direction, left = frame_of(aim - centre)
    reach = min(LOOK_AHEAD, float(np.linalg.norm(aim - centre)))
    for agent, position, offset in zip(agents, positions, offsets(len(agents)), strict=True):
        lag = float((centre - position) @ direction)
        target = centre + reach * direction + offset * left
        if np.linalg.norm(group.goal - position) > NEAR_GOAL:
            target = np.clip(target, 0.3, np.array([WIDTH, DEPTH]) - 0.3)
        agent.target = (float(target[0]), float(target[1]))
        agent.model.desired_speed = 0.0 if halting else group.speed * float(np.clip(1.0 + 1.2 * lag, 0.3, 1.6))


def frame_of(vector: Array) -> tuple[Array, Array]:
    """Unit vectors along a vector and to its left."""
    ahead = vector / max(float(np.linalg.norm(vector)), 1e-9)
    return ahead, np.array([-ahead[1], ahead[0]])


def offsets(size: int) -> list[float]:
    """Places of a group's people to the left of its centre [m]."""
    return [COMPANION_GAP * (k - (size - 1) / 2.0) for k in range(size)]


def write(tracks: list[list[tuple[int, float, float]]], folder: Path) -> None:
    """Write control points in pixels from the centre, and the scale back to metres."""
    lines = [f"{len(tracks)} - the number of splines"]
    for track in tracks:
        last = len(track) - 1
        points = [track[k] for k in range(0, last, FRAMES_PER_POINT)]
        if len(points) > 1 and track[last][0] - points[-1][0] < FRAMES_PER_POINT // 2:
            points.pop()
        points.append(track[last])
        lines.append(f"{len(points)} - Num of control points")
        for frame, x, y in points:
            px, py = (x - WIDTH / 2.0) / METRES_PER_PIXEL, (y - DEPTH / 2.0) / METRES_PER_PIXEL
            lines.append(f"{px:.1f} {py:.1f} {frame} 0")
    (folder / "annotation.vsp").write_text("\n".join(lines) + "\n", encoding="ascii")
    scale = f"{METRES_PER_PIXEL} 0 {WIDTH / 2.0}\n0 {METRES_PER_PIXEL} {DEPTH / 2.0}\n0 0 1\n"
    (folder / "H.txt").write_text(scale, encoding="ascii")


if __name__ == "__main__":
    main()
