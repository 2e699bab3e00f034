"""The trace holds what the Episode holds: values are read back from the .rrd file."""

import json
import warnings
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from episodes import Agent, Pedestrian, Touch, build_episode, line
from rerun.chunk import RrdReader

from socialnav_mj.episode import Episode, Outcome, Partner
from socialnav_mj.trace.events import events, severities, touch_rows
from socialnav_mj.trace.lanes import policy_changes, state_changes
from socialnav_mj.trace.layout import minute_of
from socialnav_mj.trace.writer import chosen_agents, write_trace

Rows = dict[int, Any]


def crowd() -> Episode:
    """Three robots under way, one that never spawned, two people, one touch of each kind, two policies."""
    return build_episode(
        [
            Agent(positions=line((0, 0), (4, 0), 25), person=3, policy=[0] * 10 + [1] * 15),
            Agent(positions=line((4, 1), (0, 1), 30), person=5, spawn_step=6, delay_steps=4, outcome=Outcome.TIMED_OUT),
            Agent(positions=line((2, -3), (2, 3), 20), person=8, spawn_step=30),
            Agent(positions=(1, 1), person=9, outcome=Outcome.NEVER_SPAWNED, spawn_step=12),
        ],
        [
            Pedestrian(positions=line((4, 0.5), (0, 0.5), 22), person=11, first_step=3),
            Pedestrian(positions=line((0, 2), (4, 2), 10), person=12, first_step=35),
        ],
        [
            Touch(agent=0, partner=0, step=12.3, duration=0.15, impact_impulse=4.0, impact_force=87.0),
            Touch(agent=1, partner=0, step=15.0, kind=Partner.AGENT, impact_force=42.0),
        ],
        policies=("cautious", "bold"),
        scenario_name="scenario_2",
        draw=7,
    )


