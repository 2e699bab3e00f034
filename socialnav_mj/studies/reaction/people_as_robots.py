"""People as robots: each person's recorded track plays a robot among the others, once on time and once late.

On time, everybody has reacted to that person already, in the recording: a right reaction moves them little. Late, the
same track is a stranger's, whom nobody has reacted to: a reaction worth its name spares people collisions.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import ks_2samp

from socialnav_mj.config import Scenario
from socialnav_mj.files import write_whole
from socialnav_mj.geometry import Array, quaternion_of_yaw
from socialnav_mj.reaction import STRENGTH, Deviation, Movers, deviate
from socialnav_mj.recorder import recorded_series
from socialnav_mj.recordings import Recording
from socialnav_mj.report.markdown import table
from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.files import write_csv
from socialnav_mj.studies.looks import LINES, SHADES

NEARBY = 3.0
"""People this near to the track that plays a robot are looked at [m]."""
_SHORTEST = 5
"""Tracks of fewer control steps play no robot."""
_HOW_TO_READ = """\
Each recorded track plays a robot among all other people, one at a time; people within 3 m of it are looked at, at \
every control step. *On time*: they have reacted to that person in the recording, so that the added reaction should \
move them little. *Late*: the same track as a stranger's, whom nobody has reacted to. *KS*: Kolmogorov-Smirnov \
distance between the values without and with the reaction, of speeds at all steps and of each neighbour's least \
distance. *Collisions*: neighbours whose centre came within {distance:.2f} m, without (as in the human row) and with.
"""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a strength does to the neighbours of all tracks of one recording."""

    recording: str
    strength: float
    """k [m^2]."""
    late: float
    """By which the tracks are late; 0 on time [s]."""
    tracks: int
    """That played a robot."""
    mean_displacement: float
    """[m]"""
    moved_share: float
    """Share of neighbours and steps with more than 1 cm."""
    displacement_95: float
    """95 % of displacements are smaller [m]."""
    ks_speed: float
    ks_nearest: float
    touches_recorded: int
    touches: int


def people_as_robots(recording: Recording, strength: float, *, late: float = 0.0) -> tuple[Outcome, Array]:
    """Play every track of at least a metre as a robot, one at a time.

    Args:
        recording: Whose people play and react.
        strength: k of the push [m^2].
        late: By which each track is late [s].

    Returns:
        What it comes to, and the displacements of all neighbours at all steps [m].
    """
    scenario = Scenario()
    dt, touch, body = scenario.control_timestep, scenario.contact_distance, 2.0 * scenario.pedestrian_radius
    n, shift = recording.n_people, round(late / dt)
    first = np.ceil(recording.start_time / dt - 1e-6).astype(np.int64)
    last = np.floor(recording.end_time / dt + 1e-6).astype(np.int64)
    steps = int(last.max()) + 1
    place, velocity, heading = recorded_series(recording, np.arange(n), first, last, (0, steps), dt)
    angle = np.nan_to_num(heading)
    facing = quaternion_of_yaw(angle)
    way = np.linalg.norm(recording.end - recording.start, axis=1)
    players = np.flatnonzero((last - first >= _SHORTEST) & (way >= scenario.minimum_displacement))
    moved, speeds, nearest = [np.zeros(0)], [np.zeros((2, 0))], [np.zeros((2, 0))]
    for player in players:
        deviation, least = Deviation.none(n), np.full((2, n), np.inf)
        for k in range(int(first[player]) + shift, min(int(last[player]) + shift, steps - 1)):
            rows = np.flatnonzero(np.isfinite(place[k, :, 0]) & (np.arange(n) != player))
            if not rows.size:
                continue
            own = Deviation(offset=deviation.offset[rows], drift=deviation.drift[rows])
            recorded = Movers(position=place[k, rows], velocity=velocity[k, rows])
            after = deviate(
                own,
                people=Movers(position=recorded.position + own.offset, velocity=recorded.velocity + own.drift),
                recorded=recorded,
                following=place[k + 1, rows],
                facing=facing[k, rows],
                robots=Movers(position=place[k - shift, [player]], velocity=velocity[k - shift, [player]]),
                strength=strength,
                timestep=dt,
                distance=touch,
                body=body,
            )
            stays = np.isfinite(place[k + 1, rows, 0])
            deviation = Deviation.none(n)
            deviation.offset[rows[stays]], deviation.drift[rows[stays]] = after.offset[stays], after.drift[stays]
            left = rows[stays]
            gap = place[k + 1, left] - place[k + 1 - shift, player]
            both = np.stack([gap, gap + deviation.offset[left]])
            far = np.linalg.norm(both, axis=-1)
            least[:, left] = np.minimum(least[:, left], far)
            near = left[far[0] < NEARBY]
            moved.append(np.linalg.norm(deviation.offset[near], axis=1))
            walk = np.stack([velocity[k + 1, near], velocity[k + 1, near] + deviation.drift[near]])
            speeds.append(np.linalg.norm(walk, axis=-1))
        nearest.append(least[:, least[0] < NEARBY])
    displacement, speed, closest = np.concatenate(moved), np.hstack(speeds), np.hstack(nearest)
    some = displacement.size > 0
    outcome = Outcome(
        recording=recording.name,
        strength=strength,
        late=late,
        tracks=len(players),
        mean_displacement=float(displacement.mean()) if some else 0.0,
        moved_share=float((displacement > 0.01).mean()) if some else 0.0,
        displacement_95=float(np.quantile(displacement, 0.95)) if some else 0.0,
        ks_speed=float(ks_2samp(*speed).statistic) if some else 0.0,
        ks_nearest=float(ks_2samp(*closest).statistic) if closest.size else 0.0,
        touches_recorded=int((closest[0] < touch).sum()),
        touches=int((closest[1] < touch).sum()),
    )
    return outcome, displacement


