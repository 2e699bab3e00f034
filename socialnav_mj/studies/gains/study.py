"""The gain sweep: both potential fields at many gains, beside the learned controllers."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from socialnav_mj.controllers.replay_irl import load_policy
from socialnav_mj.evaluation import Evaluation
from socialnav_mj.recordings import load_recording
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.studies.files import write_csv, write_pages, write_provenance
from socialnav_mj.studies.gains.figure import draw_gains
from socialnav_mj.studies.gains.page import gains_page
from socialnav_mj.studies.gains.ranges import Sweep, sweep_of
from socialnav_mj.studies.held_out import recording_name
from socialnav_mj.studies.panel import CAPPED, MIXED, POTENTIAL_FIELD, REPLAY_IRL, Entry
from socialnav_mj.studies.study import Run, Study, learned, read_runs

FORMS = (POTENTIAL_FIELD, CAPPED)
"""The paper's field and ours."""
RANGES = {
    "position_gain": (0.25, 4.0),
    "velocity_gain": (0.125, 2.0),
    "repulsion_gain": (0.5, 8.0),
    "influence_distance": (1.0, 4.0),
}
"""Gain: least and greatest value, the default in the geometric middle; k_p, k_v, eta, rho_0 [m]."""


@dataclass(frozen=True, kw_only=True)
class GainSweep(Study):
    """What is to be run; all policies are of one turn limit, the default one."""

    recordings: tuple[str, ...]
    """Names in the catalogue, or paths."""
    settings: int = 40
    """Gains that are drawn for each form; its default is added."""
    sample_seed: int = 0
    """Of the Latin hypercube."""

    def __post_init__(self) -> None:
        if self.settings < 1:
            raise ValueError(f"settings = {self.settings} is not allowed; allowed: integers >= 1")
        if not self.policies:
            raise ValueError("policies = () is not allowed; allowed: one or more trained policies")
        seeds = [load_policy(policy).training_seed for policy in self.policies]
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"policies {self.policies} have training seeds {seeds}; allowed: one of each")

    @cached_property
    def gains(self) -> tuple[dict[str, float], ...]:
        """Settings by name: a Latin hypercube in the logarithms of `RANGES`, to three digits."""
        sample = qmc.LatinHypercube(d=len(RANGES), rng=np.random.default_rng(self.sample_seed)).random(self.settings)
        low, high = np.log(np.array(list(RANGES.values()))).T
        values = np.exp(low + sample * (high - low))
        return tuple(dict(zip(RANGES, (float(f"{v:.3g}") for v in row), strict=True)) for row in values)

    def fields(self, form: str) -> tuple[str, ...]:
        """Controllers of one form.

        Args:
            form: Of `FORMS`.

        Returns:
            Specs: the default gains first.
        """
        drawn = (", ".join(f"{name}={value!r}" for name, value in gains.items()) for gains in self.gains)
        return form, *(f"{form}({settings})" for settings in drawn)

    def roster(self, form: str, field: str) -> tuple[Entry, ...]:
        """One field beside the learned controllers; the hybrids are those over the form's default gains.

        Args:
            form: Of `FORMS`.
            field: Of `fields`.

        Returns:
            The paper's three methods, with the field in its field's place, and the human row.
        """
        trained = [(load_policy(policy).training_seed, learned(policy)) for policy in self.policies]
        return (
            Entry(controller=field, method=POTENTIAL_FIELD),
            *(Entry(controller=own, method=REPLAY_IRL, training_seed=seed) for seed, own in trained),
            *(
                Entry(controller=f"hybrid(near={own!r}, far={form!r})", method=MIXED, training_seed=seed)
                for seed, own in trained
            ),
            Entry(controller=HUMAN, method=HUMAN),
        )

    def runs(self) -> list[Run]:
        """One evaluation for each recording.

        Returns:
            In the order of the recordings, and named after them.
        """
        entries = {e.controller: e for form in FORMS for field in self.fields(form) for e in self.roster(form, field)}
        controllers = tuple(name for name, entry in entries.items() if entry.method != HUMAN)
        return [
            Run(
                name=recording_name(recording),
                evaluation=Evaluation(
                    dataset=recording,
                    data_dir=self.data_dir,
                    scenarios=self.scenarios,
                    controllers=controllers,
                    draws=self.draws,
                    seed=self.seed,
                ),
                roster=tuple(entries.values()),
            )
            for recording in self.recordings
        ]


def write_gain_sweep(study: GainSweep, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        study: That was run by `study.reproduce`.
        out: Its folder; gets tables/, figures/, README.md, report.html and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
    """
    results = read_runs(study, out, n_jobs=n_jobs)
    sweeps = _sweeps(study, results)
    write_csv(out / "tables" / "gains.csv", [row for sweep in sweeps for row in sweep.rows()])
    write_csv(out / "tables" / "claims.csv", [row for sweep in sweeps for row in sweep.claim_rows()])
    draw_gains(sweeps, out / "figures")
    recordings = [load_recording(recording, data_dir=study.data_dir) for recording in study.recordings]
    provenance = write_provenance(study, results, recordings, out, command=command)
    page = gains_page(sweeps, ranges=RANGES, provenance=provenance)
    return write_pages(out, page, results, command=command)


def _sweeps(study: GainSweep, results: Mapping[str, Results]) -> list[Sweep]:
    return [
        sweep_of(
            results[run.name].agents,
            recording=run.name,
            form=form,
            rosters={field: study.roster(form, field) for field in study.fields(form)},
        )
        for run in study.runs()
        for form in FORMS
    ]
