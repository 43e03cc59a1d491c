"""Who is before, beside and behind whom, in the same lane and the next ones, as highD names them."""

import numpy as np
from numba import njit

# In the order of highD's columns.
NEIGHBOURS = (
    "precedingId",
    "followingId",
    "leftPrecedingId",
    "leftAlongsideId",
    "leftFollowingId",
    "rightPrecedingId",
    "rightAlongsideId",
    "rightFollowingId",
)
_LANES = 1 << 20  # more than any road has
NOBODY = -1


def neighbours(frame: np.ndarray, lane: np.ndarray, x: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Return the rows (N, 8) of each row's neighbours in its frame, in the order of NEIGHBOURS; NOBODY without one.

    In the same lane the nearest centres before and behind count. In a next lane those that overlap lengthwise are
    alongside, of which the nearest counts, and the nearest of the others are before or behind.

    Args:
        frame: (N,) int.
        lane: (N,) int, from the right.
        x: (N,) m, of the centres.
        length: (N,) m.
    """
    order = np.lexsort((x, lane, frame))
    key = (frame * _LANES + lane)[order]
    blocks = [
        (np.searchsorted(key, key + side, "left"), np.searchsorted(key, key + side, "right")) for side in (0, 1, -1)
    ]
    found = _found(x[order], length[order], np.array(blocks))
    result = np.empty_like(found)
    result[order] = np.where(found >= 0, order[found], NOBODY)
    return result


@njit(cache=True)
def _found(x: np.ndarray, length: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return `neighbours` of sorted rows; `blocks` (3, 2, N): where its own, left and right lane's rows are."""
    found = np.full((len(x), 8), NOBODY)
    for row in range(len(x)):
        if row + 1 < blocks[0, 1, row]:
            found[row, 0] = row + 1
        if row - 1 >= blocks[0, 0, row]:
            found[row, 1] = row - 1
        for side in range(1, 3):
            first, stop = blocks[side, 0, row], blocks[side, 1, row]
            place = first + np.searchsorted(x[first:stop], x[row])
            column, nearest = 3 * side - 1, np.inf
            ahead = place
            while ahead < stop and x[ahead] - x[row] < 0.5 * (length[ahead] + length[row]):
                if x[ahead] - x[row] < nearest:
                    found[row, column + 1], nearest = ahead, x[ahead] - x[row]
                ahead += 1
            behind = place - 1
            while behind >= first and x[row] - x[behind] < 0.5 * (length[behind] + length[row]):
                if x[row] - x[behind] < nearest:
                    found[row, column + 1], nearest = behind, x[row] - x[behind]
                behind -= 1
            if ahead < stop:
                found[row, column] = ahead
            if behind >= first:
                found[row, column + 2] = behind
    return found
