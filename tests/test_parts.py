"""Episodes in parts: their tables are the whole's to the bit, and what is missing or forged is told."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import make_controller
from socialnav_mj.environment import build_environment
from socialnav_mj.episode import Episode, EpisodeError
from socialnav_mj.evaluation import Evaluation, evaluate
from socialnav_mj.human import human_episode, human_episode_in_parts
from socialnav_mj.parts import PART, check_part, is_before_last, scored_agents
from socialnav_mj.recorder import Recorder
from socialnav_mj.recordings import load_recording
from socialnav_mj.recordings.window import window
from socialnav_mj.report.collisions import contacts_table
from socialnav_mj.report.results import read_results
from socialnav_mj.report.scores import score
from socialnav_mj.report.writer import report_tables
from socialnav_mj.resimulation import resimulate
from socialnav_mj.rollout import rollout, rollout_in_parts
from socialnav_mj.verification import verify

TINY = str(Path(__file__).parent / "data" / "tiny" / "tiny.txt")
PLAZA = window(load_recording("plaza"), 0.1, 0.25)
"""Some 50 s of a simulated crowd."""
APART = ("agent", "episode", "state_hash", "draw", "delay_imposed")
"""What parts say otherwise; the delay is reckoned by the mean speed that a person has in the record."""
LABELS = {"dataset": "plaza", "variant": "", "scenario": "", "controller": "", "draw": 0}


def agents_of(episode: Episode, path: Path) -> dict[int, dict[str, object]]:
    """Person: row of the agents' table, of the agents that are scored."""
    episode.save(path)
    rows = score(path).agents.to_pylist()
    return {row["person"]: {key: value for key, value in row.items() if key not in APART} for row in rows}


def touches_of(episode: Episode) -> list[dict[str, object]]:
    rows = contacts_table(episode, labels=LABELS).to_pylist()
    scored = episode.agent_person[scored_agents(episode.metadata, episode.agent_person)]
    return [{k: v for k, v in row.items() if k not in APART} for row in rows if row["person"] in scored]


def assert_same(parts: list[Episode], whole: Episode, folder: Path) -> None:
    """Every agent is in one part, with the bits of the whole."""
    expected, found = agents_of(whole, folder / "whole.npz"), dict[int, dict[str, object]]()
    for k, part in enumerate(parts):
        own = agents_of(part, folder / f"{k}.npz")
        assert own and not found.keys() & own.keys()
        found |= own
    assert {person: repr(row) for person, row in found.items()} == {p: repr(row) for p, row in expected.items()}

    def ordered(rows: list[dict[str, object]]) -> list[str]:
        return sorted(repr(row) for row in rows)

    assert ordered([row for part in parts for row in touches_of(part)]) == ordered(touches_of(whole))


@pytest.mark.parametrize(
    "changes",
    [
        {"share": 0.3},
        {"share": 0.9, "on_collision": "continue"},
        {"share": 0.5, "pedestrians": "yielding"},
        {"share": 0.5, "pedestrian_body": "compliant", "on_collision": "continue"},
    ],
    ids=["retire", "robots", "yielding", "compliant"],
)
def test_parts_say_of_every_agent_what_the_whole_says(changes, tmp_path):
    scenario = Scenario(seed=3).changed(**changes)
    controller = "hybrid(far='potential_field_capped')"

    def environment():
        return build_environment(PLAZA, scenario, time_limit=45.0, robots="likely")

    whole = rollout(environment(), make_controller(controller), scenario_name="made")
    parts = list(rollout_in_parts(environment(), make_controller(controller), seconds=7.0, scenario_name="made"))
    assert len(parts) >= 5 and (whole.contact_time.size or "pedestrians" in changes)
    assert parts[-1].metadata["state_hash"] == whole.metadata["state_hash"]
    ends = [part.time[-1] for part in parts]
    assert all(b - a >= 7.0 for a, b in pairwise(ends[:-1])) and ends[-1] == whole.time[-1]
    assert any(part.time[0] > 0.0 for part in parts) and [p.metadata[PART]["number"] for p in parts] == [
        *range(len(parts))
    ]
    assert_same(parts, whole, tmp_path)


def test_recorded_people_in_parts_say_what_the_whole_says(tmp_path):
    scenario = Scenario(share=0.7, seed=1)
    parts = list(human_episode_in_parts(PLAZA, scenario, seconds=8.0, scenario_name="made"))
    whole = human_episode(PLAZA, scenario, scenario_name="made")
    assert len(parts) >= 5 and whole.contact_time.size
    assert_same(parts, whole, tmp_path)