def full_size() -> Episode:
    """As much as scenario 4 of students003 holds, with more people: 385 robots in 220 s, 51 people at any time."""
    random = np.random.default_rng(0)
    places = random.uniform(0.0, 15.0, (2, 900, 2))
    lengths = random.integers(60, 76, 385)
    starts = np.sort(random.integers(0, 1100 - 76, 385))
    agents = [
        Agent(positions=line(places[0, i], places[1, i], lengths[i] - 1), spawn_step=int(starts[i])) for i in range(385)
    ]
    pedestrians = [
        Pedestrian(positions=line(places[0, 385 + j], places[1, 385 + j], 109), first_step=110 * (j // 51))
        for j in range(510)
    ]
    touches = [Touch(agent=i, partner=51 * (int(starts[i]) // 110), step=float(starts[i])) for i in range(0, 385, 2)]
    return build_episode(agents, pedestrians, touches, n_samples=1100, scenario_name="scenario_4")


def read(path: Path) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Rows]]]:
    """Static values and, for each entity and component, rows by time in ns."""
    static: dict[str, dict[str, Any]] = defaultdict(dict)
    rows: dict[str, dict[str, Rows]] = defaultdict(lambda: defaultdict(dict))
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if name not in ("rerun.controls.RowId", "sim_time")]
        assert chunk.is_static or chunk.timeline_names == ["sim_time"]
        for name in names:
            values = batch.column(name).to_pylist()
            if chunk.is_static:
                static[chunk.entity_path][name] = values[-1]
            else:
                times = batch.column("sim_time").cast("int64").to_pylist()
                rows[chunk.entity_path][name] |= {t: v for t, v in zip(times, values, strict=True) if v is not None}
    return static, rows


def nanoseconds(time: float) -> int:
    return round(time * 1e9)


def poses(rows: dict[str, dict[str, Rows]], *entities: str) -> dict[int, set[tuple[float, ...]]]:
    """(x, y, heading) of everything drawn on these entities, by time; shapes of scale 0 are not there."""
    result: dict[int, set[tuple[float, ...]]] = defaultdict(set)
    for entity in entities:
        columns = rows[entity]
        hidden = columns.get("InstancePoses3D:scales", {})
        for time, places in columns["InstancePoses3D:translations"].items():
            assert time not in hidden or np.all(np.equal(hidden[time], 0.0))
            if time not in hidden:
                for (x, y, z), (qx, qy, qz, qw) in zip(
                    places, columns["InstancePoses3D:quaternions"][time], strict=True
                ):
                    assert (z, qx, qy) == (0.0, 0.0, 0.0)
                    result[time].add((round(x, 5), round(y, 5), round(2 * np.arctan2(qz, qw), 4)))
    return result


def recorded(time: Any, position: Any, heading: Any) -> dict[int, set[tuple[float, ...]]]:
    result: dict[int, set[tuple[float, ...]]] = {}
    for t, places, angles in zip(time, position, heading, strict=True):
        here: set[tuple[float, ...]] = {
            (round(float(x), 5), round(float(y), 5), round(float(angle), 4))
            for (x, y), angle in zip(places, angles, strict=True)
            if np.isfinite(angle)
        }
        if here:
            result[nanoseconds(t)] = here
    return result


@pytest.fixture(scope="module")
def episode() -> Episode:
    return crowd()


@pytest.fixture(scope="module")
def path(episode: Episode, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return write_trace(episode, tmp_path_factory.mktemp("traces") / "new_folder" / "crowd.rrd")


def test_robot_poses_equal_the_episode(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    drawn = poses(rows, "/scene/robots/driving", "/scene/robots/collided")
    assert drawn == recorded(episode.time, episode.agent_position, episode.agent_heading)


def test_robot_changes_over_at_its_first_touch(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    collided = poses(rows, "/scene/robots/collided")
    # Robot 0 is touched at step 12.3 and robots 0 and 1 at step 15; robot 0 ends at step 25, robot 1 at step 36.
    count = {step: len(collided.get(nanoseconds(episode.time[step]), ())) for step in (12, 13, 14, 15, 25, 26, 36, 37)}
    assert count == {12: 0, 13: 1, 14: 1, 15: 2, 25: 2, 26: 1, 36: 1, 37: 0}


def test_pedestrian_poses_equal_the_episode(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    drawn = poses(rows, "/scene/people/walking", "/scene/people/touched")
    assert drawn == recorded(episode.time, episode.pedestrian_position, episode.pedestrian_heading)
    # Touched at 2.46 s, for 2 s: samples 13 to 22, of which the last is at 4.4 s.
    touched = poses(rows, "/scene/people/touched")
    assert sorted(touched) == [nanoseconds(t) for t in episode.time[13:23]]


def test_entities_without_anybody_shrink_to_nothing(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    hidden = rows["/scene/people/walking"]["InstancePoses3D:scales"]
    # Nobody walks before step 3, while the only person is touched (13-22), and between the two people (26-34).
    assert sorted(hidden) == [nanoseconds(episode.time[step]) for step in (0, 13, 26, 46)]


def test_trails_hold_every_place(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    for entity, field in (("robots", episode.agent_position), ("people", episode.pedestrian_position)):
        points = rows[f"/scene/trails/{entity}"]["Points3D:positions"]
        assert len(points) == len(episode.time)
        for t, places in zip(episode.time, field, strict=True):
            present = places[np.isfinite(places[:, 0])]
            drawn = np.array(points[nanoseconds(t)]).reshape(-1, 3)[:, :2]
            np.testing.assert_array_equal(drawn, present.astype(np.float32))


def test_speed_equals_the_episode(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    values = np.array([v for _, v in sorted(rows["/all/speed"]["Scalars:scalars"].items())])
    np.testing.assert_array_equal(values, np.linalg.norm(episode.agent_velocity, axis=-1))
    own = rows["/chosen/speed/robot_3"]["Scalars:scalars"]
    assert sorted(own) == [nanoseconds(t) for t in episode.time[:26]]
    np.testing.assert_allclose([v for (v,) in own.values()], 4.0 / 5.0, rtol=1e-12)  # 4 m in 25 steps of 0.2 s


def test_nearest_human_equals_the_smallest_distance(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    values = rows["/all/nearest_human"]["Scalars:scalars"]
    for step, t in enumerate(episode.time):
        for i, place in enumerate(episode.agent_position[step]):
            gaps = [np.hypot(*(other - place)) for other in episode.pedestrian_position[step]]
            gaps = [gap for gap in gaps if np.isfinite(gap)]
            np.testing.assert_allclose(values[nanoseconds(t)][i], min(gaps) if gaps else np.nan, rtol=1e-12)


def test_touches_stand_once_with_partner_and_severity(episode: Episode, path: Path) -> None:
    _, rows = read(path)
    columns = rows["/scene/touches/all"]
    times = [nanoseconds(2.46), nanoseconds(3.0)]
    assert sorted(columns["Touch:robot"]) == times
    assert [columns["Touch:robot"][t] for t in times] == [[3], [3]]
    assert [columns["Touch:partner_kind"][t] for t in times] == [["person"], ["robot"]]
    assert [columns["Touch:partner"][t] for t in times] == [[11], [5]]
    assert [columns["Touch:impact_force"][t] for t in times] == [[87.0], [42.0]]
    assert [columns["Touch:impact_impulse"][t] for t in times] == [[4.0], [1.0]]
    assert [columns["Touch:duration"][t] for t in times] == [[0.15], [0.05]]
    closing = [columns["Touch:closing_speed"][t][0] for t in times]
    np.testing.assert_array_equal(closing, episode.contact_closing_speed[[0, 1]])
    place = [columns["Points3D:positions"][t][0][:2] for t in times]
    np.testing.assert_array_equal(place, episode.contact_position[[0, 1]].astype(np.float32))
    label = rows["/scene/touches/now"]["Points3D:labels"][times[0]]
    assert label == [f"{closing[0]:.2f} m/s, 87 N"]


def test_properties_identify_the_run(episode: Episode, path: Path) -> None:
    static, _ = read(path)
    run = static["/__properties/run"]
    assert run["state_hash"] == [episode.metadata["state_hash"]]
    assert run["dataset_checksum"] == [episode.metadata["recording"]["checksum"]]
    assert (run["scenario"], run["controller"], run["draw"]) == (["scenario_2"], ["straight"], [7])
    assert json.loads(run["configuration"][0]) == episode.metadata
    text = static["/run"]["TextDocument:text"][0]
    assert "**1 of 4 agents succeeded**" in text
    assert json.dumps(episode.metadata, indent=1, sort_keys=True) in text


def test_blueprint_names_every_kind_of_view(path: Path) -> None:
    reader = RrdReader(path)
    (blueprint,) = reader.blueprints()
    kinds: list[str] = []
    for chunk in reader.stream(store=blueprint).to_chunks():
        batch = chunk.to_record_batch()
        if "ViewBlueprint:class_identifier" in batch.schema.names:
            kinds += batch.column("ViewBlueprint:class_identifier").to_pylist()[-1]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "3D": 2,
        "TimeSeries": 4,
        "StateTimeline": 4,
        "TextDocument": 1,
        "TextLog": 1,
    }


def scored() -> Episode:
    """The crowd, led by a controller that tells what its policies cost: 1 and 2 s at first, .1 s more a step."""
    one = crowd()
    cost = 0.1 * np.arange(len(one.time))[:, None, None] + [1.0, 2.0]
    return replace(one, agent_scores=np.where(one.agent_active[..., None], cost, np.nan).astype(np.float32))


def test_scores_have_a_line_a_policy_for_all_and_for_chosen_robots(tmp_path: Path) -> None:
    one = scored()
    static, rows = read(write_trace(one, tmp_path / "scored.rrd"))
    for k, policy in enumerate(one.policies):
        lane = rows[f"/all/score/{policy}"]["Scalars:scalars"]
        found = np.array([lane[nanoseconds(t)] for t in one.time])
        np.testing.assert_array_equal(found, one.agent_scores[..., k])
        assert static[f"/all/score/{policy}"]["SeriesLines:names"] == [f"robot {i}" for i in one.agent_person]
    assert static["/chosen/score/robot_3"]["SeriesLines:names"] == ["robot 3 cautious", "robot 3 bold"]
    chosen = rows["/chosen/score/robot_3"]["Scalars:scalars"]
    np.testing.assert_allclose(chosen[nanoseconds(0.4)], [1.2, 2.2], atol=1e-6)
    assert len(chosen) == len(one.time[one.window(0)])


def test_scores_are_shown_where_there_are_any_and_a_name_may_hold_anything(path: Path, tmp_path: Path) -> None:
    assert not [entity for entity in read(path)[1] if "/score" in entity]
    specs = ("mpc(preset='calm')", "a/b: \\ c")
    other = write_trace(replace(scored(), policies=specs), tmp_path / "specs.rrd")
    twins = write_trace(replace(scored(), policies=("mpc", "mpc")), tmp_path / "twins.rrd")
    for file, labels in ((other, specs), (twins, ("mpc 0", "mpc 1"))):
        entities = {entity for entity in read(file)[1] if entity.startswith("/all/score/")}
        assert entities == {f"/all/score/{rr.escape_entity_path_part(label)}" for label in labels}
    blueprint = list(RrdReader(other).blueprints())
    text = repr([c.to_record_batch().to_pydict() for c in RrdReader(other).stream(store=blueprint[0]).to_chunks()])
    assert "/chosen/score" in text and "/all/score" in text


def test_thread_leads_from_a_person_to_its_recorded_place_while_it_is_off(path: Path, tmp_path: Path) -> None:
    off = np.zeros((21, 2))
    off[5:9] = [(0.3, 0.1), (0.5, 0.1), (0.4, 0.0), (0.01, 0.0)]
    person = Pedestrian(positions=line((4, 1), (0, 1), 20), deviation=off)
    reacting = build_episode([Agent(positions=line((0, 0), (4, 0), 20))], [person])
    _, rows = read(write_trace(reacting, tmp_path / "reacting.rrd"))
    drawn = rows["/scene/people/threads"]["LineStrips3D:strips"]
    assert sorted(drawn) == [nanoseconds(0.2 * k) for k in (5, 6, 7, 8)] and not len(drawn[nanoseconds(1.6)])
    for k in (5, 6, 7):
        (thread,) = drawn[nanoseconds(0.2 * k)]
        np.testing.assert_allclose(thread[0][:2], reacting.pedestrian_position[k, 0], atol=1e-6)
        np.testing.assert_allclose(thread[1][:2], reacting.pedestrian_position[k, 0] - off[k], atol=1e-6)
    assert "/scene/people/threads" not in read(path)[1]


def test_two_files_of_one_episode_mean_the_same(episode: Episode, path: Path, tmp_path: Path) -> None:
    other = write_trace(episode, tmp_path / "again.rrd")
    np.testing.assert_equal(read(other), read(path))
    names = [(s.application_id, s.recording_id) for p in (path, other) for s in RrdReader(p).recordings()]
    assert names[0] == names[1]


def test_states_follow_by_hand(episode: Episode) -> None:
    states = [[(round(c.time, 9), c.state) for c in own] for own in state_changes(episode, linger=2.0)]
    assert states == [
        [(0.0, "driving"), (2.46, "collided"), (5.0, "arrived after collision"), (7.0, "")],
        [(0.4, "waiting"), (1.2, "driving"), (3.0, "collided"), (7.2, "timed out"), (9.2, "")],
        [(6.0, "driving"), (10.0, "arrived"), (12.0, "")],
        [(2.4, "waiting"), (10.0, "never spawned"), (12.0, "")],
    ]


def test_policies_change_where_the_episode_changes_them(episode: Episode) -> None:
    own = policy_changes(episode)
    assert [(round(c.time, 9), c.state) for c in own[0]] == [(0.0, "cautious"), (2.0, "bold"), (5.0, "")]
    assert own[3] == []


def test_lanes_in_the_file_carry_numbers_and_states(path: Path) -> None:
    static, rows = read(path)
    # Robots 3, 5 and 9 overlap; robot 8 appears at 6 s while 5 and 9 still hold their lanes and 3 lingers to 7 s.
    assert sorted(e for e in rows if e.startswith("/lanes/state")) == [f"/lanes/state/{i:02d}" for i in range(4)]
    lane = rows["/lanes/state/00"]["StateChange:state"]
    assert [v[0] for _, v in sorted(lane.items())] == ["3 driving", "3 collided", "3 arrived after collision", ""]
    assert static["/lanes/state/00"]["StateConfiguration:labels"] == ["3", "3", "3"]
    chosen = rows["/chosen/policy/robot_3"]["StateChange:state"]
    assert [v[0] for _, v in sorted(chosen.items())] == ["cautious", "bold", ""]


def test_chosen_robots_are_the_hardest_hit_first(episode: Episode) -> None:
    closing = episode.contact_closing_speed
    hardest = max((0, 1), key=lambda agent: closing[episode.contact_agent == agent].max())
    assert chosen_agents(episode).tolist() == [hardest, 1 - hardest, 2]


def test_events_tell_the_story_in_order(episode: Episode, path: Path) -> None:
    story = events(episode)
    assert [text.split(":")[0] for _, _, text in story] == [
        "robot 5 spawned 0.8 s late",
        "robot 3 and person 11 touch",
        "robot 3 and robot 5 touch",
        "robot 3 arrived after 5.0 s",
        "robot 5 timed out after 6.0 s",
        "robot 8 arrived after 4.0 s",
        "robot 9 never spawned",
    ]
    _, rows = read(path)
    assert len(rows["/events"]["TextLog:text"]) == len({nanoseconds(t) for t, _, _ in story})


def test_human_row_has_touches_without_force(tmp_path: Path) -> None:
    robot = Agent(positions=line((0, 0), (2, 0), 5))
    person = Pedestrian(positions=line((2, 0.1), (0, 0.1), 5))
    touch = Touch(agent=0, partner=0, step=2.0, impact_impulse=np.nan, impact_force=np.nan)
    _, rows = read(write_trace(build_episode([robot], [person], [touch]), tmp_path / "human.rrd"))
    (label,) = rows["/scene/touches/now"]["Points3D:labels"].values()
    assert label[0].endswith("m/s")


def test_wedged_and_overturned_are_told_in_words(tmp_path: Path) -> None:
    robots = [
        Agent(positions=line((0, 0), (2, 0), 5), outcome=Outcome.OVERTURNED, goal=(9, 0)),
        Agent(positions=line((0, 3), (2, 3), 5), goal=(2, 3)),
    ]
    people = [Pedestrian(positions=line((2, y), (0, y), 5)) for y in (0.1, 3.1)]
    touches = [
        Touch(agent=i, partner=i, step=2.0, impact_force=40_673.0, squeeze=s) for i, s in enumerate((601.0, 599.0))
    ]
    episode = build_episode(robots, people, touches)
    first, second = severities(episode, touch_rows(episode))
    assert first.endswith("m/s, wedged") and second.endswith("m/s, 40673 N")
    told = [text.split()[:3] for _, _, text in events(episode)]
    assert ["robot", str(episode.agent_person[0]), "overturned"] in told
    assert [change.state for change in state_changes(episode, linger=1.0)[0]][-2:] == ["overturned", ""]
    static, _ = read(write_trace(episode, tmp_path / "wild.rrd"))
    assert "1 arrived, 0 timed out, 1 overturned, 0 never spawned" in static["/run"]["TextDocument:text"][0]


@pytest.mark.parametrize("who", ["nobody", "robots", "people"])
def test_episode_without_robots_or_people_is_written(who: str, tmp_path: Path) -> None:
    agents = [Agent(positions=line((0, 0), (1, 0), 3))] if who == "robots" else []
    people = [Pedestrian(positions=line((0, 0), (1, 0), 3))] if who == "people" else []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        static, rows = read(write_trace(build_episode(agents, people, n_samples=4), tmp_path / "few.rrd"))
    assert static["/__properties/run"]["controller"] == ["straight"]
    assert len(poses(rows, "/scene/robots/driving")) == (4 if who == "robots" else 0)
    assert len(poses(rows, "/scene/people/walking")) == (4 if who == "people" else 0)


def test_failed_write_leaves_the_old_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "trace.rrd"
    path.write_bytes(b"old")

    def fail(episode: Episode) -> Any:
        raise RuntimeError("no story")

    monkeypatch.setattr("socialnav_mj.trace.writer.events", fail)
    with pytest.raises(RuntimeError, match="no story"):
        write_trace(crowd(), path)
    assert [p.name for p in tmp_path.iterdir()] == ["trace.rrd"]
    assert path.read_bytes() == b"old"


def test_full_size_episode_fits_in_five_megabytes(tmp_path: Path) -> None:
    path = write_trace(full_size(), tmp_path / "full.rrd")
    assert path.stat().st_size <= 5_000_000


def test_clamped_forces_are_not_shown_as_fact(tmp_path: Path) -> None:
    robot = Agent(positions=line((0, 0), (2, 0), 10), goal=(9, 0), outcome=Outcome.TIMED_OUT)
    people = [Pedestrian(positions=np.tile((x, 0.1), (11, 1))) for x in (0.4, 0.6, 1.6)]
    touches = [
        Touch(agent=0, partner=0, step=2.0, duration=0.4, impact_force=90.0, push_impulse=9.0),
        Touch(agent=0, partner=1, step=2.3, impact_force=9000.0),
        Touch(agent=0, partner=2, step=8.0, impact_force=70.0),
    ]
    episode = build_episode([robot], people, touches)
    assert [text.split(", ")[1] for text in severities(episode, touch_rows(episode))] == ["clamped", "clamped", "70 N"]
    _, rows = read(write_trace(episode, tmp_path / "clamped.rrd"))
    columns = rows["/scene/touches/all"]
    shown = [
        [value[0] for _, value in sorted(columns[f"Touch:{name}"].items())] for name in ("impact_force", "push_impulse")
    ]
    np.testing.assert_array_equal(shown, [[np.nan, np.nan, 70.0], [9.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("windows", "expected"),
    [
        ([], (0.0, 200.0)),
        ([(100.0, 120.0), (10.0, 20.0)], (80.0, 140.0)),
        ([(5.0, 15.0)], (0.0, 40.0)),
        ([(50.0, 150.0)], (50.0, 150.0)),
    ],
)
def test_plots_of_the_chosen_open_on_the_minute_of_the_first(windows, expected):
    found = minute_of(np.array(windows).reshape(-1, 2), np.array([0.0, 200.0]))
    assert tuple(found) == expected
