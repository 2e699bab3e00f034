"""Pages as a reader sees them, in a real headless Chromium: the report, and traces in rerun's web viewer."""

import io
import json
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import browser  # noqa: F401  a fixture
from episodes import Agent, Pedestrian, Touch, build_episode, line
from PIL import Image
from test_html import episode

from socialnav_mj.report.writer import write_report
from socialnav_mj.trace.layout import SKY
from socialnav_mj.trace.start import HOST
from socialnav_mj.trace.web import web_viewer
from socialnav_mj.trace.writer import write_trace

HOSTILE = "<script>window.hacked=1</script><img src=x onerror=window.hacked=1>"
PATIENCE = 240
"""For a viewer without a graphics card on a busy machine [s]."""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """report.html of three controllers over three draws, one with a hostile name, and the recorded people."""
    folder = tmp_path_factory.mktemp("run")
    for place, (controller, more) in enumerate({"fast": 0, "slow": 10, HOSTILE: 5, "human": 2}.items()):
        for draw in range(3):
            made = episode(controller, draw, steps=20 + draw + more)
            made.save(folder / "episodes" / f"{place}.{draw}.npz")
    run = {"command": f"socialnav-mj evaluate {HOSTILE}", "controllers": ["fast", "slow", HOSTILE], "episodes": []}
    (folder / "run.json").write_text(json.dumps(run))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("socialnav_mj.trace.writer.write_trace", lambda episode, path: None)
        return write_report(folder).page


@pytest.fixture
def page(browser, report):  # noqa: F811  pytest's way
    """The open report, and what the browser complained of."""
    opened = browser.new_page(viewport={"width": 1500, "height": 1000})
    complaints: list[str] = []
    opened.on("console", lambda message: complaints.append(message.text))
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("request", lambda request: complaints.append(request.url) if "://" in request.url[:8] else None)
    opened.goto(report.as_uri())
    # The page itself is the one thing that is loaded.
    assert complaints == [report.as_uri()]
    yield opened
    assert complaints == [report.as_uri()]
    opened.close()


def names(page):
    return page.locator("table").first.locator("tbody tr td:first-child").all_text_contents()


def test_report_sorts_by_a_click_and_by_the_keyboard(page):
    assert names(page) == ["fast", "slow", HOSTILE, "human"]
    heading = page.locator("table").first.locator("th", has_text="time, censored")
    heading.click()
    page.wait_for_function("document.querySelector('th[aria-sort=descending]')")
    page.wait_for_timeout(50)
    assert names(page) == ["slow", HOSTILE, "human", "fast"]
    heading.press("Enter")
    page.wait_for_function("document.querySelector('th[aria-sort=ascending]')")
    page.wait_for_timeout(50)
    assert names(page) == ["fast", "human", HOSTILE, "slow"]


def test_report_shows_its_figures_and_intervals(page):
    widths = page.locator("img").evaluate_all("images => images.map(image => image.naturalWidth)")
    assert widths and min(widths) > 100
    bars = page.locator("table").first.locator("svg.bar").first.bounding_box()
    assert bars["width"] > 20 and bars["height"] > 3


def test_first_table_fits_a_laptop_and_keeps_the_names_in_sight_where_it_does_not(page):
    page.set_viewport_size({"width": 1400, "height": 900})
    wide = page.locator(".wide").first
    assert wide.evaluate("e => e.scrollWidth - e.clientWidth") == 0
    page.set_viewport_size({"width": 700, "height": 900})
    assert wide.evaluate("e => e.scrollWidth - e.clientWidth") > 100
    name = wide.locator("tbody td").first
    before = name.bounding_box()
    wide.evaluate("e => { e.scrollLeft = 100 }")
    assert name.bounding_box() == before


def test_report_runs_no_script_of_a_name(page):
    assert page.evaluate("window.hacked") is None
    assert page.locator("table").first.get_by_text("<script>").count() >= 1


def test_report_unfolds_where_a_row_comes_from(page):
    origin = page.locator("td.from details").first
    assert not origin.locator("p").first.is_visible()
    origin.locator("summary").click()
    assert "socialnav-mj view traces/0.0.rrd" in origin.inner_text()


def test_report_is_dark_for_who_likes_it_dark(page):
    colour = "getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(colour) == "rgb(255, 255, 255)"
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(colour) == "rgb(22, 24, 27)"


def listening(ports):
    """Addresses, as the kernel writes them, that somebody listens at on some ports."""
    found = set()
    for name in ("tcp", "tcp6"):
        for row in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            address, port = row.split()[1].split(":")
            if int(port, 16) in ports and row.split()[3] == "0A":
                found.add(address)
    return found


@pytest.fixture(scope="module")
def viewer(tmp_path_factory):
    """Address of the web viewer of one trace."""
    folder = tmp_path_factory.mktemp("view")
    made = build_episode(
        [Agent(positions=line((0, 0), (6, 0), 40)), Agent(positions=line((0, 3), (6, 3), 50))],
        [Pedestrian(positions=line((3, 1), (3, -2), 50))],
        [Touch(agent=0, partner=0, step=12.0)],
    )
    with web_viewer([write_trace(made, folder / "one.rrd")], 0) as address:
        yield address


def test_web_viewer_listens_on_this_machine_alone(viewer):
    assert listening({int(viewer.rpartition(":")[2])}) == {"0100007F"}


def test_web_viewer_draws_a_trace_without_the_network(browser, viewer):  # noqa: F811  pytest's way
    opened = browser.new_page(viewport={"width": 1000, "height": 640})  # software draws every pixel
    hosts: set[str] = set()
    # What the page's policy stops is no request that went out.
    opened.on("response", lambda response: hosts.add(urlsplit(response.url).hostname or ""))
    opened.set_default_timeout(1000 * PATIENCE)
    opened.goto(viewer)
    opened.wait_for_selector("canvas")
    deadline = time.monotonic() + PATIENCE
    while not is_drawn(pixels := np.asarray(Image.open(io.BytesIO(opened.screenshot())).convert("RGB"))):
        assert time.monotonic() < deadline, f"{len(np.unique(pixels.reshape(-1, 3), axis=0))} colours"
        opened.wait_for_timeout(1000)
    assert hosts - {""} == {HOST}
    opened.close()


def is_drawn(pixels):
    """Whether robots' blue is there, which no part of the viewer's own has."""
    return int((np.abs(pixels.astype(int) - SKY).max(axis=2) <= 12).sum()) > 30
