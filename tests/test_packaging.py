"""What a user gets from `pip install`: the wheel's content, and its command run far from any checkout."""

import json
import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[1]
TINY = ROOT / "tests" / "data" / "tiny" / "tiny.txt"


def run(*command: str | Path, cwd: Path = ROOT) -> str:
    """Run a command without the checkout on its path; its output, or a failure that shows its errors."""
    environment = {k: v for k, v in os.environ.items() if k not in {"PYTHONPATH", "PYTHONHOME", "SOCIALNAV_MJ_DATA"}}
    result = subprocess.run([*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    return result.stdout


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source distribution and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, ROOT)
    return folder


@pytest.fixture(scope="module")
def installed(distributions: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Environment that holds the wheel itself and finds its dependencies, and nothing editable, in this one."""
    environment = tmp_path_factory.mktemp("clean") / "environment"
    run(sys.executable, "-m", "venv", "--without-pip", environment)
    python = environment / "bin" / "python"
    (wheel,) = distributions.glob("*.whl")
    run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel)
    (packages,) = environment.glob("lib/python*/site-packages")
    # Folders that one .pth file adds are not searched for further .pth files: the editable install stays hidden.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return environment / "bin"


def test_wheel_holds_packages_assets_and_data_alone(distributions):
    (wheel,) = distributions.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = [PurePosixPath(name) for name in archive.namelist()]
    assert {name.parts[0] for name in names if not name.parts[0].endswith(".dist-info")} == {"socialnav_mj", "tasks"}
    for folder in ("assets", "data"):
        shipped = {name.relative_to("socialnav_mj") for name in names if name.is_relative_to(f"socialnav_mj/{folder}")}
        here = {PurePosixPath(p.relative_to(ROOT)) for p in (ROOT / folder).rglob("*") if p.is_file()}
        assert {n for n in shipped if "__pycache__" not in n.parts} == {n for n in here if "__pycache__" not in n.parts}
        assert shipped
    assert any(name.name == "LICENSE" for name in names)


def test_source_distribution_holds_no_results(distributions):
    (source,) = distributions.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        names = [PurePosixPath(name).parts[1:] for name in archive.getnames()]
    top = {parts[0] for parts in names if parts}
    assert {"socialnav_mj", "tasks", "assets", "data", "LICENSE", "pyproject.toml"} <= top
    assert not top & {"runs", "reproduction", ".venv", ".git"}


def test_wheel_is_what_gets_imported(installed, tmp_path):
    code = "import socialnav_mj, tasks; print(socialnav_mj.__file__, tasks.__file__, sep='\\n')"
    for path in run(installed / "python", "-c", code, cwd=tmp_path).split():
        assert Path(path).is_relative_to(installed.parent)


def test_wheel_lists_tasks_and_controllers(installed, tmp_path):
    listing = run(installed / "socialnav-mj", "list", cwd=tmp_path)
    for name in ("scenario_1", "scenario_4", "potential_field", "go_straight", "plaza"):
        assert name in listing


def test_wheel_evaluates_a_recording_from_another_folder(installed, tmp_path):
    flags = ("--dataset", TINY, "--scenarios", "4", "--controllers", "go_straight", "--draws", "1", "--jobs", "1")
    run(installed / "socialnav-mj", "evaluate", *flags, "--out", "result", cwd=tmp_path)
    result = tmp_path / "result"
    assert len(list((result / "episodes").glob("*.npz"))) == len(list((result / "traces").glob("*.rrd"))) == 2
    summary = json.loads((result / "summary.json").read_text())
    assert sorted(group["controller"] for group in summary["groups"]) == ["go_straight", "human"]
    assert all(path.stat().st_size for path in map(result.joinpath, ("agents.parquet", "summary.csv", "report.md")))
