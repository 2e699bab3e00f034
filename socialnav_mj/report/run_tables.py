"""report.html: what report.md says, with intervals drawn, ties shaded, and rows that say where they come from."""

import re
from collections.abc import Sequence

from socialnav_mj.report.blocks import Cell, Origin, Row, Table
from socialnav_mj.report.estimates import MEASURES, Estimate, Measure
from socialnav_mj.report.intervals import LEAST
from socialnav_mj.report.markdown import bounds, number
from socialnav_mj.report.origins import origins
from socialnav_mj.report.page import SHOWN, by_scenario, report_blocks
from socialnav_mj.report.results import Results
from socialnav_mj.report.run_file import RunFile
from socialnav_mj.report.summary import summary_of
from socialnav_mj.report.ties import Place, Standing, standings

_CELLS = f"""\
Every cell is the mean over draws; a draw is one random choice of the people who are replaced, and its mean over \
agents is one number. The line under a mean is its 95 % interval, to one scale in each column; point at a cell to \
read it. **Bold** is the best controller of a column. A shaded one is tied with it: the 95 % interval of their \
paired difference over the same draws covers 0, each comparison by itself (from {LEAST} draws; the human row takes \
no part). In tables of differences a shaded cell is an interval that covers 0. A click on a heading sorts. The \
column *from* unfolds to the command that runs the row again, the hash of all its states, and the trace of its first \
draw. """


def run_blocks(
    results: Results, estimates: Sequence[Estimate], sections: Sequence[str], run: RunFile | None
) -> list[str | Table]:
    """What report.html consists of.

    Args:
        results: Of the run.
        estimates: Of its agents.
        sections: Lines of Markdown that stand between the tables and how to read them.
        run: What run.json says; None if there is none.

    Returns:
        Blocks of `html.html_page`.
    """
    summary = summary_of(results, estimates, None if run is None else run.command)
    found, standing = origins(results.sources, run), standings(results.agents)
    tables = [_table(place, rows, standing, found) for place, rows in by_scenario(estimates)]
    return report_blocks(summary, estimates, tables, sections, cells=_CELLS)


def _told(measure: Measure) -> str:
    """What a heading stands for, as docs/metrics.md defines it, without its Markdown."""
    whom = "; over successes alone" if measure.mean.successes else ""
    share = f"; share of agents with {measure.mean.share_of!r}" if measure.mean.share_of else ""
    return re.sub(r"[*`$]", "", measure.metric.formula) + share + whom


def _table(
    place: Place,
    rows: Sequence[tuple[str, dict[str, Estimate]]],
    standing: dict[tuple[Place, str], Standing],
    found: dict[tuple[str, str, str, str], Origin],
) -> Table:
    shown = [MEASURES[name] for name in SHOWN]
    return Table(
        headings=("controller", *(measure.heading for measure in shown), "draws", "agents"),
        told=("", *(_told(measure) for measure in shown), "", "of all draws together"),
        rows=tuple(
            Row(
                cells=(
                    Cell(shown=controller, is_text=True),
                    *(_cell(own[m.name], m.digits, standing.get((place, m.name)), controller) for m in shown),
                    *(_count(count) for count in (own["success"].n_draws, own["success"].n_agents)),
                ),
                origin=found.get((*place, controller)),
            )
            for controller, own in rows
        ),
    )


def _cell(estimate: Estimate, digits: int, standing: Standing | None, controller: str) -> Cell:
    reads = bounds(estimate.low, estimate.high, digits)
    known = f"95 % interval {reads}" if reads != "-" else estimate.note
    return Cell(
        shown=number(estimate.mean, digits),
        value=estimate.mean,
        low=estimate.low,
        high=estimate.high,
        reads=reads,
        note=f"{known}; {estimate.n_draws} draws, {estimate.n_agents} agents",
        tied=standing is not None and controller in standing.ties,
        best=standing is not None and controller == standing.best,
    )


def _count(count: int) -> Cell:
    return Cell(shown=str(count), value=count)
