"""Episodes of the experiment -> tables, figures, claims.md and README.md; all made again at every call."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute

from socialnav_mj.controllers.replay_irl import load_policy
from socialnav_mj.files import write_json, write_whole
from socialnav_mj.provenance import recording_metadata
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.report.html import html_page
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.studies.files import level_rows, provenance_of, write_csv, write_pages
from socialnav_mj.studies.findings import Finding, examine
from socialnav_mj.studies.held_out import held_out_levels, period_of_people
from socialnav_mj.studies.levels import Level, LevelTable, levels
from socialnav_mj.studies.panel import MIXED, make_panel
from socialnav_mj.studies.paper.claims_page import claims_page, to_decide
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
from socialnav_mj.studies.paper.reward_map import draw_reward_maps, rows_of
from socialnav_mj.studies.paper.training_curves import draw_training_curves
from socialnav_mj.studies.paper.variant_figure import draw_variants
from socialnav_mj.studies.study import read_runs

PUBLIC = ("README.md", "claims.md", "provenance.json", "tables", "figures")
"""What may travel with the project: no recordings, no episodes."""


def write_outputs(experiment: Experiment, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the experiment's folder again, except its episodes.

    Args:
        experiment: That was run by `study.reproduce`.
        out: Its folder; gets tables/, figures/, claims and README as Markdown and HTML, and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
        ValueError: If the policies were trained on different parts of the recording.
    """
    found = _found(experiment, read_runs(experiment, out, n_jobs=n_jobs))
    _write_tables(found, out / "tables")
    _draw(experiment, found, out / "figures")
    titles = {variant.name: variant.title for variant in experiment.settings}
    claims = claims_page(found.findings, titles=titles, command=command)
    write_whole(out / "claims.md", claims.encode())
    write_whole(out / "claims.html", html_page([claims], out))
    provenance = provenance_of(experiment, found.results, command=command)
    provenance["recording"] = recording_metadata(found.recording)
    write_json(out / "provenance.json", provenance)
    page = experiment_page(
        found.tables[DEFAULT.name],
        found.findings[DEFAULT.name],
        held_out=found.held_out,
        sweep=found.sweep,
        has_variants=len(experiment.settings) > 1,
        provenance=provenance,
    )
    return write_pages(out, page, found.results, command=command)


@dataclass(frozen=True, kw_only=True)
class _Found:
    """Everything that the experiment's episodes come to."""

    recording: Recording
    results: dict[str, Results]
    """Of each run."""
    tables: dict[str, LevelTable]
    """Of each setting."""
    findings: dict[str, list[Finding]]
    """Of each setting."""
    sweep: dict[float, LevelTable]
    """By switch distance [m]."""
    held_out: dict[str, list[Level]]
    """By period of the recording."""


def _found(experiment: Experiment, results: dict[str, Results]) -> _Found:
    panels = {
        variant.name: make_panel(agents_of(experiment, variant, results), experiment.roster(variant))
        for variant in experiment.settings
    }
    tables = {name: LevelTable(rows=tuple(levels(panel))) for name, panel in panels.items()}
    recording = load_recording(experiment.dataset, data_dir=experiment.data_dir)
    periods = period_of_people(recording, [load_policy(policy).card["config"] for policy in experiment.policies])
    return _Found(
        recording=recording,
        results=results,
        tables=tables,
        findings={name: examine(panel) for name, panel in panels.items()},
        sweep=_sweep(experiment, results, tables[DEFAULT.name]),
        held_out=held_out_levels(results[DEFAULT.name].agents, experiment.roster(DEFAULT), periods),
    )


def _write_tables(found: _Found, folder: Path) -> None:
    write_csv(folder / "levels.csv", [r for name, t in found.tables.items() for r in level_rows(t.rows, variant=name)])
    write_csv(folder / "claims.csv", [row for name, f in found.findings.items() for row in _claim_rows(name, f)])
    write_csv(folder / "held_out.csv", [r for name, t in found.held_out.items() for r in level_rows(t, period=name)])
    mixed = {distance: [row for row in table.rows if row.method == MIXED] for distance, table in found.sweep.items()}
    write_csv(
        folder / "switch_distance.csv", [r for d, rows in mixed.items() for r in level_rows(rows, switch_distance=d)]
    )


def _draw(experiment: Experiment, found: _Found, folder: Path) -> None:
    draw_figures(found.tables[DEFAULT.name], folder)
    if len(found.sweep) > 1:
        draw_sweep(found.sweep, found.sweep[SWITCH_DISTANCE], folder)
    if len(experiment.settings) > 1:
        draw_variants(found.tables, {variant.name: variant.title for variant in experiment.settings}, folder)
    trained = {seed: load_policy(policy) for seed, policy in experiment.trainings().items()}
    if all("history" in policy.card for policy in trained.values()):
        draw_training_curves({seed: policy.card for seed, policy in trained.items()}, folder)
    draw_reward_maps(rows_of({f"training {seed}": policy for seed, policy in trained.items()}), folder)


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
    swept = experiment.sweep_roster(SWITCH_DISTANCE)
    if experiment.draws_of(SWEEP_RUN) < experiment.draws or len(swept) < len(experiment.trainings()):
        agents = _first_draws(experiment, results[DEFAULT.name].agents, SWEEP_RUN)
        seeds = {entry.training_seed for entry in swept}
        roster = [e for e in experiment.roster(DEFAULT) if e.training_seed is None or e.training_seed in seeds]
        table = LevelTable(rows=tuple(levels(make_panel(agents, roster))))
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
            "claim_to_decide": to_decide(finding),
        }
        for finding in findings
        for part, interval, verdict in finding.parts
    ]
