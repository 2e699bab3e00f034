"""Texts that are shown to somebody use the words of docs/glossary.md."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from socialnav_mj.studies.claims import CLAIMS
from socialnav_mj.studies.looks import LOOKS
from socialnav_mj.studies.panel import METHODS, MIXED

PACKAGE = Path(__file__).parent.parent / "socialnav_mj"
SHOWN = sorted(
    path for room in ("metrics", "report", "studies", "trace", "cli") for path in (PACKAGE / room).rglob("*.py")
)
WRONG = {
    r"\bmixed\b(?! policy)": "hybrid; 'mixed policy' where the paper is quoted",
    r"\bfirst touch\b|\btouches(,| with| between)|\btouched (nobody|somebody)\b": "collision",
    r"\b(recorded|nearest) humans?\b": "human, for the row; pedestrian, for who is replayed",
    r"\bvariants? of the setting\b": "setting",
    r"\b(successful|straight|training) runs?\b": "trip",
}
"""Pattern: what is said instead."""


def shown_texts(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every string with a blank in it, docstrings apart: keys and names have none."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    strings = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    for node in strings:
        if " " in str(node.value) and id(node) not in docstrings:
            yield node.lineno, " ".join(str(node.value).split())


@pytest.mark.parametrize("path", SHOWN, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_texts_use_the_glossarys_words(path):
    for line, text in shown_texts(path):
        for pattern, instead in WRONG.items():
            found = re.search(pattern, text, re.IGNORECASE)
            assert not found, f"{path}:{line}: {found[0]!r} in {text!r}; the glossary says: {instead}"


def test_methods_and_comparisons_are_named_by_the_glossarys_words():
    assert {LOOKS[method].label for method in METHODS} == {
        "potential field",
        "capped field",
        "ReplayIRL",
        "hybrid",
        "human",
    }
    for claim in CLAIMS:
        uses_it = any(term.method == MIXED for part in claim.parts for term in part.terms)
        for text in (claim.test, *(part.label for part in claim.parts)):
            assert "mixed" not in text
        assert not uses_it or any("hybrid" in part.label for part in claim.parts)
