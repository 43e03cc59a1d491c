"""Upwind first derivatives from first differences, one scheme a function (Osher & Fedkiw 2003, chapter 3).

A scheme of radius r gets the 2r first differences D_m = (V[i+m+1] − V[i+m])/Δx, m = −r … r−1, around every node i of a
slab and returns the left- and the right-biased derivative there. Rows of the work arrays are `PITCH` apart, a constant,
because only then can the compiler see that the rows do not overlap, and the loops run in SIMD.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types

from hj_cosim.config import Scheme
from hj_cosim.reachability.dynamics import VECTOR, state_function

MOST_NODES = 2048  # of a slab, and so of a grid's innermost axis
PITCH = MOST_NODES + 16  # not a power of two: rows would fall on the same places of the cache
DERIVATIVES = types.void(VECTOR, types.int64, VECTOR, VECTOR)

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
def first_order(differences, count, left, right):  # type: ignore[no-untyped-def]
    """Return the differences to the left and to the right."""
    for i in range(count):
        left[i] = differences[i]
        right[i] = differences[PITCH + i]


@state_function
def eno2(differences, count, left, right):  # type: ignore[no-untyped-def]
    """Correct the first difference by the smaller of the two second differences."""
    half = np.float32(0.5)
    for i in range(count):
        d0, d1 = differences[i], differences[PITCH + i]
        d2, d3 = differences[2 * PITCH + i], differences[3 * PITCH + i]
        before, centre, after = d1 - d0, d2 - d1, d3 - d2
        left[i] = d1 + half * (before if abs(before) <= abs(centre) else centre)
        right[i] = d2 - half * (centre if abs(centre) <= abs(after) else after)


@state_function
def weno3(differences, count, left, right):  # type: ignore[no-untyped-def]
    """Weigh the two second-order stencils by their smoothness (Jiang & Peng 2000, r = 2)."""
    half, one, two = np.float32(0.5), np.float32(1.0), np.float32(2.0)
    for i in range(count):
        d0, d1 = differences[i], differences[PITCH + i]
        d2, d3 = differences[2 * PITCH + i], differences[3 * PITCH + i]
        before, centre, after = d1 - d0, d2 - d1, d3 - d2
        smooth_before = before * before + _EPSILON
        smooth_centre = centre * centre + _EPSILON
        smooth_after = after * after + _EPSILON
        middle = half * (d1 + d2)
        # Weights 1 : 2 over (s + ε)². The quotients keep their squares within float32's range.
        scale = one / (smooth_before + smooth_centre)
        outer, inner = smooth_centre * scale, smooth_before * scale
        outer, inner = outer * outer, two * inner * inner
        left[i] = (outer * (d1 + half * before) + inner * middle) / (outer + inner)
        scale = one / (smooth_after + smooth_centre)
        outer, inner = smooth_centre * scale, smooth_after * scale
        outer, inner = outer * outer, two * inner * inner
        right[i] = (outer * (d2 - half * after) + inner * middle) / (outer + inner)


@state_function
def weno5(differences, count, left, right):  # type: ignore[no-untyped-def]
    """Weigh the three third-order stencils by their smoothness (Jiang & Peng 2000; Osher & Fedkiw, eq. 3.25-3.39).

    The left- and the right-biased derivative share the curvature terms and two of the three stencils.
    """
    quarter, thirteen_twelfths = np.float32(0.25), np.float32(13.0 / 12.0)
    third, sixth, five_sixths = np.float32(1.0 / 3.0), np.float32(1.0 / 6.0), np.float32(5.0 / 6.0)
    seven_sixths, eleven_sixths = np.float32(7.0 / 6.0), np.float32(11.0 / 6.0)
    one, three, six = np.float32(1.0), np.float32(3.0), np.float32(6.0)
    for i in range(count):
        d0, d1, d2 = differences[i], differences[PITCH + i], differences[2 * PITCH + i]
        d3, d4, d5 = differences[3 * PITCH + i], differences[4 * PITCH + i], differences[5 * PITCH + i]
        e0, e1, e2, e3, e4 = d1 - d0, d2 - d1, d3 - d2, d4 - d3, d5 - d4
        curve1, curve2, curve3, curve4 = e1 - e0, e2 - e1, e3 - e2, e4 - e3
        curve1, curve2 = thirteen_twelfths * curve1 * curve1, thirteen_twelfths * curve2 * curve2
        curve3, curve4 = thirteen_twelfths * curve3 * curve3, thirteen_twelfths * curve4 * curve4
        tilt_a, tilt_b = e1 + e2, e2 + e3
        middle_low = five_sixths * d2 - sixth * d1 + third * d3
        middle_high = five_sixths * d3 - sixth * d4 + third * d2

        # e1·3 − e0 = d0 − 4 d1 + 3 d2 and so on: smoothness in second differences loses fewer digits.
        tilt = three * e1 - e0
        s0 = curve1 + quarter * tilt * tilt + _EPSILON
        s1 = curve2 + quarter * tilt_a * tilt_a + _EPSILON
        tilt = three * e2 - e3
        s2 = curve3 + quarter * tilt * tilt + _EPSILON
        # Weights 1 : 6 : 3 over (s + ε)². The quotients keep their squares within float32's range.
        scale = one / (s0 + s1 + s2)
        s0, s1, s2 = s0 * scale, s1 * scale, s2 * scale
        a, b, c = s1 * s2, s0 * s2, s0 * s1
        a, b, c = a * a, six * b * b, three * c * c
        outer = third * d0 - seven_sixths * d1 + eleven_sixths * d2
        left[i] = (a * outer + b * middle_low + c * middle_high) / (a + b + c)

        tilt = three * e3 - e4
        s0 = curve4 + quarter * tilt * tilt + _EPSILON
        s1 = curve3 + quarter * tilt_b * tilt_b + _EPSILON
        tilt = three * e2 - e1
        s2 = curve2 + quarter * tilt * tilt + _EPSILON
        scale = one / (s0 + s1 + s2)
        s0, s1, s2 = s0 * scale, s1 * scale, s2 * scale
        a, b, c = s1 * s2, s0 * s2, s0 * s1
        a, b, c = a * a, six * b * b, three * c * c
        outer = third * d5 - seven_sixths * d4 + eleven_sixths * d3
        right[i] = (a * outer + b * middle_high + c * middle_low) / (a + b + c)


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        DifferenceScheme("first_order", 1, first_order, 1),
        DifferenceScheme("eno2", 2, eno2, 2),
        DifferenceScheme("weno3", 2, weno3, 3),
        DifferenceScheme("weno5", 3, weno5, 3),
    )
}
