"""The paper's slice of the value function: two parallel cars, v_r = 10 m/s, v_o = 20 m/s."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.value_plot import draw_value_contours
from hj_cosim.analysis.values import value_field
from hj_cosim.reachability.table.table import ValueTable

POINTS_ALONG, POINTS_ASIDE = 401, 161


def value_slice(
    table: ValueTable, robot_speed: float = 10.0, other_speed: float = 20.0, heading: float = 0.0
) -> style.Drawing:
    """Return V over (p_x_rel, p_y_rel), the robot relative to the other car, which stands at the origin.

    Args:
        table: V.
        robot_speed, other_speed: v_r and v_o, m/s.
        heading: θ_r, rad.
    """
    held = np.array([0.0, 0.0, heading, robot_speed, other_speed])
    along = np.linspace(*table.extent(0, held), POINTS_ALONG)
    aside = np.linspace(*table.extent(1, held), POINTS_ASIDE)
    origin = np.zeros(1)
    values = value_field(table, along, aside, heading, robot_speed, origin, origin, np.array([other_speed]))
    with style.house_style():
        figure = Figure(figsize=(style.COLUMN_WIDTH * 1.5, 2.9), layout="constrained")
        axes = figure.subplots()
        filled = draw_value_contours(axes, along, aside, values)
        axes.set(xlabel="robot ahead of the other car, $p_x$ (m)", ylabel="robot to its left, $p_y$ (m)")
        axes.set_title(
            rf"$v_r$ = {robot_speed:g} m/s, $v_o$ = {other_speed:g} m/s, $\theta_r$ = {heading:g} rad", fontsize=8.5
        )
        axes.grid(False)
        figure.colorbar(filled, ax=axes, label="V (m), black: V = 0", extend="both", ticks=[-15, -10, -5, 0, 5, 10, 15])
    px, py = np.meshgrid(along, aside)
    return style.Drawing(figure, pd.DataFrame({"p_x": px.ravel(), "p_y": py.ravel(), "value": values.ravel()}))
