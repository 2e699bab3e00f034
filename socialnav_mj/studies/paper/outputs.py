"""Episodes of the experiment -> tables, figures, claims.md and README.md; all made again at every call."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute

from socialnav_mj.controllers.replay_irl import load_policy
from socialnav_mj.files import write_json, write_whole
from socialnav_mj.provenance import recording_metadata
from socialnav_mj.recordings import load_recording
from socialnav_mj.report.agents import Results
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.studies.files import level_rows, provenance_of, write_csv
from socialnav_mj.studies.held_out import held_out_levels, period_of_people
from socialnav_mj.studies.levels import LevelTable, levels
from socialnav_mj.studies.panel import MIXED, make_panel
from socialnav_mj.studies.paper.claims import Finding, examine
from socialnav_mj.studies.paper.claims_page import claims_page
from socialnav_mj.studies.paper.figures import draw_figures, draw_sweep
from socialnav_mj.studies.paper.page import experiment_page
from socialnav_mj.studies.paper.plan import (
    DEFAULT,
    SWEEP,
    SWEEP_RUN,
    SWITCH_DISTANCE,
    Experiment,
    Variant,
)
from socialnav_mj.studies.paper.reward_map import draw_reward_maps
from socialnav_mj.studies.paper.training_curves import draw_training_curves
from socialnav_mj.studies.paper.variant_figure import draw_variants
from socialnav_mj.studies.study import read_runs

PUBLIC = ("README.md", "claims.md", "provenance.json", "tables", "figures")
"""What may travel with the project: no recordings, no episodes."""


def write_outputs(experiment: Experiment, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the experiment's folder again, except its episodes.

    Args:
        experiment: That was run by `study.reproduce`.
        out: Its folder; gets tables/, figures/, claims.md, README.md and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
        ValueError: If the policies were trained on different parts of the recording.
    """
    results = read_runs(experiment, out, n_jobs=n_jobs)
    titles = {variant.name: variant.title for variant in experiment.settings}
    tables: dict[str, LevelTable] = {}
    findings: dict[str, list[Finding]] = {}
    for variant in experiment.settings:
        panel = make_panel(agents_of(experiment, variant, results), experiment.roster(variant))
        tables[variant.name] = LevelTable(rows=tuple(levels(panel)))
        findings[variant.name] = examine(panel)
    sweep = _sweep(experiment, results, tables[DEFAULT.name])
    recording = load_recording(experiment.dataset, data_dir=experiment.data_dir)
    periods = period_of_people(recording, [load_policy(policy).card["config"] for policy in experiment.policies])
    held_out = held_out_levels(results[DEFAULT.name].agents, experiment.roster(DEFAULT), periods)

    write_csv(
        out / "tables" / "levels.csv", [r for name, t in tables.items() for r in level_rows(t.rows, variant=name)]
    )
    write_csv(out / "tables" / "claims.csv", [row for name, f in findings.items() for row in _claim_rows(name, f)])
    write_csv(out / "tables" / "held_out.csv", [r for name, t in held_out.items() for r in level_rows(t, period=name)])
    swept = [
        r for d, t in sweep.items() for r in level_rows([x for x in t.rows if x.method == MIXED], switch_distance=d)
    ]
    write_csv(out / "tables" / "switch_distance.csv", swept)
    draw_figures(tables[DEFAULT.name], out / "figures")
    if len(sweep) > 1:
        draw_sweep(sweep, sweep[SWITCH_DISTANCE], out / "figures")
    if experiment.variants:
        draw_variants(tables, titles, out / "figures")
    cards = {seed: load_policy(policy).card for seed, policy in experiment.trainings.items()}
    if all("history" in card for card in cards.values()):
        draw_training_curves(cards, out / "figures")
    draw_reward_maps({f"training {k}": load_policy(p) for k, p in experiment.trainings.items()}, out / "figures")
    write_whole(out / "claims.md", claims_page(findings, titles=titles, command=command).encode())
    provenance = provenance_of(experiment, results, command=command)
    provenance["recording"] = recording_metadata(recording)
    write_json(out / "provenance.json", provenance)
    page = experiment_page(
        tables[DEFAULT.name],
        findings[DEFAULT.name],
        held_out=held_out,
        sweep=sweep,
        has_variants=experiment.variants,
        provenance=provenance,
    )
    return write_whole(out / "README.md", page.encode())


def agents_of(experiment: Experiment, variant: Variant, results: Mapping[str, Results]) -> pa.Table:
    """Agents of a setting: its own episodes, and those of the default setting for methods that it does not change.

    Args:
        experiment: The experiment.
        variant: The setting.
        results: Of each run.

    Returns:
        Columns of `agents.SCHEMA`.
    """
    own = results[variant.name].agents
    others = [e.controller for e in experiment.roster(variant) if e.method not in (*variant.runs, HUMAN)]
    default = _first_draws(experiment, results[DEFAULT.name].agents, variant.name)
    return pa.concat_tables(
        [own, default.filter(pa.compute.is_in(default["controller"], pa.array(others, pa.string())))]
    )


def _first_draws(experiment: Experiment, agents: pa.Table, name: str) -> pa.Table:
    """Agents of the draws that a run has."""
    return agents.filter(pa.compute.less(agents["draw"], experiment.seed + experiment.draws_of(name)))


def _sweep(experiment: Experiment, results: Mapping[str, Results], table: LevelTable) -> dict[float, LevelTable]:
    """Levels by switch distance [m]: of every method at the default one, of the mixed policy at the others."""
    if experiment.draws_of(SWEEP_RUN) < experiment.draws:
        agents = _first_draws(experiment, results[DEFAULT.name].agents, SWEEP_RUN)
        table = LevelTable(rows=tuple(levels(make_panel(agents, experiment.roster(DEFAULT)))))
    found = {SWITCH_DISTANCE: table}
    if SWEEP_RUN in results:
        for distance in SWEEP:
            panel = make_panel(results[SWEEP_RUN].agents, experiment.sweep_roster(distance))
            found[distance] = LevelTable(rows=tuple(levels(panel)))
    return dict(sorted(found.items()))


def _claim_rows(variant: str, findings: Sequence[Finding]) -> list[dict[str, Any]]:
    return [
        {
            "variant": variant,
            "claim": finding.claim.key,
            "claim_verdict": finding.verdict,
            "claim_verdict_given_trainings": finding.verdict_given,
            "comparison": part.label,
            "unit": finding.claim.unit,
            **asdict(interval),
            "verdict": verdict,
        }
        for finding in findings
        for part, interval, verdict in finding.parts
    ]
