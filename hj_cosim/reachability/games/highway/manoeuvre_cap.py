"""A highway table capped by what manoeuvres guarantee: V where the grid is right, a lower bound where it is too high.

A grid smears the corners of V(0, ·), "stay ahead" against "get out of the way", over its cells, and V comes out metres
too high in their wake: where a fast car closes in from behind, a third of all games from V = 2 m were lost. Manoeuvres
are judged without a grid (`manoeuvres`), and the game's value is nowhere below what one of them guarantees. A value
above that may be right, for the robot can do better than a manoeuvre, but nobody knows; the cap gives it up. Among cars
that do their duties no manoeuvre guarantees more than their level (`duty_bound`): there the cap opens towards it.
"""

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from hj_cosim.reachability.games.highway.manoeuvres import (
    Manoeuvres,
    best_guarantee,
    highest_guarantee,
    manoeuvres_of,
    other_at,
    room_for_paths,
)
from hj_cosim.reachability.games.highway.paths import Start
from hj_cosim.reachability.games.highway.target import target_at
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.table.value_scale import scaled, unscaled


@njit(cache=True)
def raised(guarantee: float, level: float) -> float:
    """Return the cap that a guarantee of up to a level is, m: the same up to 0, and growing without bound towards it.

    A guarantee at its level says nothing of V above it, and one a little below would cut V down from any height.
    """
    if guarantee <= 0.0 or level == math.inf:
        return guarantee
    return math.inf if guarantee >= level else guarantee * level / (level - guarantee)


@njit(cache=True, nogil=True)
def _cap_heading(
    manoeuvres: Manoeuvres,
    axes: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    shear: float,
    k: int,
    values: np.ndarray,
    capped: np.ndarray,
) -> None:
    """Write the capped values of the nodes with the k-th heading; arguments as of `capped`.

    A path depends on heading and speed alone, so it is found once for all positions. A node whose value one manoeuvre
    guarantees needs no other.
    """
    xi, y, theta, v_r, v_o = axes
    game, count = manoeuvres.game, len(v_o)
    level = highest_guarantee(game)
    speeds = np.linspace(v_o[0], v_o[-1], 2 * count - 1)  # of the nodes and half-way between them
    others = [other_at(game, speed) for speed in speeds]
    tops, deficits, excess = np.empty(count), np.empty(count), np.zeros(count + 1)  # on the scale of look-ups
    for m in range(len(v_r)):
        paths, start = room_for_paths(manoeuvres), Start(theta[k], v_r[m], 0.0, 0.0, 0.0)
        ahead = shear * (speeds * speeds - v_r[m] * v_r[m])  # p_x − ξ
        for i in range(len(xi)):
            for j in range(len(y)):
                line = capped[i, j, k, m]
                for n in range(count):
                    p_x, value = xi[i] + ahead[2 * n], values[i, j, k, m, n]
                    sure = best_guarantee(manoeuvres, start, paths, others[2 * n], p_x, y[j], min(value, level))
                    line[n] = min(value, raised(sure, level))
                    tops[n] = scaled(target_at(game.target, p_x, y[j], theta[k], v_r[m], v_o[n]))
                    deficits[n] = max(tops[n] - scaled(line[n]), 0.0)
                # What is guaranteed bends where the other car soon reaches its top speed: as looked up (`lookup`), V
                # half-way between two of its speeds would be above it by metres.
                for n in range(count - 1):
                    p_x, of = xi[i] + ahead[2 * n + 1], 2 * n + 1
                    top = scaled(target_at(game.target, p_x, y[j], theta[k], v_r[m], speeds[of]))
                    between = top - 0.5 * (deficits[n] + deficits[n + 1])
                    enough = min(unscaled(between), level)
                    sure = best_guarantee(manoeuvres, start, paths, others[of], p_x, y[j], enough)
                    excess[n + 1] = max(between - scaled(raised(sure, level)), 0.0)
                for n in range(count):
                    more = max(excess[n], excess[n + 1])
                    if more > 0.0:
                        line[n] = unscaled(tops[n] - deficits[n] - more)


def capped(values: np.ndarray, grid: Grid, parameters: Mapping[str, float], threads: int = 2) -> np.ndarray:
    """Return V at the nodes of a highway table, but no more than the best manoeuvre guarantees.

    Half-way between two nodes along v_o, too, as V is looked up: both nodes give way there.

    Args:
        values: V at the nodes, float32.
        grid: its nodes.
        parameters: of the game, all of them.
        threads: that the headings are divided among.
    """
    manoeuvres = manoeuvres_of(parameters, grid)
    axes = tuple(np.ascontiguousarray(axis, np.float64) for axis in grid.axes)
    found = np.empty_like(values)

    def cap(k: int) -> None:
        _cap_heading(manoeuvres, axes, parameters["braking_shear"], k, values, found)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(cap, range(values.shape[2])))
    return found
