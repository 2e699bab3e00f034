"""Which people of a recording are replaced by agents: a seeded permutation, of which a share is taken."""

from math import floor

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.recordings.recording import Recording


def replaceable_people(recording: Recording, *, minimum_displacement: float) -> NDArray[np.bool_]:
    """Who can become an agent: people whose last position is far enough from their first.

    Args:
        recording: The first and last position of each person are compared.
        minimum_displacement: Straight distance between the two that is far enough, >= 0 [m].

    Returns:
        True for those who can be replaced, (n_people,).
    """
    displacement = recording.end - recording.start
    return np.hypot(displacement[:, 0], displacement[:, 1]) >= minimum_displacement


def replaced_people(recording: Recording, *, share: float, seed: int, minimum_displacement: float) -> NDArray[np.int64]:
    """Draw the people who become agents.

    The seed permutes all people; those who cannot be replaced are passed over; the first
    floor(share * n_people + 1/2) of the rest are taken: the share counts the original pedestrians (paper section IV).
    At least one person, at most all who can be replaced. The draws of one seed are nested: a smaller share is a
    subset of a larger one.

    Args:
        recording: All its people are permuted, and the share counts all of them.
        share: Agents as a share of all people, in (0, 1].
        seed: Seed of the permutation, >= 0; draw k has seed k.
        minimum_displacement: People whose end is nearer to their start are never replaced [m].

    Returns:
        Indices into `recording.ids`, ascending.

    Raises:
        ValueError: If share is not in (0, 1] or nobody can be replaced.
    """
    if not 0.0 < share <= 1.0:
        raise ValueError(f"share = {share!r} is not allowed; allowed: numbers in (0, 1]")
    order = np.random.default_rng(seed).permutation(recording.n_people)
    order = order[replaceable_people(recording, minimum_displacement=minimum_displacement)[order]]
    if not order.size:
        raise ValueError(
            f"nobody in recording {recording.name!r} moves {minimum_displacement} m or more; nobody can be replaced"
        )
    return np.sort(order[: max(1, floor(share * recording.n_people + 0.5))]).astype(np.int64)
