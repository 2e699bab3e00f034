"""Interpolation, headings and presence of recorded people."""

import numpy as np
import pytest

from socialnav_mj.recordings import Recording


def recording_of(*tracks: tuple[list[float], list[tuple[float, float]]]) -> Recording:
    return Recording(
        name="made",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(1, len(tracks) + 1),
        times=tuple(np.array(t, dtype=float) for t, _ in tracks),
        positions=tuple(np.array(x, dtype=float) for _, x in tracks),
        checksum="",
    )


def random_recording(seed: int, n_people: int = 12) -> Recording:
    random = np.random.default_rng(seed)
    tracks = []
    for _ in range(n_people):
        k = int(random.integers(2, 9))
        times = random.uniform(0.0, 5.0) + np.cumsum(random.uniform(0.2, 2.0, size=k))
        positions = np.cumsum(random.normal(size=(k, 2)) * random.choice([0.0, 1.0], size=(k, 1)), axis=0)
        tracks.append((times.tolist(), positions.tolist()))
    return recording_of(*tracks)


def test_two_samples_give_a_straight_walk_at_constant_speed() -> None:
    recording = recording_of(([0.0, 2.0], [(0.0, 0.0), (2.0, 4.0)]))
    position, velocity, heading = recording.person(0).at([0.0, 0.5, 2.0])
    np.testing.assert_allclose(position, [[0.0, 0.0], [0.5, 1.0], [2.0, 4.0]], atol=1e-12)
    np.testing.assert_allclose(velocity, [[1.0, 2.0]] * 3, atol=1e-12)
    np.testing.assert_allclose(heading, np.arctan2(2.0, 1.0), atol=1e-12)


