"""README.md of the gain sweep."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from socialnav_mj.report.markdown import table
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.gains.ranges import OF_THE_FIELD, Sweep
from socialnav_mj.studies.looks import LOOKS, SCENARIO_TITLES
from socialnav_mj.studies.panel import MIXED, REPLAY_IRL

_HOW_TO_READ = """\
Both forms of the potential field at gains drawn from a Latin hypercube in their logarithms, over {ranges}. Every \
setting drove the same agents. The draws are below 100: they are for choosing, and the reported ones stay untouched. \
One setting's mean has a standard error of several hundredths, so the ends of a range are partly luck.
"""
_CLAIMS = """\
In how many of the settings the means of all comparisons of a claim point the paper's way, whatever their intervals; \
in brackets whether they do at the default gains. The hybrids are those over the default gains. Claims that do not \
speak of the potential field are not listed. What points the paper's way at few gains is a \
statement about gains; at nearly all, about potential fields.
"""


def gains_page(
    sweeps: Sequence[Sweep], *, ranges: Mapping[str, tuple[float, float]], provenance: Mapping[str, Any]
) -> str:
    """Text of the study's README.md.

    Args:
        sweeps: Of every recording and form.
        ranges: Gain: least and greatest value.
        provenance: Command, experiment, recordings, policies, runs.

    Returns:
        Markdown.
    """
    spans = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in ranges.items())
    lines = ["# The potential field over its gains", "", f"Command: `{provenance['command']}`", ""]
    lines += [_HOW_TO_READ.format(ranges=spans), "![gains](figures/gains.png)", ""]
    lines += ["## Success", "", "Least / median / greatest over the settings, and at the default gains.", ""]
    lines += [*_ranges(sweeps, "success"), "## Share of steps within 1.2 m", ""]
    lines += [*_ranges(sweeps, "intrusion_share_of_steps"), "## Best settings", ""]
    lines += [*_best(sweeps), "## Claims about the potential field", "", _CLAIMS, *_claims(sweeps)]
    return "\n".join([*lines, *traceability(provenance, provenance["recordings"])]) + "\n"


def _ranges(sweeps: Sequence[Sweep], measure: str) -> list[str]:
    rows = []
    for sweep in sweeps:
        for scenario in sweep.scenarios:
            values = sweep.values(scenario, measure)
            spread = " / ".join(f"{v:.3f}" for v in (values.min(), np.median(values), values.max()))
            learned = [f"{sweep.learned(scenario, method, measure):.3f}" for method in (REPLAY_IRL, MIXED)]
            name = LOOKS[sweep.form].label
            rows.append(
                [sweep.recording, SCENARIO_TITLES.get(scenario, scenario), name, spread, f"{values[0]:.3f}", *learned]
            )
    heads = ["recording", "scenario", "form", "over the gains", "default gains", LOOKS[REPLAY_IRL].label, "hybrid"]
    return table(heads, rows)


def _best(sweeps: Sequence[Sweep]) -> list[str]:
    """The setting of each form whose success, averaged over scenarios, is greatest."""
    rows = []
    for sweep in sweeps:
        mean = np.mean([sweep.values(scenario, "success") for scenario in sweep.scenarios], axis=0)
        best = int(np.argmax(mean))
        each = " / ".join(f"{sweep.values(scenario, 'success')[best]:.3f}" for scenario in sweep.scenarios)
        rows.append(
            [
                sweep.recording,
                LOOKS[sweep.form].label,
                sweep.fields[best],
                each,
                f"{mean[0]:.3f}",
                f"{mean[best]:.3f}",
            ]
        )
    return table(["recording", "form", "gains", "success by scenario", "mean, default", "mean, best"], rows)


def _claims(sweeps: Sequence[Sweep]) -> list[str]:
    rows = []
    for claim in OF_THE_FIELD:
        cells = []
        for sweep in sweeps:
            each = sweep.points[claim.key]
            cells.append(f"{sum(each)} of {len(each)} ({'yes' if each[0] else 'no'})" if each else "not run")
        rows.append([f"({claim.key})", claim.sentence, *cells])
    return table(["claim", "the paper says", *(f"{s.recording}, {LOOKS[s.form].label}" for s in sweeps)], rows)
