"""Wild episodes: crowds that no recording has, controllers that nobody would use, and what must never break.

`python -m tests.wild --episodes 1000 --seed 0 --jobs 2` runs them with progress and prints a summary; episode k of a
seed is always the same, and `--episodes 1 --seed K` repeats the one that a failure names.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from socialnav_mj.cast import NOBODY
from socialnav_mj.config import MIN_CONTACT_DISTANCE, PEDESTRIAN_RADII, ROBOT_RADII, Robot, Scenario
from socialnav_mj.contact import FORCE_COLUMNS
from socialnav_mj.controllers import Controller, GoStraight, Limits, PotentialField
from socialnav_mj.environment import Environment, build_environment
from socialnav_mj.episode import Episode, Outcome
from socialnav_mj.geometry import Array
from socialnav_mj.metrics import per_agent
from socialnav_mj.metrics.severity import wedged
from socialnav_mj.outcome import OVERTURNED_TILT
from socialnav_mj.physics import Physics
from socialnav_mj.processes import in_processes
from socialnav_mj.recordings import Recording
from socialnav_mj.rollout import rollout

FRAME = 0.04
"""Between two frames of the recordings [s]."""
FASTEST = 3.0
"""People run at most this fast, unless they teleport [m/s]."""
TIME_CONSTANT, IMPEDANCE, FRICTION = 0.05, 0.95, 0.3
"""Of the contacts of bodies: critically damped (assets/robot.xml) [s], and MuJoCo's default of how hard, 0 to 1 [-]."""
STIFFNESS, DAMPING = 1.0 / (IMPEDANCE * TIME_CONSTANT) ** 2, 2.0 / (IMPEDANCE * TIME_CONSTANT)
"""A contact of depth d asks for a normal acceleration STIFFNESS d - DAMPING v (documentation, 'solver parameters')."""
REPEATED = 4
"""One of so many episodes is run once more, which has to give the same states."""
BUMPER_HEIGHT = 0.1
"""Of the bumper's centre above the robot's origin (assets/robot.xml) [m]."""


# Crowds

Track = tuple[Array, Array]
"""Times (k,) [s] and positions (k, 2) [m]."""


def _times(random: np.random.Generator) -> Array:
    begin, duration = random.uniform(0.0, 5.0), random.uniform(2.0, 12.0)
    return np.round(begin / FRAME) * FRAME + FRAME * np.arange(max(2, int(duration / FRAME)))


def _crossing(random: np.random.Generator, side: float, speed: float | None = None) -> Track:
    angle, turn = random.uniform(0.0, 2.0 * np.pi), random.uniform(2.0, 4.3)
    ends = 0.5 * side * np.stack([[np.cos(a), np.sin(a)] for a in (angle, angle + turn)])
    speed = speed or random.uniform(0.2, 1.8)
    length = float(np.linalg.norm(ends[1] - ends[0]))
    count = max(2, int(length / speed / FRAME))
    times = np.round(random.uniform(0.0, 6.0) / FRAME) * FRAME + FRAME * np.arange(count)
    return times, ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])


def _running(random: np.random.Generator, side: float) -> Track:
    return _crossing(random, side, FASTEST)


def _standing(random: np.random.Generator, side: float) -> Track:
    times = _times(random)
    return times, np.tile(random.uniform(-0.5 * side, 0.5 * side, 2), (len(times), 1))


def _milling(random: np.random.Generator, side: float) -> Track:
    """Dense: wander about the middle at up to walking speed."""
    times = _times(random)
    speed = random.uniform(0.2, 1.4)
    heading = np.cumsum(random.normal(0.0, 0.3, len(times)))
    way = np.cumsum(speed * FRAME * np.stack([np.cos(heading), np.sin(heading)], axis=-1), axis=0)
    reach = 0.25 * side
    return times, np.abs((way + random.uniform(-reach, reach, 2)) % (4.0 * reach) - 2.0 * reach) - reach


