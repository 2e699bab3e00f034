"""Who is replaced and replayed, on which control steps and in which slots."""

import tracemalloc

import numpy as np
import pytest
from scenes import busy_crowd, recording_of, stand, walk

from socialnav_mj.cast import NOBODY, Replay, cast_recording
from socialnav_mj.config import Scenario
from socialnav_mj.geometry import yaw_of_quaternion
from socialnav_mj.recordings import Recording

DT = 0.2  # control step [s]


def crowd(seed: int = 0) -> tuple[Recording, Scenario]:
    return recording_of(*busy_crowd(30, seed), stand((9, 9), 1.0, 3.0)), Scenario(share=0.4, seed=seed)


def test_people_are_on_the_grid_from_their_first_to_their_last_whole_step() -> None:
    tracks = (
        walk([(0, 0), (2, 0)], 1.0, begin=0.5),  # 0.5 to 2.5 s
        walk([(0, 0), (2, 0)], 1.0, begin=0.4),  # 0.4 to 2.4 s, both on the grid
        stand((3, 3), 0.0, 0.0 + DT),
        stand((3, 3), 0.41, 0.59),  # between two steps
    )
    cast = cast_recording(recording_of(*tracks), Scenario(share=0.25, seed=0))
    assert cast.n_agents == 1
    agent = int(cast.agent_person[0])
    assert agent in (1, 2) and cast.agent_appear_step.tolist() == [{1: 3, 2: 2}[agent]]
    first, last = {1: (3, 12), 2: (2, 12)}[3 - agent]
    assert cast.pedestrian_person.tolist() == [3 - agent, 3]
    assert cast.pedestrian_first_step.tolist() == [first, 0]
    assert cast.pedestrian_last_step.tolist() == [last, 1]


def test_agents_have_their_persons_start_goal_heading_and_deadline() -> None:
    cast = cast_recording(recording_of(walk([(1, 1), (1, 4)], 1.0)), Scenario(share=1.0))
    np.testing.assert_allclose(cast.agent_start, [[1.0, 1.0]])
    np.testing.assert_allclose(cast.agent_goal, [[1.0, 4.0]])
    np.testing.assert_allclose(cast.agent_heading, [np.pi / 2.0])
    assert cast.agent_allowed_steps.tolist() == [(15 + 2 * 3) / DT]
    assert cast.n_pedestrians == 0 and cast.n_pedestrian_slots == 1


@pytest.mark.parametrize("seed", range(5))
def test_everybody_has_exactly_one_part_and_stays_if_moving_less_than_a_metre(seed: int) -> None:
    recording, scenario = crowd(seed)
    cast = cast_recording(recording, scenario)
    everybody = np.concatenate([cast.agent_index, cast.pedestrian_index])
    np.testing.assert_array_equal(np.sort(everybody), np.arange(recording.n_people))
    assert cast.n_agents == 12 and 31 in cast.pedestrian_person
    np.testing.assert_array_equal(cast.agent_person, recording.ids[cast.agent_index])


@pytest.mark.parametrize("seed", range(5))
def test_slots_never_hold_two_and_are_as_few_as_possible(seed: int) -> None:
    cast = cast_recording(*crowd(seed))
    steps = np.arange(cast.pedestrian_last_step.max() + 1)
    here = (cast.pedestrian_first_step <= steps[:, None]) & (steps[:, None] <= cast.pedestrian_last_step)
    for row in here:
        assert len(set(cast.pedestrian_slot[row])) == row.sum()
    assert cast.n_pedestrian_slots == here.sum(axis=1).max()
    end = cast.agent_appear_step + cast.agent_allowed_steps
    at_once = [int(((cast.agent_appear_step <= k) & (k <= end)).sum()) for k in range(end.max() + 1)]
    assert cast.n_agent_slots == max(at_once)


def test_cast_cannot_be_written_to_and_names_a_recording_of_nobody_who_moves() -> None:
    cast = cast_recording(*crowd())
    with pytest.raises(ValueError, match="read-only"):
        cast.agent_start[0] = 0.0
    with pytest.raises(ValueError, match=r"nobody in recording 'made' moves 1.0 m or more"):
        cast_recording(recording_of(stand((0, 0), 0.0, 4.0)), Scenario())


@pytest.mark.parametrize("seed", range(3))
def test_replay_is_the_recording_at_every_physics_step(seed: int) -> None:
    recording, scenario = crowd(seed)
    cast = cast_recording(recording, scenario)
    replay, previous = Replay(recording, scenario, cast), np.full(cast.n_pedestrian_slots, NOBODY)
    for step in range(int(cast.pedestrian_last_step.max()) + 3):
        now, truth = replay.crowd(step), recording.at([step * DT])
        replayed = np.zeros(recording.n_people, dtype=bool)
        replayed[cast.pedestrian_index] = True
        expected = np.flatnonzero(truth.present[0] & replayed)
        who = cast.pedestrian_index[now.pedestrian[now.present]]
        np.testing.assert_array_equal(np.sort(who), expected)
        np.testing.assert_allclose(now.position[now.present], truth.position[0, who], atol=1e-9)
        np.testing.assert_allclose(now.velocity[now.present], truth.velocity[0, who], atol=1e-9)
        np.testing.assert_allclose(now.heading[now.present], truth.heading[0, who], atol=1e-9)
        np.testing.assert_allclose(yaw_of_quaternion(now.quaternion[now.present]), truth.heading[0, who], atol=1e-9)
        np.testing.assert_array_equal(now.changed, np.flatnonzero(now.pedestrian != previous))
        empty = np.setdiff1d(np.arange(cast.n_pedestrian_slots), now.present)
        assert np.isnan(now.position[empty]).all() and (now.pedestrian[empty] == NOBODY).all()
        previous = now.pedestrian

        position, velocity, walk = replay.motion(step)
        assert walk is None  # rigid people need no mean velocity
        assert position.shape == velocity.shape == (20, cast.n_pedestrian_slots, 2)
        times = step * DT + 0.01 * np.arange(20)
        for slot in now.present:
            track = recording.person(int(cast.pedestrian_index[now.pedestrian[slot]]))
            expected_position, expected_velocity, _ = track.at(times)
            np.testing.assert_allclose(position[:, slot], expected_position, atol=1e-9)
            np.testing.assert_allclose(velocity[:, slot], expected_velocity, atol=1e-9)
        assert np.isnan(position[:, empty]).all()