def test_a_part_is_all_that_is_kept(monkeypatch):
    kept: list[int] = []
    note_sample = Recorder.note_sample

    def counted(self):
        note_sample(self)
        kept.append(len(self._samples))

    monkeypatch.setattr(Recorder, "note_sample", counted)
    crowd = window(load_recording("plaza"), 0.0, 0.5)
    environment = build_environment(crowd, Scenario(share=0.1), robots="likely")
    parts = list(rollout_in_parts(environment, make_controller("go_straight"), seconds=5.0))
    longest = max(part.agent_end_time[i] - part.agent_spawn_time[i] for part in parts for i in range(part.n_agents))
    assert max(kept) <= (5.0 + longest) / 0.2 + 2 < len(kept) / 2
    assert not environment.task.collisions or environment.task.collisions[0].touch.time > parts[-1].time[0]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same evaluation whole and in parts."""
    folder = tmp_path_factory.mktemp("runs")
    asked = {"dataset": TINY, "scenarios": ("scenario_4",), "controllers": ("go_straight",), "draws": 3}
    for name, part in (("whole", None), ("parts", 2.0)):
        list(evaluate(Evaluation(**asked, part=part), folder / name, n_jobs=1))
    return folder


def test_tables_over_parts_are_the_tables_of_the_whole(runs):
    whole, parts = (report_tables(runs / name) for name in ("whole", "parts"))
    numbered = [path.name for path in (runs / "parts" / "episodes").iterdir() if is_before_last(path.name)]
    assert len(numbered) >= 3 and "scenario_4.go_straight.draw_001.part_000.npz" in numbered
    assert parts["summary.csv"] == whole["summary.csv"]
    assert read_results(runs / "parts").agents.num_rows == read_results(runs / "whole").agents.num_rows


def test_a_run_in_parts_is_resumed_verified_and_never_mixed(runs, tmp_path):
    asked = {"dataset": TINY, "scenarios": ("scenario_4",), "controllers": ("go_straight",), "draws": 3}
    done = list(evaluate(Evaluation(**asked, part=2.0), runs / "parts", n_jobs=1))
    assert len(done) == 6 and all(one.simulated_time is None for one in done)
    with pytest.raises(EpisodeError, match=r"was run with part = 2\.0, but None is asked for"):
        evaluate(Evaluation(**asked), runs / "parts")
    verdicts = list(verify(runs / "parts", dataset=TINY, n_jobs=1))
    assert len(verdicts) > 9 and all(verdict.same for verdict in verdicts)
    with pytest.raises(ValueError, match=r"part = 0\.5 is not allowed; allowed: numbers >= 1"):
        Evaluation(**asked, part=0.5)


@pytest.mark.parametrize("lost", ["first", "last"])
def test_a_run_that_lacks_a_part_is_not_averaged(runs, lost, tmp_path):
    files = sorted((runs / "parts" / "episodes").glob("scenario_4.go_straight.draw_001*"))
    gone = files[1] if lost == "first" else files[0]
    assert gone.name.endswith("part_000.npz" if lost == "first" else "draw_001.npz")
    for file in files:
        if file != gone:
            (tmp_path / "episodes").mkdir(exist_ok=True)
            (tmp_path / "episodes" / file.name).write_bytes(file.read_bytes())
    message = "parts of its draw are there" if lost == "first" else "it is the latest part"
    with pytest.raises(EpisodeError, match=f"is not complete: .*{message}; repeat the command"):
        read_results(tmp_path)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"seconds": 0.0}, "part.seconds is 0.0"),
        ({"seconds": "2"}, "part.seconds is '2'"),
        ({"number": -1}, "part.number is -1"),
        ({"number": True}, "part.number is True"),
        ({"is_last": 1}, "is_last 1"),
        ({"scored": "all"}, "part.scored must be a list"),
        ({"other": 1}, "expected seconds, number, is_last and scored"),
    ],
)
def test_what_no_part_says_of_itself_is_refused(changed, message):
    good = {"seconds": 2.0, "number": 0, "is_last": False, "scored": [3]}
    check_part({PART: good})
    with pytest.raises(EpisodeError, match=message):
        check_part({PART: good | changed})


def test_a_forged_part_is_found(runs, tmp_path):
    path = runs / "parts" / "episodes" / "scenario_4.go_straight.draw_001.part_000.npz"
    part = Episode.load(path)
    assert json.dumps(resimulate(part.metadata, dataset=TINY).metadata[PART]) == json.dumps(part.metadata[PART])
    said = part.metadata[PART]
    forged = replace(part, metadata=part.metadata | {PART: said | {"scored": [*said["scored"][:-1], 999]}})
    with pytest.raises(EpisodeError, match="names person 999, whom no agent replaces"):
        scored_agents(forged.metadata, forged.agent_person)
    with pytest.raises(ValueError, match=r"part\.number = 99, but the episode has fewer parts of 2\.0 s"):
        resimulate(part.metadata | {PART: said | {"number": 99}}, dataset=TINY)
    forged = replace(part, metadata=part.metadata | {PART: said | {"scored": said["scored"][:-1]}})
    forged.save(tmp_path / "forged.npz")
    (verdict,) = verify(tmp_path / "forged.npz", dataset=TINY, n_jobs=1)
    assert "part.scored" in verdict.differences[0]
    assert np.isin(forged.metadata[PART]["scored"], part.agent_person).all()
