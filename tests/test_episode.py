"""The record: what it refuses, that it comes back bit by bit, and that no file can do harm."""

import io
import json
import os
import pickle
import zipfile
from dataclasses import fields, replace

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj.episode import Episode, EpisodeError, Outcome, Partner, read_header


def make():
    """Three agents, one of which never spawned; two touches with people and one between agents."""
    agents = [
        Agent(positions=line((0, 0), (4, 0), 20), spawn_step=2, delay_steps=2),
        Agent(positions=line((0, 1), (4, 1), 25), goal=(9, 1), outcome=Outcome.TIMED_OUT),
        Agent(positions=[(7, 7)], goal=(1, 1), outcome=Outcome.NEVER_SPAWNED),
    ]
    people = [Pedestrian(positions=line((0, 2), (4, 2), 30)), Pedestrian(positions=np.zeros((9, 2)), first_step=12)]
    touches = [
        Touch(agent=1, partner=1, step=14.0),
        Touch(agent=0, partner=0, step=5.5),
        Touch(agent=0, partner=1, step=9.0, kind=Partner.AGENT),
    ]
    return build_episode(agents, people, touches)


@pytest.fixture(scope="module")
def episode():
    return make()


def scored(episode):
    """The episode as of a controller that tells what its one policy cost."""
    scores = np.where(episode.agent_active[..., None], 1.5, np.nan).astype(np.float32)
    return replace(episode, agent_scores=scores)


def changed(episode, name, edit):
    """The episode with one array edited in a copy."""
    array = getattr(episode, name).copy()
    return replace(episode, **{name: edit(array)})


def setter(*index, value):
    def edit(array):
        array[index] = value
        return array

    return edit


# Invariants


@pytest.mark.parametrize(
    ("name", "edit", "named"),
    [
        ("agent_heading", lambda a: a[:-1], r"agent_heading has shape \(30, 3\); expected \(31, 3\)"),
        ("agent_goal", lambda a: a[:, :1], r"agent_goal has shape \(3, 1\); expected \(3, 2\)"),
        ("agent_policy", lambda a: a.astype(float), "agent_policy has type float64; expected int64"),
        ("time", lambda a: a.astype(np.float32), "time has type float32; expected float64"),
        ("time", lambda a: 2.0 * a, "time must be spaced by the control time step of 0.2 s"),
        ("time", setter(3, value=np.nan), "time must be finite"),
        ("agent_person", lambda a: a[::-1].copy(), "agent_person must be ascending and unique"),
        ("pedestrian_person", setter(slice(None), value=1000), "pedestrian_person must be ascending and unique"),
        ("pedestrian_person", setter(0, value=1), "cannot be replaced and replayed at once"),
        ("agent_outcome", setter(0, value=9), "agent_outcome holds values outside"),
        ("agent_outcome", setter(0, value=Outcome.NEVER_SPAWNED), "agent_spawn_time must be NaN for exactly"),
        ("agent_spawn_time", setter(2, value=1.0), "agent_spawn_time must be NaN for exactly"),
        ("agent_end_time", setter(0, value=np.nan), "agent_end_time must be NaN for exactly"),
        ("agent_end_time", setter(0, value=0.2), "agent_end_time must not be before agent_spawn_time"),
        ("agent_end_time", setter(0, value=2.0), "agent_position must be finite from spawn to end"),
        ("agent_position", setter(5, 0, value=np.nan), "agent_position must be finite from spawn to end"),
        ("agent_position", setter(5, 0, 1, value=np.inf), "agent_position must be finite from spawn to end"),
        ("agent_heading", setter(0, 0, value=1.0), "agent_heading must be finite from spawn to end"),
        ("agent_velocity", setter(30, 2, value=0.0), "agent_velocity must be finite from spawn to end"),
        ("agent_policy", setter(0, 0, value=0), "agent_policy must be -1 except"),
        ("agent_policy", setter(5, 0, value=-1), "agent_policy must be -1 except"),
        ("agent_policy", setter(5, 0, value=1), r"agent_policy holds values outside -1..0"),
        ("agent_tilt", setter(5, 0, value=np.nan), "agent_tilt must be finite from spawn to end"),
        ("agent_tilt", setter(5, 0, value=1.6), "agent_tilt must exceed the limit at the end of overturned agents"),
        ("agent_outcome", setter(0, value=Outcome.OVERTURNED), "agent_tilt must exceed the limit at the end of"),
        ("pedestrian_velocity", setter(0, 0, value=np.nan), "pedestrian_velocity must be finite where"),
        ("contact_agent", setter(0, value=3), "contact_agent is out of range"),
        ("contact_partner", setter(0, value=2), "contact_partner is out of range"),
        ("contact_partner_kind", setter(0, value=2), "contact_partner_kind holds values outside"),
        ("contact_partner", setter(1, value=0), "the agent itself"),
        ("contact_time", setter(0, value=5.0), "contacts must have a finite time and be ordered"),
        ("contact_time", setter(3, value=np.nan), "contacts must have a finite time and be ordered"),
    ],
)
def test_broken_invariant_is_named(episode, name, edit, named):
    with pytest.raises(EpisodeError, match=named):
        changed(episode, name, edit)


