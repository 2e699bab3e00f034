"""README, CONTRIBUTING and docs: code blocks run, commands are parsed, links lead to files, figures are current."""

import csv
import dataclasses
import re
import shlex
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from house import PAGE, with_figure
from test_architecture import ROOT

from socialnav_mj import cli
from socialnav_mj.cli.arguments import Where
from socialnav_mj.studies.study import CONTROLLERS

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
RUNS: dict[type, Callable[[Any], None]] = {get_args(kind)[0]: get_args(kind)[0].run for kind in get_args(cli.Command)}
# What is changed where a command of a page is run: a crowd of three people, one scenario, one process. Others are
# parsed alone, since they download, train or take minutes; so is `evaluate` without --out, which no later line needs.
SMALL = {
    "Evaluate": {"dataset": TINY, "scenarios": (1,), "jobs": 1},
    "Report": {"jobs": 1},
    "Verify": {"dataset": TINY, "jobs": 1},
    "Draws": {},
    "List": {},
}
MOST_DRAWS = 2
LANGUAGES = ("python", "bash", "yaml", "text")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"`([^`]+)`")
LINK = re.compile(r"\]\(([^)#]+)[^)]*\)|src=\"([^\"]+)\"")
FOLDERS = ("assets/", "data/", "docs/", "results/", "socialnav_mj/", "tasks/", "tests/")


def blocks(page: Path) -> Iterator[tuple[str, str, str]]:
    """Place, language and text of each fenced block."""
    text = page.read_text(encoding="utf-8")
    for found in FENCE.finditer(text):
        yield f"{page.name}:{text[: found.start()].count(chr(10)) + 2}", found[1], found[2]


def code_spans(page: Path) -> list[str]:
    """What stands between single backticks, on one line each."""
    return [" ".join(span.split()) for span in CODE.findall(FENCE.sub("", page.read_text(encoding="utf-8")))]


def lines(text: str) -> Iterator[list[str]]:
    """Words of every command of a bash block."""
    for line in text.replace("\\\n", " ").splitlines():
        if words := shlex.split(line, comments=True):
            yield words


@pytest.fixture
def parse(monkeypatch):
    """A function that gives what the command's own parser makes of words, without running it."""
    seen: list[object] = []
    for kind in RUNS:
        monkeypatch.setattr(kind, "run", lambda self: seen.append(self))
    monkeypatch.setattr(Where, "used", lambda self: nullcontext())  # no cluster is looked for

    def parsed(words: list[str]) -> object:
        cli.main(words)
        return seen.pop()

    return parsed


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder from which modules can be imported; they are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr(sys, "argv", ["socialnav-mj"])
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


def targets_of_make() -> set[str]:
    return set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def run(words: list[str], parse: Callable[[list[str]], Any]) -> None:
    """Run a command small, or check what can be checked of it without running it."""
    program, *arguments = words
    if program == "socialnav-mj":
        command = parse(arguments)
        changes = SMALL.get(type(command).__name__)
        if changes is not None and getattr(command, "out", Path()) is not None:
            if hasattr(command, "draws"):
                changes = changes | {"draws": min(command.draws, MOST_DRAWS)}
            RUNS[type(command)](dataclasses.replace(command, **changes))
    elif program == "make":
        assert set(arguments) <= targets_of_make(), arguments
    elif program == "pip":
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
            "optional-dependencies"
        ]
        place = re.fullmatch(r"install -c constraints\.txt -e \.\[([a-z,]+)\]", " ".join(arguments))
        assert place is not None and set(place[1].split(",")) <= set(extras), arguments
    elif program == "rerun":
        assert all(Path(file).is_file() for file in arguments), f"no {arguments}"
    else:
        assert program == ".venv/bin/python", f"{words} is neither run nor checked"
        assert all((ROOT / word).exists() for word in arguments if "/" in word), arguments


def scripts(language: str, text: str) -> Iterator[str]:
    """Scripts of the shell that a block is, or that a YAML block has in it."""
    if language == "bash":
        yield text
        return
    waiting = list(yaml.safe_load_all(text))
    while waiting:
        part = waiting.pop()
        if isinstance(part, str) and "\n" in part:
            yield part
        elif isinstance(part, dict | list):
            waiting += part.values() if isinstance(part, dict) else part


