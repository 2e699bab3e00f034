"""Who shares a place with whom, when everybody needs one for a while."""

from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray


def share_slots(begin: NDArray[np.number], end: NDArray[np.number]) -> NDArray[np.int64]:
    """Give intervals the fewest slots, so that no two in one slot overlap or meet; the lowest free slot is taken.

    Args:
        begin: (n,) beginnings, in any unit.
        end: (n,) ends, included, not before the beginnings.

    Returns:
        Slot of each interval, shape (n,), counted from 0.
    """
    slot = np.zeros(len(begin), dtype=np.int64)
    free: list[int] = []
    busy: list[tuple[float, int]] = []
    for i in np.argsort(begin, kind="stable").tolist():
        while busy and busy[0][0] < begin[i]:
            heappush(free, heappop(busy)[1])
        slot[i] = heappop(free) if free else len(busy)
        heappush(busy, (end[i], int(slot[i])))
    return slot
