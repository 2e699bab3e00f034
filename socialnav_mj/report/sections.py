"""Sections of report.md: who was at fault, how hard, agents beside those they replaced, how many draws it takes."""

from collections.abc import Iterable, Sequence
from itertools import groupby

import numpy as np
import pyarrow as pa

from socialnav_mj.geometry import Array
from socialnav_mj.metrics.severity import Severity
from socialnav_mj.report import columns as col
from socialnav_mj.report.estimates import Columns, Estimate, groups
from socialnav_mj.report.intervals import LEAST
from socialnav_mj.report.markdown import interval, table
from socialnav_mj.report.paired import DIFFERENCES
from socialnav_mj.report.power import Resolution, told

Rows = list[list[str]]

_FAULT = """\
Collisions of all draws and agents together. Who moved into whom is decided by each party's own velocity along the \
contact normal just before the contact: at least 0.1 m/s towards the other. It is kinematics, not right of way. A \
collision between two agents counts once here. *Struck standing*: share of all agents that somebody walked into while \
they stood still (slower than 0.1 m/s). *Repeated*: collisions of a pair that had collided before. In the \
human row the agents are the people themselves.
"""

_OVERLAPS = """\
Pedestrians cannot touch each other in the simulation. Share of them whose track comes as near to another \
pedestrian's as counts for a collision above."""

_SEVERITY = """\
Collisions with people against ISO/TS 15066's limits for the lower leg, where the bumper strikes: 130 N, or 260 N for \
at most 0.5 s. *Impact*: the first 0.1 s of a collision; *expected*: the momentum that two free bodies exchange \
at the closing speed. *Simulated*: the impact's largest force in MuJoCo, softer than flesh, and the mean force of the \
push after it; *flesh*: the specification's own estimate from the closing speed for a free robot, without padding. \
*Clamped*: the robot touched two bodies during the impact; its force means nothing. *Pushed*: time in touch after the \
impact, mean over collisions. *Shoved standing*: collisions that struck an agent standing still and pushed it for 1 s \
or longer. See docs/metrics.md.
"""

_PAIRED = f"""\
Every agent beside the person it replaced (same start, goal and appearance): agent minus person, mean over draws, with \
the 95 % interval over draws (none for fewer than {LEAST}, nor where all are equal). *Time* is over all agents that \
spawned, time-outs counted with the time they were watched; time and path *of arrivals* leave the others out. \
Intrusions are within 1.2 m.
"""

_DRAWS = """\
From the spread between draws of this run's paired differences between two controllers (in brackets): the number of \
draws whose 95 % interval reaches just that far to each side / the number with which a true difference of that size is \
found in 80 % of studies. A spread from few draws is itself uncertain: with 3 draws by a factor of about 2.
"""

_DIFFERENCES = {
    "time": ("time [s]", 2),
    "time_of_arrivals": ("time of arrivals [s]", 2),
    "path_of_arrivals": ("path of arrivals [m]", 2),
    "intimate_intrusions": ("intrusions [steps]", 1),
    "intrusion_share": ("intrusions [share]", 3),
    "minimum_distance": ("minimum distance [m]", 3),
}


def fault_section(agents: pa.Table, contacts: pa.Table, overlaps: dict[tuple[str, str, str], list[float]]) -> list[str]:
    """Who was at fault in how many collisions, for each scenario and controller.

    Args:
        agents: Columns of `agents.SCHEMA`.
        contacts: Columns of `collisions.CONTACT_SCHEMA`.
        overlaps: As in `agents.Results`.

    Returns:
        Lines of Markdown.
    """
    headings = ["scenario", "controller", "with people", "agent moved", "person moved", "both", "neither"]
    headings += ["with agents", "one moved", "both", "neither", "repeated", "struck standing"]
    found = {tuple(labels.values()): columns for labels, columns, _ in groups(contacts)}
    rows: Rows = []
    for labels, columns, _ in groups(agents):
        own = found.get(tuple(labels.values()))
        cells = _fault_cells(own) if own is not None else ["0"] * 10
        share = float(np.mean(columns[col.STRUCK_STANDING].astype(float)))
        rows.append([_place(labels), labels["controller"], *cells, f"{share:.3f}"])
    lines = ["## Who moved into whom", "", _FAULT, *table(headings, rows)]
    if overlaps:
        shares = "; ".join(f"{_place_of(*place)}: {np.mean(values):.3f}" for place, values in overlaps.items())
        lines += [f"{_OVERLAPS} {shares}.", ""]
    return lines