def _teleporting(random: np.random.Generator, side: float) -> Track:
    """Jump to another place within a frame, again and again."""
    times = _times(random)
    places = random.uniform(-0.5 * side, 0.5 * side, (len(times) // random.integers(10, 60) + 1, 2))
    return times, np.repeat(places, -(-len(times) // len(places)), axis=0)[: len(times)]


def _shuttling(random: np.random.Generator, side: float) -> Track:
    """Back and forth on a short line, with full turns."""
    times = _times(random)
    direction = random.normal(size=2)
    reach, period = random.uniform(0.1, 0.8), random.uniform(0.8, 4.0)
    swing = np.minimum(reach, 0.25 * FASTEST * period) * np.abs(4.0 * ((times / period) % 1.0) - 2.0)
    return times, random.uniform(-0.4 * side, 0.4 * side, 2) + swing[:, None] * direction / np.linalg.norm(direction)


KINDS: tuple[Callable[[np.random.Generator, float], Track], ...] = (
    _crossing,
    _running,
    _standing,
    _milling,
    _teleporting,
    _shuttling,
)
"""Ways to move."""


def wild_recording(random: np.random.Generator) -> Recording:
    """A crowd of people of several kinds in a small place; one at least crosses it, so that there is an agent."""
    side, count = random.uniform(2.0, 8.0), int(random.integers(2, 31))
    weights = random.dirichlet(np.full(len(KINDS), 0.5))
    kinds = [_crossing, *(KINDS[k] for k in random.choice(len(KINDS), count - 1, p=weights))]
    tracks = [kind(random, side) for kind in kinds]
    return Recording(
        name="wild",
        variant="made",
        frame_rate=1.0 / FRAME,
        ids=np.arange(count),
        times=tuple(times for times, _ in tracks),
        positions=tuple(positions for _, positions in tracks),
        checksum="0" * 64,
    )


def wild_scenario(random: np.random.Generator) -> Scenario:
    """Any setting that the configuration allows and that changes what happens."""
    share, seed = float(random.choice([0.1, 0.3, 0.7, 0.9, 1.0])), int(random.integers(1000))
    robot = Robot(radius=float(random.choice([0.17, random.uniform(*ROBOT_RADII)])))
    person = float(random.choice([0.15, random.uniform(*PEDESTRIAN_RADII)]))
    return Scenario(
        share=share,
        seed=seed,
        robot=robot,
        pedestrian_radius=max(person, MIN_CONTACT_DISTANCE - robot.radius),
        turn_limit=str(random.choice(["per_step", "per_second"])),
        on_collision=str(random.choice(["continue", "continue", "retire"])),
        control_timestep=float(random.choice([0.1, 0.2, 0.4])),
    )


# Controllers


class Wheels:
    """Wheel speeds that see nothing: "random" at every step, or "full" speed ahead."""

    def __init__(self, name: str) -> None:
        self.name = name

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Begin an episode."""
        self._limits, self._random = limits, np.random.default_rng(seed)

    def act(self, observation: dict[str, Array]) -> Array:
        """Commands, up to three times of what the limits allow."""
        shape, fastest = (len(observation["active"]), 2), self._limits.max_speed / self._limits.wheel_radius
        return np.full(shape, fastest) if self.name == "full" else self._random.uniform(-3.0, 3.0, shape) * fastest


def wild_controller(random: np.random.Generator) -> Controller:
    """Blind, straight or repelled."""
    return [Wheels("random"), Wheels("full"), GoStraight(), PotentialField()][random.integers(4)]


# What is seen


class WatchedPhysics(Physics):
    """The same physics, looked at after every physics step."""

    def watch(self, task) -> None:
        """Say whose bodies are looked at; forget what was seen."""
        self._task, scenario = task, task.scenario
        self.speed = self.thrown_speed = self.tilt = 0.0
        self.tunnels = self.squeezed_tunnels = self.lost_slots = 0
        reach = np.full(self.n_agents + self.n_pedestrians, 2.0 * scenario.robot.radius)
        reach[self.n_agents :] = scenario.contact_distance
        shape = (self.n_agents, len(reach))
        self._reach = np.broadcast_to(reach, shape)
        self._offset = np.full((*shape, 2), np.inf)
        self._entry, self._nearest = np.full((*shape, 2), np.nan), np.full(shape, np.inf)
        self._overlap = np.zeros(shape, dtype=bool)
        self._held_back = np.zeros(shape, dtype=bool)
        self._people_before = np.full((self.n_pedestrians, 2), np.nan)
        self._thrown = np.zeros(self.n_agents, dtype=bool)
        self._slow = max(FASTEST, scenario.robot.max_speed)

    def step(self, nstep: int = 1) -> None:
        """Step one by one."""
        path, velocity, walk = self._path
        for k in range(nstep):
            if path is not None:
                self.set_pedestrian_path(
                    path[k : k + 1], velocity[k : k + 1], None if walk is None else walk[k : k + 2]
                )
            super().step(1)
            self._look()

    def _look(self) -> None:
        robots = self._task.slot_agent != NOBODY
        self.lost_slots += not np.array_equal(self.data.qpos[self._index.qpos + 2] > -5.0, robots)
        squeezed = self._touched(robots)
        speed = np.where(robots, np.linalg.norm(self._bumper_velocity(), axis=1), 0.0)
        # Whoever was between two bodies counts as thrown by them until it has slowed down.
        self._thrown = (self._thrown | squeezed) & robots & (squeezed | (speed > self._slow))
        self.speed = max(self.speed, np.max(speed[~self._thrown], initial=0.0))
        self.thrown_speed = max(self.thrown_speed, np.max(speed[self._thrown], initial=0.0))
        self.tilt = max(self.tilt, np.max(self.agent_tilt()[robots], initial=0.0))

    def _bumper_velocity(self) -> Array:
        """Of the bumpers' centres, which is where bodies push; the floor below swings under a robot that rocks."""
        vx, vy, _, turn_x, turn_y, _ = self.data.qvel[self._index.qvel[:, None] + np.arange(6)].T
        w, x, y, z = self._agent_quaternion().T
        ahead, left = BUMPER_HEIGHT * turn_y, -BUMPER_HEIGHT * turn_x  # turns are about the robot's own axes
        return np.stack(
            [
                vx + (1.0 - 2.0 * (y * y + z * z)) * ahead + 2.0 * (x * y - w * z) * left,
                vy + 2.0 * (x * y + w * z) * ahead + (1.0 - 2.0 * (x * x + z * z)) * left,
            ],
            axis=-1,
        )

    def _touched(self, robots: Array) -> Array:
        """Count bodies that went through a robot: began to overlap on one side, came near its centre, ended beyond.

        Not held to it until the two are apart again: whoever jumps by a quarter of both radii in a physics step, and
        people faster than a contact can stop (`stopped_speed`). Robots that another body touches at the same time, so
        that they cannot give way, are counted apart.

        Returns:
            Which robots touch two bodies at once, or did so before this step; shape (n_agents,).
        """
        solid = np.concatenate([robots, self.model.geom_contype[self._index.pedestrian_geom] > 0])
        at, people = self.agent_position(), self.pedestrian_position()
        offset = np.concatenate([at, people]) - at[:, None]
        distance = np.linalg.norm(offset, axis=-1)
        overlap = robots[:, None] & solid & (distance < self._reach)
        np.fill_diagonal(overlap, False)
        timestep = self.model.opt.timestep
        begun, loose = overlap & ~self._overlap, np.linalg.norm(offset - self._offset, axis=-1) > 0.25 * self._reach
        walking = np.linalg.norm(people - self._people_before, axis=1) / timestep
        loose[:, self.n_agents :] |= walking > stopped_speed(self._task.scenario.contact_distance, timestep)
        squeezed = (overlap.sum(axis=1) > 1) | (self._overlap.sum(axis=1) > 1)
        self._held_back |= squeezed[:, None]
        self._held_back &= overlap
        self._entry[begun], self._nearest[begun] = offset[begun], np.inf
        self._entry[loose | ~overlap] = np.nan
        self._nearest = np.minimum(self._nearest, distance)
        through = (np.einsum("ijd,ijd->ij", self._entry, offset) < 0.0) & (self._nearest < 0.3 * self._reach)
        self.tunnels += int((through & ~self._held_back).sum())
        self.squeezed_tunnels += int((through & self._held_back).sum())
        self._entry[through] = np.nan
        self._offset, self._overlap, self._people_before = offset, overlap, people
        return squeezed


@dataclass(kw_only=True)
class Run:
    """One wild episode and what was seen of it."""

    seed: int
    label: str
    episode: Episode
    speed: float
    """Fastest robot at any physics step, but for those that two bodies threw [m/s]."""
    thrown_speed: float
    """Fastest robot that two bodies threw, which touched it at once [m/s]."""
    tilt: float
    """Largest tilt of a robot at any physics step [rad]."""
    tunnels: int
    """Bodies that went through a robot that nobody else touched."""
    squeezed_tunnels: int
    """Bodies that went through a robot that touched another body as well."""
    lost_slots: int
    """Physics steps at which the robots in the scene were not those under way."""
    scenario: Scenario
    """What was set."""
    n_people: int
    """In the recording."""
    broken: list[str] = field(default_factory=list)
    """What broke."""


def stopped_speed(distance: float, timestep: float) -> float:
    """A person at this speed does not get through a robot that stands in the way [m/s].

    A mocap body has no velocity for the solver. So at speed u it sinks in until the robot is pushed at u: by
    DAMPING u / STIFFNESS, and u timestep more, as contacts are found before a step; and as deep as it takes to push
    wheels over the floor that stand (friction 0.8).
    """
    return (distance - 0.8 * 9.81 / STIFFNESS) / (DAMPING / STIFFNESS + timestep)


def _reach(scenario: Scenario) -> float:
    """Deepest overlap of a robot with a body [m]."""
    return scenario.robot.radius + max(scenario.robot.radius, scenario.pedestrian_radius)


def speed_bound(scenario: Scenario) -> float:
    """No robot is faster: pushed by the fastest person, or driving, and thrown out of the deepest overlap [m/s].

    A contact is a critically damped spring of rate w = sqrt(STIFFNESS): from depth d at rest the fastest is d w / e.
    """
    return max(FASTEST, scenario.robot.max_speed) + _reach(scenario) * np.sqrt(STIFFNESS) / np.e


def thrown_bound(scenario: Scenario) -> float:
    """No robot is faster that two bodies touch at once: as `speed_bound`, but thrown out from between them [m/s]."""
    return max(FASTEST, scenario.robot.max_speed) + _reach(scenario) * thrown_out(scenario.physics_timestep)


@lru_cache
def thrown_out(timestep: float) -> float:
    """Speed at which two bodies throw a robot out that overlaps both, for each metre of the radii's sum [1/s].

    The robot is at x between bodies at (0, a) and (0, -a); with s^2 = a^2 + x^2 both are d = 1 - s deep inside, and the
    normals make an angle of sin p = x / s with the line between the bodies. Sliding friction turns the pushes against
    the motion, so that each has the component e = (sin p - FRICTION cos p) along x. The solver wants STIFFNESS d -
    DAMPING e v along each push, and so gives the push f, in the solver's soft compromise with its inertia:

        f (2 e^2 + r) = STIFFNESS d - DAMPING e v,  x'' = 2 e f,  r = 2 FRICTION^2 (1 + FRICTION^2) (1/IMPEDANCE - 1)

    (documentation, 'Computation'; r of a pyramidal cone). The largest x' of all places is what is returned, with the
    steps that physics makes: the nearer the pushes are to opposed, the less stops the robot, up to one step of
    STIFFNESS d / sqrt(2 r), which decides at 0.01 s: 29.6 1/s, in small steps 15.6, and of one body 7.7.
    """
    a, x = np.meshgrid(np.linspace(0.01, 0.99, 99), np.linspace(0.0, 0.95, 191))
    softness = 2.0 * FRICTION**2 * (1.0 + FRICTION**2) * (1.0 / IMPEDANCE - 1.0)
    velocity, fastest = np.zeros_like(x), 0.0
    for _ in range(int(6.0 * TIME_CONSTANT / timestep)):
        s = np.hypot(a, x)
        e = (x - FRICTION * a) / s
        f = np.maximum(STIFFNESS * (1.0 - s) - DAMPING * e * velocity, 0.0) / (2.0 * e**2 + softness)
        velocity = velocity + timestep * 2.0 * e * np.where(s < 1.0, f, 0.0)
        x = x + timestep * velocity
        fastest = max(fastest, float(velocity.max()))
    return fastest


def run_wild(seed: int, *, pedestrian_body: str = "rigid") -> Run:
    """Make and run one wild episode, every fourth one twice, and hold it to the rules.

    Args:
        seed: Of everything in it.
        pedestrian_body: Kind of the people.

    Returns:
        What happened; its list of what broke is empty if all is well.
    """
    random = np.random.default_rng(seed)
    recording, scenario = wild_recording(random), replace(wild_scenario(random), pedestrian_body=pedestrian_body)
    controller = wild_controller(random)
    plain = build_environment(recording, scenario)
    watched = WatchedPhysics.from_mujoco(plain.physics.model.ptr)
    watched.watch(plain.task)
    episode = rollout(Environment(watched, plain.task, control_timestep=scenario.control_timestep), controller)
    again = episode if seed % REPEATED else rollout(build_environment(recording, scenario), controller)
    run = Run(
        seed=seed,
        label=(
            f"{controller.name}, {recording.n_people} people, share {scenario.share}, radii "
            f"{scenario.robot.radius:.2f} and {scenario.pedestrian_radius:.2f} m, {scenario.on_collision}"
        ),
        episode=episode,
        speed=watched.speed,
        tilt=watched.tilt,
        thrown_speed=watched.thrown_speed,
        tunnels=watched.tunnels,
        squeezed_tunnels=watched.squeezed_tunnels,
        lost_slots=watched.lost_slots,
        scenario=scenario,
        n_people=recording.n_people,
    )
    run.broken = broken_rules(run, again)
    return run


def broken_rules(run: Run, again: Episode) -> list[str]:
    """What a run breaks of what must always hold; Episode itself checks shapes, presence, order and tilt."""
    episode, broken = run.episode, []
    if again.metadata["state_hash"] != episode.metadata["state_hash"]:
        broken.append("a second run has another state hash")
    for speed, bound in ((run.speed, speed_bound(run.scenario)), (run.thrown_speed, thrown_bound(run.scenario))):
        if speed > bound:
            broken.append(f"a robot at {speed:.2f} m/s, bound {bound:.2f}")
    if run.lost_slots:
        broken.append(f"slots and robots in the scene differed in {run.lost_slots} physics steps")
    if run.tunnels:
        broken.append(f"{run.tunnels} bodies went through a robot that could give way")
    outcome = episode.agent_outcome
    if np.isin(outcome, [Outcome.UNFINISHED]).any():
        broken.append("an agent is under way after the end")
    if not np.array_equal(np.isfinite(episode.agent_spawn_time), outcome != Outcome.NEVER_SPAWNED):
        broken.append("spawns and outcomes do not add up")
    if (outcome == Outcome.OVERTURNED).any() and run.tilt <= OVERTURNED_TILT:
        broken.append("overturned without a tilt")
    forces = np.concatenate([getattr(episode, f"contact_{name}") for name in FORCE_COLUMNS])
    if not np.isfinite(forces).all() or (forces < 0.0).any():
        broken.append("a contact force is not finite and >= 0")
    values = per_agent(episode)
    if (values["success"] & ~values["arrived"]).any() or (values["success"] & values["overturned"]).any():
        broken.append("success of an agent that did not arrive")
    if episode.n_agents + episode.n_pedestrians > run.n_people:
        broken.append("more people than the recording has")
    return broken


# The runner


def summary(runs: list[Run]) -> str:
    """Figures of many runs, a line each."""
    outcomes = np.concatenate([run.episode.agent_outcome for run in runs])
    counts = ", ".join(f"{int((outcomes == outcome).sum())} {outcome.name.lower()}" for outcome in Outcome)
    squeezed = np.concatenate([run.episode.contact_squeeze for run in runs])
    held = np.concatenate([wedged(run.episode) for run in runs])
    peak = np.concatenate(
        [np.maximum(run.episode.contact_impact_force, run.episode.contact_push_force) for run in runs]
    )
    fastest, most = max(runs, key=lambda run: run.speed), max(runs, key=lambda run: run.tilt)
    thrown = max(runs, key=lambda run: run.thrown_speed)
    return "\n".join(
        [
            f"{len(runs)} episodes, {len(outcomes)} agents: {counts}",
            f"{len(held)} contacts, {int(held.sum())} wedged; largest force {np.max(peak[~held], initial=0.0):.0f} N "
            f"free, {np.max(peak[held], initial=0.0):.0f} N wedged, squeeze {np.max(squeezed, initial=0.0):.0f} N",
            f"fastest robot {fastest.speed:.2f} m/s (seed {fastest.seed}: {fastest.label})",
            f"fastest thrown by two bodies {thrown.thrown_speed:.2f} m/s (seed {thrown.seed}: {thrown.label})",
            f"largest tilt {np.degrees(most.tilt):.1f} degrees (seed {most.seed}: {most.label})",
            f"{sum(run.squeezed_tunnels > 0 for run in runs)} episodes in which two bodies met in a robot",
            f"{sum(bool(run.broken) for run in runs)} episodes broke a rule",
            *(f"  seed {run.seed} ({run.label}): {'; '.join(run.broken)}" for run in runs if run.broken),
        ]
    )


def main(arguments: list[str] | None = None) -> int:
    """Run many; the exit code is 1 if one broke a rule."""
    parser = argparse.ArgumentParser(prog="python -m tests.wild", description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="of the first episode; the others count up from it")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(arguments)
    runs: list[Run] = []
    columns = (TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        bar = progress.add_task("", total=options.episodes)
        seeds = [(options.seed + k,) for k in range(options.episodes)]
        for run in in_processes(run_wild, seeds, n_jobs=options.jobs):
            runs.append(run)
            progress.advance(bar)
    print(summary(runs))  # noqa: T201
    return int(any(run.broken for run in runs))


if __name__ == "__main__":
    sys.exit(main())
