"""README.md of an experiment: the verdicts, the main table, the figures, and where it all comes from."""

from collections.abc import Mapping, Sequence
from typing import Any

from socialnav_mj.recordings.known import crowd_of
from socialnav_mj.report.intervals import ONE_RECORDING
from socialnav_mj.report.markdown import head, row
from socialnav_mj.studies.cells import interval_cell, mean_cell
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.findings import Finding
from socialnav_mj.studies.levels import Level, LevelTable
from socialnav_mj.studies.looks import LOOKS, SCENARIO_TITLES
from socialnav_mj.studies.panel import COMMON, METHODS, MIXED, POTENTIAL_FIELD
from socialnav_mj.studies.paper.claims_page import WOULD_TAKE, share_of, to_decide
from socialnav_mj.studies.paper.figures import FIGURES
from socialnav_mj.studies.paper.plan import DEFAULT
from socialnav_mj.studies.paper.training_curves import training_table

_COLUMNS = (
    ("success", "success", 3),
    ("first collision with a pedestrian / agent", "first_hit_pedestrian", 3),
    ("timed out", "timed_out", 3),
    ("steps within 1.2 m", "intimate_intrusions", 1),
    ("share of steps within 1.2 m", "intrusion_share_of_steps", 3),
    ("speed [m/s]", "average_speed", 3),
    ("time, same agents [s]", f"completion_time_success{COMMON}", 2),
    ("time, own successes [s]", "completion_time_success", 2),
    ("time, all, censored [s]", "time_under_way", 2),
    ("path ratio, same agents", f"distance_to_displacement_success{COMMON}", 3),
    ("path ratio, own successes", "distance_to_displacement_success", 3),
    ("success if ghosts count", "success_if_ghosts_count", 3),
)
_HOW_TO_READ = f"""\
Means over draws (a draw is one random choice of the people who are replaced) and training seeds. Brackets, and the \
bars of the figures: 95 % interval for other draws and other trainings, see claims.md. White dots: each training \
alone. {ONE_RECORDING} *Same agents*: those that every controller brought home without a collision, so the easy trips; \
the last column counts them (*human*: those whose person had no collision either). *Censored*: everybody who spawned; \
who did not arrive counts with the time watched, a lower bound. *Human*: each replaced person on its own track, scored \
by the same code; contacts by geometry. *(x n)*: n times the potential field's. All numbers with their intervals: \
tables/levels.csv.
"""
_HELD_OUT = """\
Agents by when the person they replace appears: in the part of the recording that the policies were trained on, or \
after the parts for training and validation (held out). The crowd differs between the two, so the rows that learned \
nothing show what the crowd alone changes.
"""
_TRAINING = """\
What the trainings' cards say, with seeds of their own on scenes with 10, 30 and 90 % agents in each part of the \
recording. Trips that an edge of a part cuts short are easier, so the figures do not compare with those above. The \
kept checkpoint (ring) is the last late one whose score, validation success - {weight} x share, is within a standard \
error of the best. Training collides at wider bodies than evaluation.
"""
_REWARD = """\
Learned reward of an agent that drives at 0.8 m/s towards a goal 5 m ahead, with one walker (1 m/s) at each place \
around it. The white line, and the mark on the scale, is the reward with nobody there; the dashed circle is 1.2 m. The \
first row is the mean of all trainings; of the trainings the first three have a row of their own.
"""


def experiment_page(
    table: LevelTable,
    findings: Sequence[Finding],
    *,
    held_out: Mapping[str, Sequence[Level]],
    sweep: Mapping[float, LevelTable],
    has_variants: bool,
    provenance: Mapping[str, Any],
) -> str:
    """Text of the study's README.md.

    Args:
        table: Levels of the default setting.
        findings: One for each claim, of the default setting.
        held_out: Period: its levels.
        sweep: Switch distance [m]: levels.
        has_variants: Whether there is a figure of the other settings.
        provenance: Command, experiment, recording, policies, runs.

    Returns:
        Markdown.
    """
    recording = provenance["recording"]
    lines = [f"# The paper's study on {crowd_of(recording['name'], recording['variant'])}", ""]
    lines += [f"Command: `{provenance['command']}`", "", "## Claims of the paper, default setting", ""]
    lines += head(["claim", "the paper says", "verdict", "to decide"])
    lines += [row([f"({f.claim.key})", f.claim.sentence, f"**{f.verdict}**", to_decide(f)]) for f in findings]
    undecided = sum(f.verdict == "undecided" for f in findings)
    lines += ["", f"{undecided} of {len(findings)} claims are undecided. {WOULD_TAKE}"]
    lines += ["Effects, intervals, other settings and the rule: [claims.md](claims.md).", "", "## Results", ""]
    lines += [_HOW_TO_READ, *_results(table)]
    for drawing in FIGURES:
        lines += [f"![{drawing.name}](figures/{drawing.name}.png)", ""]
    if has_variants:
        drawn = provenance["experiment"]["variant_draws"] or provenance["experiment"]["draws"]
        lines += ["## Other settings", "", f"Means over {drawn} draws.", ""]
        lines += ["![other settings](figures/figure_8_variants.png)", ""]
    cards = {
        facts["training_seed"]: facts["card"]
        for facts in provenance["policies"].values()
        if facts["card"]["config"]["turn_limit"] == DEFAULT.turn_limit
    }
    lines += ["## Each training", "", *_trainings(table)]
    if all("history" in card for card in cards.values()):
        weight = next(iter(cards.values()))["config"]["intrusion_weight"]
        lines += [_TRAINING.format(weight=weight), *training_table(cards), ""]
        lines += ["![Success, intrusions and collisions over each training](figures/figure_9_training.png)", ""]
    lines += ["## In-sample and held out", "", _HELD_OUT, *_periods(held_out)]
    if len(sweep) > 1:
        lines += [
            "## Switch distance",
            "",
            *_swept(sweep),
            "![The hybrid over its switch distance](figures/figure_6_switch_distance.png)",
            "",
        ]
    lines += [
        "## What the reward learned",
        "",
        _REWARD,
        "![Learned reward by the place of one walker](figures/figure_7_learned_reward.png)",
        "",
    ]
    return "\n".join([*lines, *traceability(provenance, [recording])]) + "\n"


