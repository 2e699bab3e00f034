"""What pages in Markdown share: tables, their cells, and where it all comes from."""

import json
from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any

from socialnav_mj.analysis.levels import Level


def row(cells: Sequence[str]) -> str:
    """A row of a table.

    Args:
        cells: Their text; a bar in it is escaped.

    Returns:
        One line.
    """
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def head(headings: Sequence[str]) -> list[str]:
    """What a table begins with.

    Args:
        headings: Of the columns.

    Returns:
        Two lines.
    """
    return [row(headings), row(["---"] * len(headings))]


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A whole table, with an empty line behind it.

    Args:
        headings: Of the columns.
        rows: Cells of each row.

    Returns:
        Lines.
    """
    return [*head(headings), *(row(cells) for cells in rows), ""]


def mean_cell(level: Level | None, digits: int) -> str:
    """A mean.

    Args:
        level: None if there is none.
        digits: Behind the point.

    Returns:
        "-" where there is nothing to tell.
    """
    return "-" if level is None or isnan(level.interval.mean) else f"{level.interval.mean:.{digits}f}"


def interval_cell(level: Level | None) -> str:
    """A mean, and its interval for other draws and other trainings as far as there is one.

    Args:
        level: None if there is none.

    Returns:
        Three digits behind the point.
    """
    if level is None or isnan(level.interval.low):
        return mean_cell(level, 3)
    return f"{mean_cell(level, 3)} ({level.interval.low:.3f} to {level.interval.high:.3f})"


def traceability(provenance: Mapping[str, Any], recordings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Last section of a study's page: where everything comes from.

    Args:
        provenance: Experiment, policies and runs.
        recordings: Name, variant and checksum of each.

    Returns:
        Lines.
    """
    lines = ["## Traceability", "", f"- experiment: `{json.dumps(provenance['experiment'], sort_keys=True)}`"]
    lines += [f"- recording: {r['name']}, variant {r['variant']}, checksum {r['checksum']}" for r in recordings]
    for policy, facts in provenance["policies"].items():
        lines += [f"- policy {policy}: training seed {facts['training_seed']}, sha256 {facts['sha256']}"]
    for name, run in provenance["runs"].items():
        count = f"{run['episodes']} episodes, {run['agents']} agents"
        lines += [f"- run {name}: {count}, sha256 of its state hashes {run['sha256_of_state_hashes']}"]
    versions = {json.dumps(v, sort_keys=True) for run in provenance["runs"].values() for v in run["versions"]}
    lines += [f"- versions: {', '.join(f'{k} {v}' for k, v in json.loads(text).items())}" for text in sorted(versions)]
    return [*lines, "- everything, with the policies' cards: provenance.json"]
