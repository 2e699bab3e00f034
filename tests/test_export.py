"""Exported episodes are read back with the same positions, by us and by PedPy, which measures the same speeds."""

import csv
import json
from pathlib import Path

import numpy as np
import pedpy
import pytest

from socialnav_mj.cli import main
from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode
from socialnav_mj.export import SUFFIXES, WRITERS, export
from socialnav_mj.human import human_episode
from socialnav_mj.recordings import load_recording

TINY = Path(__file__).parent / "data" / "tiny" / "tiny.txt"


@pytest.fixture(scope="module")
def episode() -> Episode:
    """Two of three people are agents, on their own tracks."""
    return human_episode(load_recording(TINY), Scenario(share=0.7), scenario_name="scenario_3")


def tracks_of(episode: Episode) -> dict[int, np.ndarray]:
    """Person: (k, 3) time and position at every sample."""
    people = np.concatenate([episode.agent_person, episode.pedestrian_person])
    positions = np.concatenate([episode.agent_position, episode.pedestrian_position], axis=1)
    return {
        int(person): np.column_stack([episode.time, positions[:, i]])[np.isfinite(positions[:, i, 0])]
        for i, person in enumerate(people)
    }


@pytest.mark.parametrize("kind", WRITERS)
def test_our_readers_read_what_was_written(kind, episode: Episode, tmp_path: Path) -> None:
    path = tmp_path / f"made{SUFFIXES[kind]}"
    path.write_bytes(WRITERS[kind](episode))
    found, expected = load_recording(path), tracks_of(episode)
    assert found.frame_rate == 5.0 and found.frame_rate_origin == "stated in the file"
    assert set(found.ids.tolist()) == set(expected) and len(expected) == 3
    first = min(track[0, 0] for track in expected.values())
    for index, person in enumerate(found.ids.tolist()):
        np.testing.assert_array_equal(found.positions[index], expected[person][:, 1:])
        np.testing.assert_allclose(found.times[index], expected[person][:, 0] - first, atol=1e-9)


def test_pedpy_reads_it_and_measures_the_same_speeds(episode: Episode, tmp_path: Path) -> None:
    path = tmp_path / "made.txt"
    path.write_bytes(WRITERS["pedpy"](episode))
    theirs = pedpy.load_trajectory_from_txt(trajectory_file=path)
    assert theirs.frame_rate == 5.0
    speeds = pedpy.compute_individual_speed(
        traj_data=theirs, frame_step=1, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    for person, track in tracks_of(episode).items():
        ours = np.linalg.norm(np.gradient(track[:, 1:], 0.2, axis=0), axis=1)
        own = speeds[speeds.id == person].sort_values("frame").speed.to_numpy()
        np.testing.assert_allclose(own, ours, atol=1e-9)


def test_trajnet_has_a_scene_for_each_agent_and_csv_says_who_is_a_robot(episode: Episode) -> None:
    lines = [json.loads(line) for line in WRITERS["trajnet"](episode).decode().splitlines()]
    scenes = [line["scene"] for line in lines if "scene" in line]
    assert [scene["p"] for scene in scenes] == episode.agent_person.tolist() and scenes[0]["fps"] == 5.0
    for scene in scenes:
        own = [line["track"]["f"] for line in lines if line.get("track", {}).get("p") == scene["p"]]
        assert (scene["s"], scene["e"]) == (min(own), max(own))
    text = WRITERS["csv"](episode).decode().splitlines()
    assert text[0] == "# framerate: 5" and {row["kind"] for row in csv.DictReader(text[1:])} == {"person"}
    robots = Episode(**{**vars(episode), "metadata": {**episode.metadata, "controller": "orca"}})
    rows = list(csv.DictReader(WRITERS["csv"](robots).decode().splitlines()[1:]))
    assert {int(row["id"]) for row in rows if row["kind"] == "robot"} == set(episode.agent_person.tolist())


def test_command_exports_the_episodes_of_a_run(
    episode: Episode, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    episode.save(tmp_path / "episodes" / "one.npz")
    main(["export", str(tmp_path), "--format", "trajnet", "csv"])
    names = {path.name for path in (tmp_path / "export").iterdir()}
    assert names == {"one.ndjson", "one.csv"}
    assert str(tmp_path / "export" / "one.csv") in capsys.readouterr().out
    with pytest.raises(FileNotFoundError, match="no episodes in"):
        export(tmp_path / "export", tmp_path, ("csv",))