def _results(table: LevelTable) -> list[str]:
    lines = head(["scenario", "controller", *(heading for heading, _, _ in _COLUMNS), "same agents"])
    for scenario in table.scenarios:
        for method in METHODS:
            found = [(table.find(scenario, method, measure), digits) for _, measure, digits in _COLUMNS]
            if found[0][0] is None:
                continue
            cells = [mean_cell(level, digits) for level, digits in found]
            cells[0] = interval_cell(found[0][0])
            cells[1] += f" / {mean_cell(table.find(scenario, method, 'first_hit_agent'), 3)}"
            cells[4] += _times(found[4][0], table.find(scenario, POTENTIAL_FIELD, "intrusion_share_of_steps"))
            lines.append(row([SCENARIO_TITLES.get(scenario, scenario), LOOKS[method].label, *cells, _same(found)]))
    return [*lines, ""]


def _same(found: Sequence[tuple[Level | None, int]]) -> str:
    """How many agents the columns of the same agents are about, of one training."""
    by_measure = {measure: level for (_, measure, _), (level, _) in zip(_COLUMNS, found, strict=True)}
    everybody, same = by_measure["success"], by_measure[f"completion_time_success{COMMON}"]
    if everybody is None or same is None:
        return "-"
    trainings = max(everybody.interval.n_trainings, 1)
    return share_of(same.n_values // trainings, everybody.n_values // trainings)


def _trainings(table: LevelTable) -> list[str]:
    titles = [SCENARIO_TITLES.get(s, s) for s in table.scenarios]
    lines = ["Success / share of steps within 1.2 m.", "", *head(["controller", "training", *titles])]
    for method in METHODS:
        for training in table.trainings(method):
            cells = [
                f"{mean_cell(table.find(s, method, 'success', training), 3)} / "
                f"{mean_cell(table.find(s, method, 'intrusion_share_of_steps', training), 3)}"
                for s in table.scenarios
            ]
            lines.append(row([LOOKS[method].label, str(training), *cells]))
    return [*lines, ""]


def _periods(held_out: Mapping[str, Sequence[Level]]) -> list[str]:
    tables = {name: LevelTable(rows=tuple(rows)) for name, rows in held_out.items()}
    heads = [f"{what}, {name}" for what in ("success", "share of steps within 1.2 m") for name in tables]
    lines = head(["scenario", "controller", *heads, "agents x trainings"])
    for scenario in dict.fromkeys(s for table in tables.values() for s in table.scenarios):
        for method in METHODS:
            success = [table.find(scenario, method, "success") for table in tables.values()]
            shares = [table.find(scenario, method, "intrusion_share_of_steps") for table in tables.values()]
            if all(level is None for level in success):
                continue
            counts = " / ".join("0" if level is None else str(level.n_values) for level in success)
            cells = [interval_cell(level) for level in (*success, *shares)]
            lines.append(row([SCENARIO_TITLES.get(scenario, scenario), LOOKS[method].label, *cells, counts]))
    return [*lines, ""]


def _swept(sweep: Mapping[float, LevelTable]) -> list[str]:
    scenarios = next(iter(sweep.values())).scenarios
    drawn = max(row.interval.n_draws for table in sweep.values() for row in table.rows)
    lines = [f"`hybrid` over {drawn} draws: success / share of steps within 1.2 m / time under way [s].", ""]
    lines += head(["distance [m]", *(SCENARIO_TITLES.get(s, s) for s in scenarios)])
    measures = (("success", 3), ("intrusion_share_of_steps", 3), ("time_under_way", 1))
    for distance, table in sweep.items():
        cells = [" / ".join(mean_cell(table.find(s, MIXED, m), digits) for m, digits in measures) for s in scenarios]
        lines.append(row([f"{distance:g}", *cells]))
    return [*lines, ""]


def _times(level: Level | None, reference: Level | None) -> str:
    """How many times the reference, in brackets."""
    if level is None or reference is None or level is reference or not reference.interval.mean > 0.0:
        return ""
    return f" (x {level.interval.mean / reference.interval.mean:.2f})"
