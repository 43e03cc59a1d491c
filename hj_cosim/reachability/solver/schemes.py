"""Upwind first derivatives from first differences, one scheme a function (Osher & Fedkiw 2003, chapter 3).

A scheme of radius r gets the 2r first differences D_m = (V[i+m+1] − V[i+m])/Δx, m = −r … r−1, around every node i of a
slab, and the game's bound α on |∂H/∂p|. It makes the left- and the right-biased derivative, writes their mean and adds
α times half their difference to the dissipation. Rows of the work arrays are `PITCH` apart, a constant,
because only then can the compiler see that the rows do not overlap, and the loops run in SIMD.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types

from hj_cosim.reachability.games.contract import VECTOR, state_function
from hj_cosim.settings import Scheme

MOST_NODES = 2048  # of a slab, and so of a grid's innermost axis
PITCH = MOST_NODES + 16  # not a power of two: rows would fall on the same places of the cache
DERIVATIVES = types.void(VECTOR, VECTOR, VECTOR, VECTOR)

# Keeps the weights finite where V is flat; as in Osher & Fedkiw for derivatives of order one.
_EPSILON = np.float32(1e-6)


@dataclass(frozen=True)
class DifferenceScheme:
    """A spatial scheme and what goes with it."""

    name: Scheme
    radius: int  # nodes that the stencil reaches to either side
    derivatives: Any  # the line function
    runge_kutta: int  # the order in time that matches


@state_function
def first_order(differences, bounds, centre, dissipated):  # type: ignore[no-untyped-def]
    """Take the differences to the left and to the right."""
    half = np.float32(0.5)
    for i in range(centre.shape[0]):
        left, right = differences[i], differences[PITCH + i]
        centre[i] = half * (right + left)
        dissipated[i] += half * bounds[i] * (right - left)


@state_function
def eno2(differences, bounds, centre, dissipated):  # type: ignore[no-untyped-def]
    """Correct the first difference by the smaller of the two second differences."""
    half = np.float32(0.5)
    for i in range(centre.shape[0]):
        d0, d1 = differences[i], differences[PITCH + i]
        d2, d3 = differences[2 * PITCH + i], differences[3 * PITCH + i]
        before, middle, after = d1 - d0, d2 - d1, d3 - d2
        left = d1 + half * (before if abs(before) <= abs(middle) else middle)
        right = d2 - half * (middle if abs(middle) <= abs(after) else after)
        centre[i] = half * (right + left)
        dissipated[i] += half * bounds[i] * (right - left)


@state_function
def weno3(differences, bounds, centre, dissipated):  # type: ignore[no-untyped-def]
    """Weigh the two second-order stencils by their smoothness (Jiang & Peng 2000, r = 2)."""
    half, one, two = np.float32(0.5), np.float32(1.0), np.float32(2.0)
    for i in range(centre.shape[0]):
        d0, d1 = differences[i], differences[PITCH + i]
        d2, d3 = differences[2 * PITCH + i], differences[3 * PITCH + i]
        before, middle, after = d1 - d0, d2 - d1, d3 - d2
        smooth_before = before * before + _EPSILON
        smooth_middle = middle * middle + _EPSILON
        smooth_after = after * after + _EPSILON
        inner = half * (d1 + d2)
        # Weights 1 : 2 over (s + ε)². The quotients keep their squares within float32's range.
        scale = one / (smooth_before + smooth_middle)
        a, b = smooth_middle * scale, smooth_before * scale
        a, b = a * a, two * b * b
        left = (a * (d1 + half * before) + b * inner) / (a + b)
        scale = one / (smooth_after + smooth_middle)
        a, b = smooth_middle * scale, smooth_after * scale
        a, b = a * a, two * b * b
        right = (a * (d2 - half * after) + b * inner) / (a + b)
        centre[i] = half * (right + left)
        dissipated[i] += half * bounds[i] * (right - left)


@state_function
def weno5(differences, bounds, centre, dissipated):  # type: ignore[no-untyped-def]
    """Weigh the three third-order stencils by their smoothness (Jiang & Peng 2000; Osher & Fedkiw, eq. 3.25-3.39).

    The left- and the right-biased derivative share the curvatures and two of their three stencils. Everything is
    written in second differences e, which loses fewer digits: d0 − 4 d1 + 3 d2 = 3 e1 − e0, and so on, and a stencil
    is d2 or d3 plus a correction.
    """
    half, one, three, six = np.float32(0.5), np.float32(1.0), np.float32(3.0), np.float32(6.0)
    two, sixth = np.float32(2.0), np.float32(1.0 / 6.0)
    # Four times the smoothness indicators, and four times ε: the weights are the same.
    curvature, epsilon = np.float32(13.0 / 3.0), np.float32(4.0) * _EPSILON
    for i in range(centre.shape[0]):
        d0, d1, d2 = differences[i], differences[PITCH + i], differences[2 * PITCH + i]
        d3, d4, d5 = differences[3 * PITCH + i], differences[4 * PITCH + i], differences[5 * PITCH + i]
        e0, e1, e2, e3, e4 = d1 - d0, d2 - d1, d3 - d2, d4 - d3, d5 - d4
        c1, c2, c3, c4 = e1 - e0, e2 - e1, e3 - e2, e4 - e3
        c1, c2 = curvature * c1 * c1 + epsilon, curvature * c2 * c2 + epsilon
        c3, c4 = curvature * c3 * c3 + epsilon, curvature * c4 * c4 + epsilon

        # Weights 1 : 6 : 3 over (s + ε)², multiplied out. The quotients keep the products within float32's range.
        tilt0, tilt1, tilt2 = three * e1 - e0, e1 + e2, three * e2 - e3
        s0, s1, s2 = c1 + tilt0 * tilt0, c2 + tilt1 * tilt1, c3 + tilt2 * tilt2
        scale = one / (s0 + s1 + s2)
        s0, s1, s2 = s0 * scale, s1 * scale, s2 * scale
        a, b, c = s1 * s2, s0 * s2, s0 * s1
        a, b, c = a * a, six * b * b, three * c * c
        # Corrections to d2, in sixths: 2 d0 − 7 d1 + 11 d2, −d1 + 5 d2 + 2 d3, 2 d2 + 5 d3 − d4.
        outer, near, far = three * e1 + two * (e1 - e0), e1 + two * e2, three * e2 + e2 - e3
        left = d2 + sixth * (a * outer + b * near + c * far) / (a + b + c)

        tilt0, tilt1, tilt2 = three * e3 - e4, e2 + e3, three * e2 - e1
        s0, s1, s2 = c4 + tilt0 * tilt0, c3 + tilt1 * tilt1, c2 + tilt2 * tilt2
        scale = one / (s0 + s1 + s2)
        s0, s1, s2 = s0 * scale, s1 * scale, s2 * scale
        a, b, c = s1 * s2, s0 * s2, s0 * s1
        a, b, c = a * a, six * b * b, three * c * c
        outer, near, far = three * e3 + two * (e3 - e4), e3 + two * e2, three * e2 + e2 - e1
        right = d3 - sixth * (a * outer + b * near + c * far) / (a + b + c)
        centre[i] = half * (right + left)
        dissipated[i] += half * bounds[i] * (right - left)


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        DifferenceScheme("first_order", 1, first_order, 1),
        DifferenceScheme("eno2", 2, eno2, 2),
        DifferenceScheme("weno3", 2, weno3, 3),
        DifferenceScheme("weno5", 3, weno5, 3),
    )
}