def write_test(
    recordings: Sequence[Recording], out: Path, *, strengths: Sequence[float] = (), late: float = 8.0
) -> tuple[Path, list[str]]:
    """Run the test on time and late, and write a table, a figure and a page.

    Args:
        recordings: One or more.
        out: Gets tables/people_as_robots.csv, figures/ and README.md.
        strengths: k; those of the levels by default [m^2].
        late: By which strangers are late, > 0 [s].

    Returns:
        Path of README.md, and a line for each recording and strength.

    Raises:
        ValueError: If strangers are on time.
    """
    if not late > 0.0:
        raise ValueError(f"late = {late} is not allowed; allowed: numbers > 0")
    names = {value: name for name, value in STRENGTH.items()}
    chosen = tuple(strengths) or tuple(STRENGTH.values())
    found = [
        people_as_robots(recording, k, late=own) for recording in recordings for k in chosen for own in (0.0, late)
    ]
    outcomes = [outcome for outcome, _ in found]
    write_csv(out / "tables" / "people_as_robots.csv", [asdict(outcome) for outcome in outcomes])
    _draw([(o, moved) for o, moved in found if o.late == 0.0], out / "figures")
    rows, lines = [], []
    for o in outcomes:
        when = "late" if o.late else "on time"
        label = f"{o.strength:g}" + (f" ({names[o.strength]})" if o.strength in names else "")
        cells = [o.recording, label, when, f"{o.mean_displacement:.4f}", f"{o.moved_share:.3f}"]
        cells += [f"{o.displacement_95:.3f}", f"{o.ks_speed:.4f}", f"{o.ks_nearest:.4f}"]
        rows.append([*cells, f"{o.touches_recorded} / {o.touches}"])
        lines.append(
            f"{o.recording}, k = {label}, {when}: mean displacement {o.mean_displacement:.4f} m, "
            f"collisions {o.touches_recorded} -> {o.touches}"
        )
    heads = ["recording", "k [m^2]", "tracks", "mean displacement [m]", "moved by more than 1 cm", "95 % below [m]"]
    heads += ["KS of speed", "KS of nearest distance", "collisions, without / with"]
    text = ["# People as robots", "", _HOW_TO_READ.format(distance=Scenario().contact_distance)]
    text += [*table(heads, rows), "![displacement](figures/displacement.png)", ""]
    return write_whole(out / "README.md", "\n".join(text).encode()), lines


def _draw(found: Sequence[tuple[Outcome, Array]], folder: Path) -> list[Path]:
    """Share of neighbours and steps with more than a displacement, for tracks on time."""
    with style():
        figure = new_figure(2.6)
        axes = figure.subplots()
        strengths = sorted({outcome.strength for outcome, _ in found})
        recordings = list(dict.fromkeys(outcome.recording for outcome, _ in found))
        grid = np.linspace(0.0, 0.3, 151)
        for outcome, moved in found:
            above = [float((moved > d).mean()) if moved.size else 0.0 for d in grid]
            axes.plot(
                grid,
                above,
                color=SHADES[strengths.index(outcome.strength) % len(SHADES)],
                linestyle=LINES[recordings.index(outcome.recording) % len(LINES)],
                label=f"{outcome.recording}, k = {outcome.strength:g}",
            )
        axes.set_xlabel("displacement of people who have reacted already [m]")
        axes.set_ylabel("share of steps above")
        axes.legend()
        return save(figure, folder, "displacement")
