"""What a study leaves behind: tables, where they come from, and a copy of what may travel with the project."""

import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from socialnav_mj.controllers.replay_irl import load_policy
from socialnav_mj.files import csv_bytes, write_json, write_whole
from socialnav_mj.provenance import recording_metadata
from socialnav_mj.recordings import Recording
from socialnav_mj.recordings.known import is_simulated
from socialnav_mj.report.blocks import Table
from socialnav_mj.report.html import html_page
from socialnav_mj.report.origins import origins_table
from socialnav_mj.report.results import Results
from socialnav_mj.studies.levels import Level
from socialnav_mj.studies.study import Study, run_folder

PUBLIC = ("README.md", "provenance.json", "tables", "figures")
"""What of most studies may travel with the project: no recordings, no episodes."""


def write_pages(out: Path, text: str, results: Mapping[str, Results], *, command: str) -> Path:
    """Write a study's page, README.md to be kept with the project and report.html to be looked at.

    Args:
        out: Folder of the study; its figures are there.
        text: Markdown.
        results: Of each run; report.html says of each of their rows where it comes from.
        command: That made the study.

    Returns:
        Path of README.md.
    """
    origins = origins_table(results, run_folder(Path(), "{run}").as_posix() + "/episodes/{file}", command)
    blocks: list[str | Table] = [text, "## Where every row comes from", origins]
    write_whole(out / "report.html", html_page(blocks, out))
    return write_whole(out / "README.md", text.encode())


def provenance_of(study: Study, results: Mapping[str, Results], *, command: str) -> dict[str, Any]:
    """Where a study's figures come from.

    Args:
        study: That was run.
        results: Of each run.
        command: That made it.

    Returns:
        JSON values: command, experiment, policies with their cards, runs with the hash of their episodes' states.
    """
    trained = {policy: load_policy(policy) for policy in study.policies}
    return {
        "command": command,
        "experiment": {k: v for k, v in asdict(study).items() if k != "data_dir"},
        "policies": {
            name: {"training_seed": policy.training_seed, "sha256": policy.checksum, "card": policy.card}
            for name, policy in sorted(trained.items(), key=lambda item: item[1].training_seed)
        },
        "runs": {name: _run_facts(result) for name, result in results.items()},
    }


def write_provenance(
    study: Study, results: Mapping[str, Results], recordings: Iterable[Recording], out: Path, *, command: str
) -> dict[str, Any]:
    """Write provenance.json of a study on several recordings.

    Args:
        study: That was run.
        results: Of each run.
        recordings: That it ran on.
        out: Folder of the study.
        command: That made it.

    Returns:
        As `provenance_of`, and the recordings.
    """
    provenance = provenance_of(study, results, command=command)
    provenance["recordings"] = [recording_metadata(recording) for recording in recordings]
    write_json(out / "provenance.json", provenance)
    return provenance


def _run_facts(results: Results) -> dict[str, Any]:
    hashes = sorted(f"{source.file} {source.metadata['state_hash']}" for source in results.sources)
    versions = {json.dumps(source.metadata.get("versions", {}), sort_keys=True) for source in results.sources}
    return {
        "episodes": len(hashes),
        "agents": results.agents.num_rows,
        "sha256_of_state_hashes": hashlib.sha256("\n".join(hashes).encode()).hexdigest(),
        "versions": [json.loads(version) for version in sorted(versions)],
    }


def traceability(provenance: Mapping[str, Any], recordings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Last section of a study's page: where everything comes from.

    Args:
        provenance: Experiment, policies and runs.
        recordings: Name, variant and checksum of each.

    Returns:
        Lines.
    """
    lines = ["## Traceability", "", f"- experiment: `{json.dumps(provenance['experiment'], sort_keys=True)}`"]
    for r in recordings:
        kind = "simulated crowd" if is_simulated(r["name"], r["variant"]) else "recording"
        lines.append(f"- {kind}: {r['name']}, variant {r['variant']}, checksum {r['checksum']}")
    for policy, facts in provenance["policies"].items():
        lines += [f"- policy {policy}: training seed {facts['training_seed']}, sha256 {facts['sha256']}"]
    for name, run in provenance["runs"].items():
        count = f"{run['episodes']} episodes, {run['agents']} agents"
        lines += [f"- run {name}: {count}, sha256 of its state hashes {run['sha256_of_state_hashes']}"]
    versions = {json.dumps(v, sort_keys=True) for run in provenance["runs"].values() for v in run["versions"]}
    lines += [f"- versions: {', '.join(f'{k} {v}' for k, v in json.loads(text).items())}" for text in sorted(versions)]
    return [*lines, "- everything, with the policies' cards: provenance.json"]


def level_rows(found: Sequence[Level], **labels: Any) -> list[dict[str, Any]]:
    """Levels as rows of a table.

    Args:
        found: The levels.
        **labels: Columns that stand before them.

    Returns:
        Column: value, of each level.
    """
    return [
        {
            **labels,
            "scenario": level.scenario,
            "method": level.method,
            "training": "all" if level.training is None else level.training,
            "measure": level.measure,
            **asdict(level.interval),
            "n_values": level.n_values,
        }
        for level in found
    ]


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]], columns: Sequence[str] = ()) -> None:
    """Write a table; numbers with six digits, NaN as nothing.

    Args:
        path: CSV file to be written.
        rows: All with the columns of the first.
        columns: Of a table that can be without rows.
    """
    write_whole(path, csv_bytes(list(columns or (rows[0] if rows else ())), rows, number=".6g"))


def publish(out: Path, folder: Path, names: Iterable[str]) -> Path:
    """Copy what may travel with the project.

    Args:
        out: Folder of a study.
        folder: Where to; what is there of the same names is replaced.
        names: Files and folders to copy.

    Returns:
        The folder.

    Raises:
        FileNotFoundError: If the study has no such outputs yet.
    """
    for name in names:
        source, target = out / name, folder / name
        if source.is_dir():
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(source, target)
        else:
            write_whole(target, source.read_bytes())
    return folder
