"""The documentation site builds without a warning and needs no network; the notebook runs from its first cell on."""

import re
import subprocess
import sys
from pathlib import Path

import lxml.html
import pytest
from test_architecture import ROOT

TINY = Path(__file__).parent / "data" / "tiny" / "tiny.txt"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("mkdocs", reason="needs the extra 'docs'")
    pytest.importorskip("mkdocstrings", reason="needs the extra 'docs'")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder


def test_site_loads_nothing_from_elsewhere(site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 15
    for page in pages:
        shown = lxml.html.fromstring(page.read_bytes())
        loaded = [*shown.xpath("//script/@src | //img/@src"), *shown.xpath("//link[@rel='stylesheet']/@href")]
        assert not [address for address in loaded if re.match(r"(https?:)?//", address)], page


def test_site_has_the_docstrings_and_the_pages_beside_the_code(site):
    api = lxml.html.fromstring((site / "api.html").read_bytes())
    text = " ".join(api.text_content().split())
    assert "One run of one controller in one scenario." in text
    for name in ("report.writer.write_report", "film.film.Shot"):
        assert api.xpath(f"//*[@id='socialnav_mj.{name}']"), name
    index = lxml.html.fromstring((site / "index.html").read_bytes())
    titles = {" ".join(a.text_content().split()) for a in index.xpath("//nav//a")}
    assert {"Quick start", "Concepts", "Contributing", "The paper's study", "Metrics"} <= titles
    assert (site / "results" / "students003" / "figures" / "figure_1_success.png").is_file()


def test_notebook_runs_to_its_figure(tmp_path):
    nbformat = pytest.importorskip("nbformat", reason="needs the extra 'docs'")
    nbclient = pytest.importorskip("nbclient", reason="needs the extra 'docs'")
    pytest.importorskip("ipykernel", reason="needs the extra 'docs'")
    notebook = nbformat.read(ROOT / "docs" / "first_steps.ipynb", as_version=4)
    first = next(cell for cell in notebook.cells if cell.cell_type == "code")
    small = first.source.replace('"plaza"', repr(str(TINY))).replace("), 3", "), 1")
    assert small != first.source and not any(cell.get("outputs") for cell in notebook.cells)
    first.source = small
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    out = tmp_path / "runs" / "first_steps"
    assert (out / "ways.png").read_bytes().startswith(b"\x89PNG") and (out / "report.html").is_file()