def commands(script: str) -> list[list[str]]:
    """Words of our own commands in a script that the shell can read."""
    checked = subprocess.run(["bash", "-n"], input=script, capture_output=True, text=True, check=False)
    assert checked.returncode == 0 and not checked.stderr, checked.stderr
    found = [line.strip() for line in script.replace("\\\n", " ").splitlines()]
    return [shlex.split(line)[1:] for line in found if line.startswith("socialnav-mj ")]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_code_blocks_run_in_their_order(page, here, parse, monkeypatch):
    """A Python block that begins with a file's name is written to that file; one marked `text` is not run.

    Of YAML and of a script, which begins with `#!`, our own commands are parsed, and the rest is read by the shell.
    """
    names: dict[str, object] = {"__name__": "docs"}
    for place, language, text in blocks(page):
        assert language in LANGUAGES, f"{place} is marked {language!r}; allowed: {', '.join(LANGUAGES)}"
        if language == "python" and (file := re.match(r"# (\w+\.py)\n", text)):
            (here / file[1]).write_text(text, encoding="utf-8")
            monkeypatch.delitem(sys.modules, Path(file[1]).stem, raising=False)  # another test's module of that name
        elif language == "python":
            exec(compile(text, place, "exec", dont_inherit=True), names)
        elif language == "yaml" or (language == "bash" and text.startswith("#!")):
            for script in scripts(language, text):
                for arguments in commands(script):
                    parse(arguments)
        elif language == "bash":
            for words in lines(text):
                run(words, parse)


def test_recipes_for_clusters_call_one_and_the_same_command():
    found = [
        arguments
        for _, language, text in blocks(ROOT / "docs" / "scaling.md")
        if language == "yaml" or text.startswith("#!")
        for script in scripts(language, text)
        for arguments in commands(script)
    ]
    assert len(found) == 2 and found[0] == found[1] and found[0][-2:] == ["--backend", "ray"]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_in_the_text_are_parsed(page, parse):
    for span in code_spans(page):
        if span.startswith("socialnav-mj ") and span != "socialnav-mj verify":  # named without what it needs
            parse(shlex.split(span)[1:])


def test_the_makefiles_commands_are_parsed(parse):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    found = re.findall(r"^\t\$\(BIN\)/socialnav-mj (.*)$", makefile, re.MULTILINE)
    (shown,) = re.findall(r"^SHOWN := (.*)$", makefile, re.MULTILINE)
    assert shown.split() == ["potential_field", "replay_irl", "hybrid", "mpc"]
    assert found
    for line in found:
        parse(shlex.split(line.replace("$(OUT)", "runs/demo").replace("$(SHOWN)", shown)))


def test_options_in_the_text_are_those_of_a_command(capsys):
    named = {span.split()[0]: name for page, name in zip(PAGES, NAMES, strict=True) for span in code_spans(page)}
    named = {option: page for option, page in named.items() if re.fullmatch(r"--[a-z-]+", option)}
    known = {"--help"}
    for words in [
        [name] for name in ("evaluate", "report", "verify", "draws", "bench", "ship", "reproduce", "view", "render")
    ] + [
        ["leave-one-out"],
        ["step-size"],
        ["gains"],
        ["leaderboard"],
        ["fit-prediction"],
        ["train", "replay-irl"],
        ["train", "attention"],
        ["fit-selector"],
        ["check"],
        ["export"],
        ["view"],
        [],
        ["data", "list"],
        ["data", "info"],
        ["data", "fetch"],
    ]:
        with pytest.raises(SystemExit):
            cli.main([*words, "--help"])
        known |= set(re.findall(r"--[a-z-]+", capsys.readouterr().out))
    assert {"--trust", "--seed"} <= set(named) and not {o: p for o, p in named.items() if o not in known}


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_and_paths_lead_to_files(page):
    text = page.read_text(encoding="utf-8")
    links = ["".join(found) for found in LINK.findall(text)]
    lost = [link for link in links if not link.startswith("http") and not (page.parent / link).exists()]
    paths = [span for span in code_spans(page) if re.fullmatch(r"[\w./-]+", span) and span.startswith(FOLDERS)]
    lost += [path for path in paths if "NAME" not in path and not (ROOT / path).exists()]
    assert not lost


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_no_page_was_left_half_merged(page):
    assert not re.findall(r"^(?:<{7}|>{7}|\|{7}) .*$", page.read_text(encoding="utf-8"), re.MULTILINE)