@pytest.mark.parametrize(
    ("edit", "named"),
    [
        (lambda a: a[..., :0], r"agent_scores has shape \(31, 3, 0\); expected \(31, 3, 1\)"),
        (lambda a: a.astype(float), "agent_scores has type float64; expected float32"),
        (setter(5, 0, value=np.nan), "agent_scores must be finite from the spawn"),
        (setter(5, 0, value=np.inf), "agent_scores must be finite from the spawn"),
        (setter(30, 0, value=1.0), "agent_scores must be finite from the spawn"),
    ],
)
def test_broken_scores_are_named(episode, edit, named):
    with pytest.raises(EpisodeError, match=named):
        changed(scored(episode), "agent_scores", edit)


def test_metadata_without_a_time_step_are_refused(episode):
    with pytest.raises(EpisodeError, match=r"metadata lack scenario.control_timestep"):
        replace(episode, metadata={})


def test_arrays_cannot_be_written_to(episode):
    with pytest.raises(ValueError, match="read-only"):
        episode.agent_position[0] = 0.0


def test_views_of_the_record_are_those_of_the_tracks(episode):
    assert (episode.n_agents, episode.n_pedestrians, episode.control_timestep) == (3, 2, 0.2)
    assert [episode.window(i) for i in range(3)] == [slice(2, 23), slice(0, 26), slice(0, 0)]
    np.testing.assert_array_equal(episode.agent_active.sum(axis=0), [20, 25, 0])


def test_closing_speed_is_the_relative_velocity_along_the_normal(episode):
    """Along (0.6, 0.8), 1 m/s in x against -0.5 m/s in y: 0.6 * 1 + 0.8 * 0.5."""
    k = len(episode.contact_time)
    one = replace(
        episode,
        contact_normal=np.tile([0.6, 0.8], (k, 1)),
        contact_agent_velocity=np.tile([1.0, 0.0], (k, 1)),
        contact_partner_velocity=np.tile([0.0, -0.5], (k, 1)),
    )
    np.testing.assert_allclose(one.contact_closing_speed, 1.0)


# Files


