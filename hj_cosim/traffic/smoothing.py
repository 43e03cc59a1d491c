"""A polyline made smooth: what a network draws as straight pieces becomes a curve that can be followed."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

# Real networks have a vertex every 50 m and bends of several degrees there. A spline through them swings out by metres;
# resampled and smoothed like this it stays within 0.6 m, and so do its curvature and whoever follows it.
KNOT_SPACING = 10.0  # m
SMOOTHNESS = 20.0  # weight of the squared third differences against the squared deviations


def smooth_knots(along: np.ndarray, points: np.ndarray, length: float, *, closed: bool) -> np.ndarray:
    """Return knots (K, 2), m, evenly spaced in s, of a curve without kinks beside a polyline.

    They are the least squares of their deviations from the polyline and, weighted, of their third differences (Eilers
    & Marx 1996, Flexible smoothing with B-splines and penalties).

    Args:
        along: (N,) m, the s of the vertices, ascending from 0 to `length`.
        points: (N, 2) m, the vertices.
        length: m.
        closed: whether the last vertex meets the first; then the last knot is the first again.
    """
    count = max(round(length / KNOT_SPACING), 8)
    at = np.linspace(0.0, length, count + 1)
    target = np.column_stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)])
    if closed:
        target = target[:-1]
        difference = _rotation(count) - sparse.identity(count)
        third = difference @ difference @ difference
    else:
        third = sparse.diags([-1.0, 3.0, -3.0, 1.0], [0, 1, 2, 3], shape=(count - 2, count + 1))
    matrix = (sparse.identity(len(target)) + SMOOTHNESS * (third.T @ third)).tocsc()
    knots = np.column_stack([spsolve(matrix, target[:, axis]) for axis in (0, 1)])
    return np.vstack([knots, knots[:1]]) if closed else knots


def _rotation(count: int) -> sparse.csr_matrix:
    """Return the matrix that takes every knot of a closed curve to the next one."""
    return sparse.csr_matrix((np.ones(count), (np.arange(count), (np.arange(count) + 1) % count)))
