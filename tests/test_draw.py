"""Which people are replaced."""

from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.recordings.draw import replaceable_people, replaced_people


def crowd_of_walkers(n_people: int, n_standing: int) -> Recording:
    length = np.where(np.arange(n_people) < n_standing, 0.5, 5.0)
    return Recording(
        name="walkers",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(n_people),
        times=(np.array([0.0, 5.0]),) * n_people,
        positions=tuple(np.array([[0.0, i], [length[i], i]]) for i in range(n_people)),
        checksum="",
    )


@pytest.mark.parametrize(("share", "count"), [(0.1, 43), (0.3, 130), (0.7, 304), (0.9, 391), (1.0, 427)])
def test_share_counts_the_original_people_and_stops_at_the_replaceable(share: float, count: int) -> None:
    # 434 people of whom 7 stay: the numbers of students003.
    recording = crowd_of_walkers(434, 7)
    chosen = replaced_people(recording, share=share, seed=3, minimum_displacement=1.0)
    assert len(chosen) == count
    assert (np.diff(chosen) > 0).all()
    assert replaceable_people(recording, minimum_displacement=1.0)[chosen].all()


def test_draws_of_one_seed_are_nested_and_of_two_seeds_differ() -> None:
    recording = crowd_of_walkers(100, 5)

    def draw(share: float, seed: int) -> set[int]:
        return set(replaced_people(recording, share=share, seed=seed, minimum_displacement=1.0).tolist())

    for seed in range(5):
        assert draw(0.1, seed) < draw(0.3, seed) < draw(0.7, seed) < draw(0.9, seed)
    assert draw(0.1, 0) != draw(0.1, 1)
    assert draw(0.1, 0) == draw(0.1, 0)


def test_every_walker_is_drawn_about_equally_often() -> None:
    recording = crowd_of_walkers(20, 2)
    counts = np.zeros(20)
    for seed in range(400):
        counts[replaced_people(recording, share=0.45, seed=seed, minimum_displacement=1.0)] += 1
    assert (counts[:2] == 0).all()
    # Binomial(400, 1/2): five standard deviations are 50.
    assert (np.abs(counts[2:] - 200.0) < 50.0).all()


def test_small_recording_gives_at_least_one_agent() -> None:
    tiny = load_recording(Path(__file__).parent / "data" / "tiny")
    assert len(replaced_people(tiny, share=0.1, seed=0, minimum_displacement=1.0)) == 1


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1])
def test_share_outside_its_range_is_refused(share: float) -> None:
    with pytest.raises(ValueError, match="share"):
        replaced_people(crowd_of_walkers(3, 0), share=share, seed=0, minimum_displacement=1.0)


def test_crowd_in_which_nobody_moves_is_refused() -> None:
    with pytest.raises(ValueError, match="nobody in recording 'walkers' moves"):
        replaced_people(crowd_of_walkers(3, 3), share=0.5, seed=0, minimum_displacement=1.0)
