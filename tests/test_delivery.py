"""What is handed over: the image that runs the demo, the citation, and the targets that build and check it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
INSTRUCTIONS = {"FROM", "RUN", "USER", "WORKDIR", "COPY", "CMD"}


def instructions() -> list[tuple[str, str]]:
    """Name and arguments of each instruction of the Dockerfile, lines joined where they go on."""
    text = re.sub(r"^#.*\n", "", (ROOT / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [tuple(line.split(maxsplit=1)) for line in lines if line.strip()]  # type: ignore[misc]


def test_dockerfile_runs_the_demo_as_somebody_who_is_not_root() -> None:
    found = instructions()
    names = [name for name, _ in found]
    assert set(names) <= INSTRUCTIONS and names[0] == "FROM" and names[-1] == "CMD"
    assert re.fullmatch(r"python:3\.1[12]-[\w-]+", found[0][1])  # a Python that is supported, and no "latest"
    assert found[-1][1] == '["make", "demo"]'
    assert names.index("USER") < names.index("COPY") and dict(found)["USER"] == "1000"
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"make (\w+)", " ".join(text for name, text in found if name == "RUN")):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_dockerfile_has_no_faults_that_hadolint_knows() -> None:
    hadolint = shutil.which("hadolint", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    if hadolint is None:
        pytest.skip("hadolint has no wheel for this platform")
    result = subprocess.run([hadolint, ROOT / "Dockerfile"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_image_gets_no_results_and_no_environment() -> None:
    ignored = set((ROOT / ".dockerignore").read_text(encoding="utf-8").split())
    assert {".git", ".venv", "runs", "dist"} <= ignored


def test_citation_has_what_its_format_asks_for() -> None:
    """Citation File Format 1.2.0: required keys, and the forms of version, date, DOI and licence."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    top = dict(re.findall(r"^([a-z-]+): ?(.*)$", text, re.MULTILINE))
    assert {"cff-version", "message", "title", "authors"} <= set(top) and top["cff-version"] == "1.2.0"
    allowed = {"cff-version", "message", "type", "title", "version", "date-released", "license", "authors", "keywords"}
    assert set(top) <= allowed | {"references"}
    assert top["type"] == "software" and top["license"] == "MIT"
    assert re.fullmatch(r"\d{4}-\d{2}-\d{2}", top["date-released"])
    references = text.split("references:")[1].split("  - type: ")[1:]
    for reference in references:
        kind = reference.splitlines()[0]
        assert kind in {"generic", "article"} and "    title: " in reference and "    authors:" in reference
        assert all(doi.startswith("10.") for doi in re.findall(r"doi: (\S+)", reference))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {top['version']} - {top['date-released']}" in changes


def test_demo_is_one_command_that_leaves_reports_and_traces(tmp_path: Path) -> None:
    """`make demo` as a user types it, with one cheap controller, in an environment that is installed already."""
    environment = tmp_path / "venv"
    environment.mkdir()
    (environment / "bin").symlink_to(Path(sys.executable).parent)
    (environment / f"plain-{sys.version_info[0]}.{sys.version_info[1]}.stamp").touch()
    variables = [f"PYTHON={sys.executable}", f"VENV={environment}", f"OUT={tmp_path / 'demo'}", "SHOWN=go_straight"]
    result = subprocess.run(["make", "demo", *variables], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    for part, scenarios in (("full", 1), ("short", 4)):
        folder = tmp_path / "demo" / part
        assert (folder / "report.html").is_file() and str(folder / "report.html") in result.stdout
        assert len(list(folder.glob("**/*.rrd"))) == 2 * scenarios  # of the controller and of the recorded people
    assert f"{environment / 'bin'}" in result.stdout and "make shell" in result.stdout


def test_distributions_are_built_and_checked_by_one_target() -> None:
    recipe = re.search(r"^dist:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert recipe is not None and "-m build" in recipe[1] and "-m twine check --strict" in recipe[1]
