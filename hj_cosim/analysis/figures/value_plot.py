"""The value function as filled contours with its zero level, on given axes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable

from hj_cosim.analysis.figures import style

VALUE_LIMIT = 15.0  # m, beyond which all values look the same: the cubic of V(0, ·) reaches hundreds


def draw_value_contours(
    axes: Axes, along: np.ndarray, aside: np.ndarray, values: np.ndarray, limit: float = VALUE_LIMIT
) -> ScalarMappable:
    """Draw V (len(aside), len(along)) over two axes; the zero level is a solid line, ± limit/3 are dotted.

    Returns:
        What a colour bar is made of.
    """
    clipped = np.clip(values, -limit, limit)
    levels = np.linspace(-limit, limit, 31)
    filled = axes.contourf(
        along, aside, clipped, levels=levels, cmap=style.VALUE_COLOURS, norm=style.value_norm(limit), zorder=0.5
    )
    third = limit / 3.0
    for level, look in (
        (0.0, {"colors": style.BLACK, "linewidths": 1.3}),
        (-third, {"colors": style.GREY, "linewidths": 0.8, "linestyles": ":"}),
        (third, {"colors": style.GREY, "linewidths": 0.8, "linestyles": ":"}),
    ):
        if clipped.min() < level < clipped.max():  # else there is no such line, and Matplotlib complains
            axes.contour(along, aside, clipped, levels=[level], zorder=2, **look)
    return filled


def value_colours(values: np.ndarray, limit: float = VALUE_LIMIT) -> np.ndarray:
    """Return the colour of each value, (..., 4); cars outside the grid (+inf) are as safe as can be."""
    return style.VALUE_COLOURS(style.value_norm(limit)(np.clip(values, -limit, limit)))


def value_scale(limit: float = VALUE_LIMIT) -> ScalarMappable:
    """Return what a colour bar of `value_colours` is made of."""
    return ScalarMappable(norm=style.value_norm(limit), cmap=style.VALUE_COLOURS)