def test_hermite_value_between_three_samples_matches_hand_calculation() -> None:
    # Slopes 1 then 3 over equal steps: the middle derivative is the harmonic mean 1.5; the one-sided end formula
    # gives (3*1 - 3)/2 = 0 at the start. At half of the first step: (0 + 1)/2 + (0 - 1.5)/8 = 0.3125.
    recording = recording_of(([0.0, 1.0, 2.0], [(0.0, 0.0), (1.0, 0.0), (4.0, 0.0)]))
    position, velocity, _ = recording.person(0).at([0.0, 0.5, 1.0])
    np.testing.assert_allclose(position[:, 0], [0.0, 0.3125, 1.0], atol=1e-12)
    np.testing.assert_allclose(velocity[[0, 2], 0], [0.0, 1.5], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_interpolation_stays_between_neighbouring_samples_and_passes_through_them(seed: int) -> None:
    recording = random_recording(seed)
    for i in range(recording.n_people):
        t, x = recording.times[i], recording.positions[i]
        np.testing.assert_allclose(recording.person(i).at(t)[0], x, atol=1e-9)
        for a, b, low, high in zip(t[:-1], t[1:], np.minimum(x[:-1], x[1:]), np.maximum(x[:-1], x[1:]), strict=True):
            between = recording.person(i).at(np.linspace(a, b, 50))[0]
            assert (between >= low - 1e-9).all() and (between <= high + 1e-9).all()


@pytest.mark.parametrize("seed", range(3))
def test_velocity_is_the_derivative_of_position(seed: int) -> None:
    recording = random_recording(seed)
    step = 1e-5
    for i in range(recording.n_people):
        times = np.linspace(recording.start_time[i] + 0.01, recording.end_time[i] - 0.01, 97)
        track = recording.person(i)
        slope = (track.at(times + step)[0] - track.at(times - step)[0]) / (2.0 * step)
        # PCHIP's acceleration jumps at samples; elsewhere the central difference is exact to 1e-9.
        away = np.abs(times[:, None] - recording.times[i]).min(axis=1) > 2.0 * step
        np.testing.assert_allclose(track.at(times)[1][away], slope[away], atol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_everybody_at_once_equals_each_person_alone(seed: int) -> None:
    recording = random_recording(seed)
    times = np.linspace(0.0, recording.duration, 101)
    crowd = recording.at(times)
    for i in range(recording.n_people):
        position, velocity, heading = recording.person(i).at(times)
        here = crowd.present[:, i]
        np.testing.assert_array_equal(here, (times >= recording.start_time[i]) & (times <= recording.end_time[i]))
        np.testing.assert_array_equal(crowd.position[here, i], position[here])
        np.testing.assert_array_equal(crowd.velocity[here, i], velocity[here])
        np.testing.assert_array_equal(crowd.heading[here, i], heading[here])
        assert np.isnan(crowd.position[~here, i]).all() and np.isnan(crowd.heading[~here, i]).all()


def test_one_time_equals_the_same_time_among_many() -> None:
    recording = random_recording(1)
    times = np.linspace(0.0, recording.duration, 37)
    many = recording.at(times)
    for k, time in enumerate(times):
        one = recording.at([time])
        np.testing.assert_array_equal(one.position[0], many.position[k])
        np.testing.assert_array_equal(one.heading[0], many.heading[k])


def test_rounding_of_a_time_does_not_take_a_person_away() -> None:
    recording = recording_of(([0.0, 6.8], [(0.0, 0.0), (6.8, 0.0)]))
    late = np.nextafter(6.8, 7.0)
    crowd = recording.at([late, 6.9])
    assert crowd.present[:, 0].tolist() == [True, False]
    np.testing.assert_allclose(crowd.velocity[0, 0], [1.0, 0.0])


def test_outside_the_track_a_person_rests_at_its_nearest_end() -> None:
    recording = recording_of(([1.0, 2.0], [(0.0, 0.0), (0.0, 1.0)]))
    position, velocity, heading = recording.person(0).at([0.0, 5.0])
    np.testing.assert_array_equal(position, [[0.0, 0.0], [0.0, 1.0]])
    np.testing.assert_array_equal(velocity, 0.0)
    np.testing.assert_allclose(heading, np.pi / 2.0)


def test_standing_person_keeps_its_last_heading() -> None:
    recording = recording_of(([0.0, 1.0, 9.0, 10.0], [(0.0, 0.0), (-1.0, 0.0), (-1.0, 0.0), (-1.0, -1.0)]))
    _, velocity, heading = recording.person(0).at([0.5, 4.0, 8.9, 9.5])
    np.testing.assert_allclose(velocity[[1, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(heading[:3]), np.pi, atol=1e-12)
    assert heading[3] == pytest.approx(-np.pi / 2.0)


def test_person_who_has_not_moved_yet_faces_its_next_motion() -> None:
    recording = recording_of(([0.0, 5.0, 6.0], [(0.0, 0.0), (0.0, 0.0), (0.0, 1.0)]))
    np.testing.assert_allclose(recording.person(0).at([0.0, 2.0, 5.0])[2], np.pi / 2.0)


def test_person_who_never_moves_faces_zero() -> None:
    recording = recording_of(([0.0, 5.0], [(1.0, 2.0), (1.0, 2.0)]), ([0.0, 5.0], [(0.0, 0.0), (0.0, 5.0)]))
    np.testing.assert_array_equal(recording.person(0).at([0.0, 2.0, 5.0])[2], 0.0)
    np.testing.assert_allclose(recording.person(1).at([0.0, 2.0, 5.0])[2], np.pi / 2.0)


def test_creeping_person_does_not_turn_with_its_jitter() -> None:
    # 2 cm to and fro once a second: at most 0.03 m/s, below the threshold of motion.
    times = [0.0, 1.0, *np.arange(2.0, 12.0)]
    positions = [(0.0, 0.0), (1.0, 0.0), *[(1.0 + 0.02 * (k % 2), 0.02 * (k % 3)) for k in range(10)]]
    heading = recording_of((times, positions)).person(0).at(np.linspace(2.0, 11.0, 200))[2]
    assert np.ptp(heading) == 0.0


def test_track_view_refuses_an_index_that_does_not_exist() -> None:
    recording = recording_of(([0.0, 1.0], [(0.0, 0.0), (1.0, 0.0)]))
    with pytest.raises(IndexError, match=r"person index 1 .* allowed: 0 to 0"):
        recording.person(1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ids": np.array([2, 1])}, "ascending"),
        ({"frame_rate": 0.0}, "frame_rate"),
        ({"times": (np.array([0.0, 1.0]), np.array([1.0, 1.0]))}, "strictly increasing"),
        ({"positions": (np.zeros((2, 2)), np.zeros((3, 2)))}, r"person 2 has times \(2,\), positions \(3, 2\)"),
        ({"positions": (np.zeros((2, 2)),)}, "expected one of each"),
    ],
)
def test_recording_refuses_fields_that_break_its_invariants(changes: dict, message: str) -> None:
    good = {
        "name": "made",
        "variant": "text",
        "frame_rate": 25.0,
        "ids": np.array([1, 2]),
        "times": (np.array([0.0, 1.0]),) * 2,
        "positions": (np.zeros((2, 2)),) * 2,
        "checksum": "",
    }
    Recording(**good)
    with pytest.raises(ValueError, match=message):
        Recording(**{**good, **changes})


def test_recording_is_not_changed_by_its_caller() -> None:
    times = np.array([0.0, 1.0])
    recording = Recording(
        name="made",
        variant="text",
        frame_rate=25.0,
        ids=np.array([1]),
        times=(times,),
        positions=(np.zeros((2, 2)),),
        checksum="",
    )
    times[0] = -1.0
    assert recording.start_time[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        recording.times[0][0] = 1.0
