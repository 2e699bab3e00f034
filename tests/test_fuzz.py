"""A few hundred hostile inputs a run; `make fuzz` tries as many as time allows."""

from pathlib import Path

import pytest
from fuzz.attack import BAD, Attack
from fuzz.mutators import LONGEST
from fuzz.run import attack_all
from fuzz.target import Target, input_of, seeds_of
from fuzz.targets import TARGETS

INPUTS = 40


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_hostile_inputs_are_accepted_or_refused_with_the_declared_error(target: Target, tmp_path: Path) -> None:
    attack = Attack(targets=[target], seed=0, failures=tmp_path / "failures")
    for index in range(INPUTS):
        attack.one(target, index, tmp_path)
    counts = attack.counts[target.name]
    told = "".join(path.read_text() for path in sorted(tmp_path.glob("failures/*.txt")))
    assert not any(counts[kind] for kind in BAD), told
    assert counts["accepted"] >= len(seeds_of(target)) and counts["refused"] > INPUTS // 4


def test_inputs_are_the_same_for_the_same_seed_and_never_huge() -> None:
    for target in TARGETS[:5]:
        inputs = [input_of(target, 3, index) for index in range(50)]
        assert inputs == [input_of(target, 3, index) for index in range(50)]
        assert len(set(inputs)) > 45
        assert max(map(len, inputs)) <= LONGEST
        assert inputs[10:] != [input_of(target, 4, index) for index in range(10, 50)]


def test_attack_finds_undeclared_errors_lack_of_memory_and_death_and_keeps_the_inputs(tmp_path: Path) -> None:
    names = ["raises", "swallows", "dies"]
    totals = attack_all(names, seconds=600.0, inputs=40, seed=0, jobs=1, failures=tmp_path, module="fuzz.faulty")
    assert totals["raises"]["raw"] and totals["raises"]["refused"] and totals["raises"]["accepted"]
    assert totals["swallows"]["memory"] and not totals["swallows"]["refused"]
    assert totals["dies"]["died"]
    for kind in ("raises.raw", "swallows.memory", "dies.died"):
        kept = next(tmp_path.glob(f"{kind}.*.bin"))
        assert kept.read_bytes() != b"frame 1 2 3" and kept.with_suffix(".txt").read_text()