def severity_section(contacts: pa.Table) -> list[str]:
    """How hard the collisions with people were.

    Args:
        contacts: Columns of `collisions.CONTACT_SCHEMA`.

    Returns:
        Lines of Markdown; none without a collision under physics.
    """
    headings = ["scenario", "controller", "collisions", "closing speed [m/s]: median", "95 %"]
    headings += ["impact [N s]: median", "expected", "pushed [s]", "shoved standing"]
    headings += ["simulated: to 130 N", "to 260 N", "over", "clamped", "flesh: to 130 N", "to 260 N", "over"]
    rows: Rows = []
    for labels, columns, _ in groups(contacts):
        hit = columns["partner"] == "pedestrian"
        if not hit.any() or np.isnan(columns["impact_force"][hit]).all():
            continue
        speed = np.percentile(columns["closing_speed"][hit], [50, 95])
        free = hit & (columns["severity"] != "clamped")
        medians = [
            f"{np.median(columns[name][free]):.1f}" if free.any() else "-"
            for name in ("impact_impulse", "impact_momentum")
        ]
        pushed = [f"{np.mean(columns['push_duration'][hit]):.2f}", str(int(np.sum(columns["shoved"][hit])))]
        classes = [member.name.lower() for member in Severity]
        simulated = [str(int(np.sum(columns["severity"][hit] == name))) for name in classes]
        flesh = [str(int(np.sum(columns["flesh_severity"][hit] == name))) for name in classes[:3]]
        cells = [str(int(hit.sum())), *(f"{value:.2f}" for value in speed), *medians, *pushed, *simulated, *flesh]
        rows.append([_place(labels), labels["controller"], *cells])
    return ["## How hard", "", _SEVERITY, *table(headings, rows)] if rows else []


def paired_section(differences: Sequence[Estimate], figure: str) -> list[str]:
    """Agents beside the people they replaced.

    Args:
        differences: Of `paired.paired_differences`.
        figure: Path of the figure, relative to the report.

    Returns:
        Lines of Markdown; none if no agent is paired.
    """
    if not any(e.n_agents for e in differences):
        return []
    headings = ["scenario", "controller", *(_DIFFERENCES[name][0] for name in DIFFERENCES), "pairs", "draws"]
    rows: Rows = []
    for key, group in groupby(differences, key=lambda e: (e.dataset, e.variant, e.scenario, e.controller)):
        row = {e.measure: e for e in group}
        cells = [
            interval(row[name].mean, row[name].low, row[name].high, _DIFFERENCES[name][1], "+") for name in DIFFERENCES
        ]
        rows.append([_place_of(*key[:3]), key[3], *cells, str(row["time"].n_agents), str(row["time"].n_draws)])
    picture = f"![Differences between agents and the people they replaced]({figure})"
    return ["## Beside the people they replaced", "", _PAIRED, picture, "", *table(headings, rows)]


def draws_section(found: Iterable[Resolution]) -> list[str]:
    """How many draws it takes to tell controllers apart.

    Args:
        found: Of `power.resolutions`.

    Returns:
        Lines of Markdown; none if no two controllers share two draws.
    """
    rows: Rows = []
    columns: dict[str, str] = {}
    for key, group in groupby(found, key=lambda r: (r.dataset, r.variant, r.scenario, r.controllers)):
        row = {r.measure: r for r in group}
        columns |= {name: f"{name} to {r.difference:g}" for name, r in row.items()}
        cells = [f"{told(r.draws)} / {told(r.draws_for_power)} ({r.spread:.3f})" for r in row.values()]
        rows.append([_place_of(*key[:3]), " - ".join(key[3]), *cells, str(min(r.n_draws for r in row.values()))])
    headings = ["scenario", "controllers", *columns.values(), "from draws"]
    return ["## How many draws it takes", "", _DRAWS, *table(headings, rows)] if rows else []


def _fault_cells(columns: Columns) -> list[str]:
    person, agent = columns["partner"] == "pedestrian", columns["partner"] == "agent"

    def count(which: Array | np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> int:
        return int(np.sum(which))

    who = columns["fault"]
    people = [count(person), *(count(person & (who == name)) for name in ("agent", "partner", "both", "neither"))]
    # A collision between two agents stands in two rows: at fault in one is struck in the other.
    agents = [count(agent) / 2, count(agent & (who == "agent"))]
    agents += [count(agent & (who == name)) / 2 for name in ("both", "neither")]
    repeated = count(person & ~columns["first"]) + count(agent & ~columns["first"]) / 2
    return [f"{value:g}" for value in (*people, *agents, repeated)]


def _place(labels: dict[str, str]) -> str:
    return _place_of(labels["dataset"], labels["variant"], labels["scenario"])


def _place_of(dataset: str, variant: str, scenario: str) -> str:
    return f"{dataset} ({variant}), {scenario}"