def equal(one, two):
    for field in fields(Episode):
        a, b = getattr(one, field.name), getattr(two, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes(), field.name
        else:
            assert a == b, field.name


def test_scores_travel_in_the_file_and_are_told_by_its_digest(episode, tmp_path):
    path = scored(episode).save(tmp_path / "a.npz")
    equal(scored(episode), Episode.load(path))
    with np.load(path) as file:
        arrays = dict(file)
    for name, change in (("b", arrays | {"agent_scores": 2.0 * arrays["agent_scores"]}), ("c", arrays)):
        if name == "c":
            del change["agent_scores"]
        np.savez(tmp_path / f"{name}.npz", **change)
        with pytest.raises(EpisodeError, match="it was altered after it was written"):
            Episode.load(tmp_path / f"{name}.npz")


def test_saved_episode_is_loaded_bit_by_bit_and_equal_episodes_give_equal_files(episode, tmp_path):
    path = episode.save(tmp_path / "new" / "folder" / "a.npz")
    equal(episode, Episode.load(path))
    assert path.read_bytes() == make().save(tmp_path / "b.npz").read_bytes()
    assert read_header(path)["metadata"] == episode.metadata
    assert [p.name for p in path.parent.iterdir()] == ["a.npz"]


def test_interrupted_save_leaves_the_old_file_and_nothing_else(episode, tmp_path, monkeypatch):
    path = episode.save(tmp_path / "a.npz")
    before = path.read_bytes()

    def interrupted(part, **arrays):
        part.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    with pytest.raises(KeyboardInterrupt):
        changed(episode, "agent_goal", setter(0, value=5.0)).save(path)
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["a.npz"]


def test_missing_file_is_no_damaged_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        Episode.load(tmp_path / "nothing.npz")


@pytest.fixture(scope="module")
def content(episode, tmp_path_factory):
    return episode.save(tmp_path_factory.mktemp("content") / "a.npz").read_bytes()


def refused(path, data):
    path.write_bytes(data)
    for read in (Episode.load, read_header):
        with pytest.raises(EpisodeError) as caught:
            read(path)
        assert str(path) in str(caught.value)


def test_truncated_file_is_refused_at_every_length(content, tmp_path):
    for length in [*range(0, 200, 7), *range(200, len(content), 997), len(content) - 1]:
        refused(tmp_path / "a.npz", content[:length])


def test_damaged_byte_is_refused_or_without_effect(episode, content, tmp_path):
    """The zip's checksums cover the arrays; some bytes of its directory (dates, attributes) mean nothing."""
    random = np.random.default_rng(0)
    path, harmless = tmp_path / "a.npz", 0
    for place in random.integers(0, len(content), 400):
        data = bytearray(content)
        data[place] ^= 1 << int(random.integers(8))
        path.write_bytes(data)
        try:
            loaded = Episode.load(path)
        except EpisodeError:
            continue
        equal(loaded, episode)
        harmless += 1
    assert harmless < 200


def rewritten(content, **changes):
    """The npz with members replaced, added, or (None) left out."""
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            if name.removesuffix(".npy") not in changes:
                new.writestr(name, old.read(name))
        for name, array in changes.items():
            if array is not None:
                member = io.BytesIO()
                np.save(member, array, allow_pickle=True)
                new.writestr(f"{name}.npy", member.getvalue())
    return target.getvalue()


def test_array_that_claims_more_than_the_file_holds_is_refused_before_memory_is_asked_for(content, tmp_path):
    array = io.BytesIO()
    np.lib.format.write_array_header_1_0(array, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    target = io.BytesIO(rewritten(content, time=None))
    with zipfile.ZipFile(target, "a") as file:
        file.writestr("time.npy", array.getvalue() + bytes(80))
    (tmp_path / "a.npz").write_bytes(target.getvalue())
    with pytest.raises(EpisodeError, match=r"time of 8000000000000 bytes in a file of 208"):
        Episode.load(tmp_path / "a.npz")


def header_of(content, **changes):
    with zipfile.ZipFile(io.BytesIO(content)) as file:
        header = json.loads(str(np.load(io.BytesIO(file.read("header.npy")))))
    return np.array(json.dumps({**header, **changes}))


def test_foreign_files_are_refused(content, tmp_path):
    path, plain, other = tmp_path / "a.npz", io.BytesIO(), io.BytesIO()
    np.save(plain, np.zeros(3))
    np.savez(other, a=np.zeros(3))
    for data in (b"", b"hello", plain.getvalue(), other.getvalue(), b"PK\x03\x04" + bytes(100)):
        refused(path, data)
    refused(path, rewritten(content, header=header_of(content, format="socialnav_mj.episode/99")))
    refused(path, rewritten(content, header=np.array("[1, 2]")))
    refused(path, rewritten(content, header=np.array("{not json")))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"agent_goal": None}, "it lacks agent_goal"),
        ({"extra": np.zeros(2)}, "it has unknown arrays extra"),
        ({"agent_goal": np.zeros((3, 3))}, "agent_goal has shape"),
        ({"agent_goal": np.array([["a", "b"]] * 3)}, "agent_goal has type"),
    ],
)
def test_file_with_other_arrays_is_refused(content, changes, named, tmp_path):
    path = tmp_path / "a.npz"
    path.write_bytes(rewritten(content, **changes))
    with pytest.raises(EpisodeError, match=named):
        Episode.load(path)


class Bomb:
    """Unpickling it makes a file."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return (open, (self.path, "w"))


def test_no_code_from_a_file_is_run(content, tmp_path):
    path, trace = tmp_path / "a.npz", tmp_path / "exploded"
    bomb = np.array(Bomb(trace), dtype=object)
    for data in (pickle.dumps(Bomb(trace)), rewritten(content, header=bomb)):
        refused(path, data)
    path.write_bytes(rewritten(content, agent_goal=bomb))
    with pytest.raises(EpisodeError):
        Episode.load(path)
    assert not trace.exists()