def test_nobody_is_left_long_after_the_recording() -> None:
    recording, scenario = crowd()
    replay = Replay(recording, scenario, cast_recording(recording, scenario))
    for step in (1000, 1001):
        now = replay.crowd(step)
        assert not now.present.size and not now.changed.size
        assert np.isnan(replay.motion(step)[0]).all()


def test_person_whose_track_ends_between_two_steps_waits_at_its_end() -> None:
    # 0.3 to 1.1 s at 1 m/s: in the scene at steps 2 to 5, until 1.2 s.
    recording = recording_of(walk([(0, 0), (5, 0)], 1.0), walk([(0, 3.0), (0.8, 3.0)], 1.0, begin=0.3))
    scenario = Scenario(share=0.5)
    replay = Replay(recording, scenario, cast_recording(recording, scenario))
    position, velocity, _ = replay.motion(5)
    np.testing.assert_allclose(position[:, 0, 0], np.minimum(0.7 + 0.01 * np.arange(20), 0.8), atol=1e-9)
    np.testing.assert_allclose(velocity[12:, 0], 0.0, atol=1e-12)
    assert not replay.crowd(6).present.size


def test_mean_velocity_leads_from_place_to_place_within_a_control_step_and_into_the_next() -> None:
    recording = recording_of(*busy_crowd(12, seed=4))
    scenario = Scenario(share=0.3, pedestrian_body="compliant")
    cast = cast_recording(recording, scenario)
    replay, met = Replay(recording, scenario, cast), 0
    for step in range(replay._steps):
        (_, velocity, walk), now = replay.motion(step), replay.crowd(step)
        assert walk is not None and walk.shape == (21, cast.n_pedestrian_slots, 2)
        before = replay.crowd(step - 1).pedestrian if step else np.full(cast.n_pedestrian_slots, NOBODY)
        for slot in now.present:
            i = int(now.pedestrian[slot])
            stays, was_there = replay.crowd(step + 1).pedestrian[slot] == i, before[slot] == i
            times = step * DT + 0.01 * np.arange(-1, 21)
            place = recording.person(int(cast.pedestrian_index[i])).at(times)[0]
            expected = np.diff(place, axis=0) / 0.01
            expected[0] = expected[0] if was_there else velocity[0, slot]
            expected[-1] = expected[-1] if stays else velocity[-1, slot]
            np.testing.assert_allclose(walk[:, slot], expected, atol=1e-9)
            met += was_there and not stays
        absent = np.setdiff1d(np.arange(cast.n_pedestrian_slots), now.present)
        assert np.isnan(walk[:, absent]).all()
    assert met > 2


@pytest.mark.parametrize("body", ["rigid", "compliant"])
def test_no_bit_of_a_replay_depends_on_how_much_is_evaluated_at_once(
    body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, scenario = crowd()[0], Scenario(share=0.4, pedestrian_body=body)
    cast = cast_recording(recording, scenario)

    def bytes_of(window: int) -> list[bytes]:
        monkeypatch.setattr("socialnav_mj.cast.WINDOW", window)
        replay, steps = Replay(recording, scenario, cast), int(cast.pedestrian_last_step.max()) + 4
        # Back to the beginning, as at a reset, and across the edges of windows to and fro.
        shown = [replay.crowd(step) for step in (*range(steps), 0, 14, 13, 14)]
        moved = [array for step in range(steps) for array in replay.motion(step)]
        arrays = [getattr(now, name) for now in shown for name in vars(now)] + [a for a in moved if a is not None]
        return [np.ascontiguousarray(array).tobytes() for array in arrays]

    assert bytes_of(7) == bytes_of(1) == bytes_of(10_000)


def test_replay_of_a_long_recording_takes_no_more_memory_than_that_of_a_short_one() -> None:
    def megabytes(minutes: int) -> float:
        tracks = [walk([(0, 0), (10, 0)], 1.0, begin=9.0 * k) for k in range(60 * minutes // 9)]
        recording, scenario = recording_of(*tracks), Scenario(share=0.01)
        cast = cast_recording(recording, scenario)
        assert recording.curves.start.size == len(tracks)  # the recording's own, made at first use
        tracemalloc.start()
        replay = Replay(recording, scenario, cast)
        for step in range(int(cast.pedestrian_last_step.max())):
            replay.crowd(step)
            replay.motion(step)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak / 1e6

    assert megabytes(16) < 1.1 * megabytes(4)
