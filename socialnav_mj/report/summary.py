"""Results of a run as JSON values."""

import json
import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from socialnav_mj.report.agents import Source, scenario_configuration
from socialnav_mj.report.estimates import Estimate
from socialnav_mj.report.intervals import LEAST
from socialnav_mj.report.results import Results

SUMMARY_FORMAT = "socialnav_mj.summary/1"


def summary_of(results: Results, estimates: Sequence[Estimate], command: str | None) -> dict[str, Any]:
    """The JSON form of a report: estimates of every group, and where they come from.

    Args:
        results: Of the run.
        estimates: Of its agents, see `estimates.summarise`.
        command: That made the episodes; None if nobody knows.

    Returns:
        JSON values: format, command, versions, recordings, groups (one for each scenario and controller), warnings.
    """
    groups = []
    for key, group in groupby(results.sources, key=lambda s: s.group):
        sources = list(group)
        own = [e for e in estimates if (e.dataset, e.variant, e.scenario, e.controller) == key]
        groups.append(
            {
                **dict(zip(("dataset", "variant", "scenario", "controller"), key, strict=True)),
                "scenario_configuration": scenario_configuration(sources[0]),
                "controller_configuration": sources[0].metadata["controller_config"],
                "recording": sources[0].metadata["recording"],
                "n_agents": max((e.n_agents for e in own), default=0),
                "draws": [s.draw for s in sources],
                "episodes": [{"file": s.file, "draw": s.draw, "state_hash": s.metadata["state_hash"]} for s in sources],
                "estimates": {e.measure: _estimate_json(e) for e in own},
            }
        )
    return {
        "format": SUMMARY_FORMAT,
        "command": command,
        "versions": _distinct(s.metadata.get("versions", {}) for s in results.sources),
        "recordings": _distinct(s.metadata["recording"] for s in results.sources),
        "groups": groups,
        "warnings": _warnings(results.sources),
    }


def _estimate_json(estimate: Estimate) -> dict[str, Any]:
    values = {name: getattr(estimate, name) for name in ("mean", "standard_error", "low", "high")}
    clean: dict[str, Any] = {name: None if math.isnan(value) else value for name, value in values.items()}
    return clean | {"n_draws": estimate.n_draws, "n_agents": estimate.n_agents, "note": estimate.note}


def _distinct(values: Any) -> list[Any]:
    return [json.loads(text) for text in sorted({json.dumps(value, sort_keys=True) for value in values})]


def _warnings(sources: Sequence[Source]) -> list[str]:
    warnings = []
    if len(_distinct(s.metadata.get("versions", {}) for s in sources)) > 1:
        warnings.append("the episodes were made by different versions of the software")
    draws_of = [len(list(group)) for _, group in groupby(sources, key=lambda s: s.group)]
    if draws_of and min(draws_of) < LEAST:
        many = "1 draw" if min(draws_of) == 1 else f"{min(draws_of)} draws"
        warnings.append(f"{many}: intervals and ties are shown from {LEAST} draws on; --draws 10 says more")
    for scenario, group in groupby(sources, key=lambda s: s.group[:3]):
        draws: dict[str, list[int]] = {}
        for source in group:
            draws.setdefault(source.group[3], []).append(source.draw)
        if len({tuple(d) for d in draws.values()}) > 1:
            listed = "; ".join(f"{name}: {', '.join(map(str, d))}" for name, d in draws.items())
            warnings.append(f"the rows of {' / '.join(scenario)} have different draws ({listed})")
    return warnings
