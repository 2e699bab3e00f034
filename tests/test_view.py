"""`view` and `render`: which files are opened, on this machine alone, and what is told if that does not go."""

import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from urllib.error import HTTPError
from urllib.parse import parse_qs, urlsplit
from urllib.request import Request, urlopen

import pytest
from episodes import Agent, Pedestrian, build_episode, line

from socialnav_mj.cli.view import Render, View, episode_of, traces_of
from socialnav_mj.episode import EpisodeError
from socialnav_mj.report.start import start_page
from socialnav_mj.trace.start import Facts, read_facts, viewer_command
from socialnav_mj.trace.web import web_viewer
from socialnav_mj.trace.writer import write_trace


def made(controller="hybrid"):
    agents = [Agent(positions=line((0, 0), (4, 0), 20))]
    people = [Pedestrian(positions=line((3, 2), (3, -2), 20))]
    return build_episode(agents, people, [], controller=controller)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of two controllers and the recorded people, with traces."""
    folder = tmp_path_factory.mktemp("run")
    for controller in ("a|b", "hybrid", "human"):
        episode = made(controller)
        name = f"scenario_1.{controller.replace('|', '')}.draw_000"
        episode.save(folder / "episodes" / f"{name}.npz")
        write_trace(episode, folder / "traces" / f"{name}.rrd")
    return folder


@pytest.fixture
def started(monkeypatch):
    """Commands that would have been run; each ends with exit code 0."""
    commands = []

    def note(command, *, env, check):
        assert env["CI"] and not check
        commands.append(command)
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(subprocess, "run", note)
    return commands


def test_facts_are_the_episodes(run):
    facts = read_facts(run / "traces" / "scenario_1.hybrid.draw_000.rrd")
    episode = made()
    assert (facts.controller, facts.draw, facts.success) == ("hybrid", episode.metadata["draw"], 1.0)
    assert facts.state_hash == episode.metadata["state_hash"] and facts.scenario == episode.metadata["scenario_name"]


def test_start_page_lists_the_best_first_and_escapes_names(run):
    def facts(controller, success, scenario="scenario_1"):
        path = run / "traces" / "x.rrd"
        return Facts(
            path=path,
            scenario=scenario,
            controller=controller,
            draw=0,
            dataset="plaza",
            success=success,
            state_hash="f" * 64,
        )

    found = [facts("weak", 0.25), facts("none", float("nan")), facts("a|b <i>", 0.75), facts("z", 1.0, "scenario_2")]
    rows = [line for line in start_page("runs/<b>", found).splitlines() if line.startswith("| scenario_")]
    assert [row.split(" | ")[1] for row in rows] == ["a\\|b &lt;i>", "weak", "none", "z"]
    assert rows[0].split(" | ")[3] == "0.750" and rows[2].split(" | ")[3] == "-"
    assert "# runs/&lt;b>" in start_page("runs/<b>", found)


def test_all_traces_of_a_run_are_opened_behind_the_start_page(run, tmp_path):
    paths = traces_of(run, tmp_path)
    assert paths[0] == tmp_path / "start.rrd" and paths[0].stat().st_size > 0
    assert paths[1:] == sorted((run / "traces").glob("*.rrd"))


def test_an_episode_is_made_a_trace_and_a_trace_is_opened_as_it_is(run, tmp_path):
    episode = run / "episodes" / "scenario_1.hybrid.draw_000.npz"
    assert traces_of(episode, tmp_path)[1] == tmp_path / "scenario_1.hybrid.draw_000.rrd"
    trace = run / "traces" / "scenario_1.hybrid.draw_000.rrd"
    assert traces_of(trace, tmp_path)[1:] == [trace]


def test_what_is_no_trace_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no traces in .*`socialnav-mj report .*` writes them"):
        traces_of(tmp_path, tmp_path)
    (tmp_path / "x.rrd").write_bytes(b"no trace")
    with pytest.raises(EpisodeError, match=r"x\.rrd"):
        traces_of(tmp_path / "x.rrd", tmp_path)


def test_without_a_display_the_browser_is_named_before_anything_starts(run, started, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(RuntimeError, match="no display for a window; --web shows the traces in a browser"):
        View(path=run).run()
    assert not started


def test_window_is_bound_to_this_machine(run, started, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":9")
    View(path=run, port=9124).run()
    (command,) = started
    assert command[command.index("--bind") + 1] == "127.0.0.1" and command[command.index("--port") + 1] == "9124"
    assert "--serve-web" not in command
    assert command[-3:] == [str(path) for path in sorted((run / "traces").glob("*.rrd"))]
    assert viewer_command([], web_port=1, port=2)[-1] == "1"


def test_viewer_that_fails_is_told(run, monkeypatch):
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=7))
    monkeypatch.setenv("DISPLAY", ":9")
    with pytest.raises(RuntimeError, match="ended with exit code 7; --web shows the traces in a browser"):
        View(path=run).run()


def test_browsers_viewer_tells_its_address_until_it_is_stopped(run, monkeypatch, capsys):
    @contextmanager
    def serve(paths, port):
        assert paths[0].name == "start.rrd" and len(paths) == 4
        yield f"http://127.0.0.1:{port}"

    class Stopped:
        def wait(self):
            raise KeyboardInterrupt

    monkeypatch.setattr("socialnav_mj.trace.web.web_viewer", serve)
    monkeypatch.setattr("socialnav_mj.cli.view.Event", Stopped)
    View(path=run, web=True, port=9123).run()
    assert "traces: 3, shown at http://127.0.0.1:9123 until Ctrl-C" in capsys.readouterr().out


@pytest.fixture(scope="module")
def served(run):
    """Address of the web viewer of the run."""
    with web_viewer(sorted((run / "traces").glob("*.rrd")), 0) as address:
        yield address


def test_web_viewer_leaves_no_process_behind(run):
    def running():
        found = set()
        for path in Path("/proc").glob("[0-9]*/cmdline"):
            with suppress(OSError):  # it has ended
                if b"--web-viewer-port" in path.read_bytes():
                    found.add(path.parent.name)
        return found

    before = running()
    with web_viewer([], 0):
        assert running() - before
    until = time.monotonic() + 60.0
    while running() - before and time.monotonic() < until:
        time.sleep(0.1)
    assert not running() - before


def fetch(address, **headers):
    with urlopen(Request(address, headers=headers)) as found:
        return found.url, found.headers, found.read()


def test_web_viewer_hands_on_its_page_with_a_policy_and_serves_the_recordings(served, run):
    url, headers, content = fetch(served)
    first = parse_qs(urlsplit(url).query)["url"][0]
    assert b"re_viewer.js" in content and "hide_welcome_screen" in url
    assert "connect-src 'self' data: blob:;" in headers["Content-Security-Policy"]
    trace = min((run / "traces").glob("*.rrd"))
    assert first == f"{served}/files/0/{trace.name}" and fetch(first)[2] == trace.read_bytes()


@pytest.mark.parametrize(("path", "host", "code"), [("/", "evil.example", 403), ("/files/9/x", "", 404)])
def test_web_viewer_refuses_other_names_and_what_is_not_there(path, host, code, served):
    with pytest.raises(HTTPError) as error:
        fetch(served + path, **({"Host": host} if host else {}))
    assert error.value.code == code


def test_viewer_that_does_not_start_is_told(monkeypatch):
    monkeypatch.setattr("socialnav_mj.trace.web.viewer_command", lambda *_, **__: [sys.executable, "-c", "exit(3)"])
    with pytest.raises(RuntimeError, match=r"did not start \(exit code 3\)"), web_viewer([], 0):
        pass


def test_episode_of_a_run_is_the_named_one_or_the_first_of_a_controller(run):
    assert episode_of(run, None).stem == "scenario_1.ab.draw_000"
    assert episode_of(run, "scenario_1.human.draw_000").stem == "scenario_1.human.draw_000"
    with pytest.raises(FileNotFoundError, match=r"no episode x in .*; there are scenario_1\.ab\.draw_000, "):
        episode_of(run, "x")


def test_render_draws_a_film_and_a_gif_of_their_own_sizes(run, monkeypatch, tmp_path, capsys):
    drawn = []

    def note(episode, shot, path):
        drawn.append((path.name, shot.width, shot.height, shot.rate, shot.agent))
        yield 1

    monkeypatch.setattr("socialnav_mj.film.film.write_film", note)
    person = int(made().agent_person[0])
    Render(path=run, agent=person, gif=True, out=tmp_path / "x.mp4").run()
    assert drawn == [("x.mp4", 1280, 720, 25.0, person), ("x.gif", 640, 360, 10.0, person)]
    Render(path=run, out=tmp_path / "x.png", size=(320, 180)).run()
    assert drawn[2][:3] == ("x.png", 320, 180)
    assert "scenario_1.ab.draw_000.npz" in capsys.readouterr().out