def test_the_figure_of_the_house_is_current():
    page = PAGE.read_text(encoding="utf-8")
    assert with_figure(page) == page, "draw it anew: python tests/house.py"


def test_citation_and_changelog_name_the_packages_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {version} - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_readmes_results_are_the_published_ones():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    folder = ROOT / "results" / "students003"
    with (folder / "tables" / "levels.csv").open(encoding="utf-8") as file:
        rows = [
            r
            for r in csv.DictReader(file)
            if (r["variant"], r["training"], r["measure"]) == ("default", "all", "success")
        ]
    labels = {
        "potential_field": "potential field",
        "potential_field_capped": "capped field",
        "replay_irl": "ReplayIRL",
        "mixed": "hybrid",
        "human": "the recorded people on their own tracks",
    }
    assert {row["method"] for row in rows} == set(labels)
    for method, label in labels.items():
        means = [f"{float(row['mean']):.3f}".lstrip("0") for row in rows if row["method"] == method]
        assert f"{label} {' / '.join(means)}" in text
    verdicts = Counter(
        re.findall(r"^\| \(\w+\) \|.*\*\*(\w+)\*\* \| [^|]* \|$", (folder / "README.md").read_text(), re.MULTILINE)
    )
    assert f"Of {verdicts.total()} claims {verdicts['holds']} hold, {verdicts['fails']} fail and" in text
    assert f"and {verdicts['undecided']} {'is' if verdicts['undecided'] == 1 else 'are'} undecided" in text
    claims = (folder / "README.md").read_text(encoding="utf-8")
    assert re.search(r"\| \(a\) \|.*mixed policy has the highest success.*\*\*fails\*\*", claims)
    assert re.search(r"\| \(b3\) \|.*Potential field agents intrude most.*\*\*holds\*\*", claims)


def test_readmes_words_on_people_and_physics_are_the_published_ones():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    with (ROOT / "results" / "reaction" / "tables" / "levels.csv").open(encoding="utf-8") as file:
        levels = [r for r in csv.DictReader(file) if (r["recording"], r["measure"]) == ("students003", "success")]
    assert {row["controller"] for row in levels} == {*CONTROLLERS} and "nineteen controllers" in text

    def ends(scenario: str, condition: str) -> list[tuple[str, str]]:
        rows = [row for row in levels if (row["scenario"], row["condition"]) == (scenario, condition)]
        least, most = (choose(rows, key=lambda row: float(row["mean"])) for choose in (min, max))
        return [(f"{float(row['mean']):.3f}".removeprefix("0"), f"`{row['controller']}`") for row in (least, most)]

    (low, worst), (high, best) = ends("scenario_1", "replay")
    then = " to ".join(value for value, _ in ends("scenario_1", "yielding"))
    assert f"success of {low} ({worst}) to {high} ({best}) becomes {then}," in text
    last = [" to ".join(value for value, _ in ends("scenario_4", condition)) for condition in ("replay", "yielding")]
    assert f"{' becomes '.join(last)}." in text
    page = (ROOT / "results" / "plant" / "README.md").read_text(encoding="utf-8")
    told, possible, chance = re.search(r"Told wrongly: (\d+) of (\d+) numbers; .* some (\d+)\.", page).groups()
    assert f"tells {told} of {possible} numbers wrongly, where chance would {chance}:" in text
    with (ROOT / "results" / "plant" / "tables" / "turned_over.csv").open(encoding="utf-8") as file:
        turned = Counter((row["condition"], row["measure"]) for row in csv.DictReader(file))
    assert f"and {turned['unicycle', 'time_under_way']} by time." in text
    assert f"turns {turned['heavy', 'success']} over by success" in text
    assert turned["unicycle", "success"] == 2 and "turns two over by success" in text
    assert not turned["slippery", "success"] and "turns no pair over by success" in text
