"""The paper's idea in one picture: the robot among cars, on the value function that planner and filter share."""

import numpy as np
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.staged import Situation
from hj_cosim.analysis.figures.value_plot import draw_value_contours
from hj_cosim.reachability.table.table import ValueTable

BEHIND, AHEAD = 40.0, 80.0  # m
WEAVING = Situation.of(1, 25.0, [(28.0, 1, 19.0), (-18.0, 2, 25.0), (55.0, 3, 22.0), (12.0, 0, 22.0)])
BOXED_IN = Situation.of(1, 23.0, [(14.0, 1, 20.0), (-14.0, 1, 25.0), (3.0, 2, 23.0), (-2.0, 0, 23.0)])


def schematic(table: ValueTable) -> style.Drawing:
    """Return the robot and four cars, over the least V that the robot would have at each place."""
    title = "V if the robot were there, at its speed; black: V = 0. Numbers: speed (m/s) and V (m) of each car"
    return _situation_on_values(WEAVING, table, title)


def boxed_in(table: ValueTable) -> style.Drawing:
    """Return the robot boxed in by four cars: no place nearby is safe, if all cars behave adversarially."""
    title = "boxed in: every way out leads through V < 0. Numbers: speed (m/s) and V (m) of each car"
    return _situation_on_values(BOXED_IN, table, title)


def _situation_on_values(situation: Situation, table: ValueTable, title: str) -> style.Drawing:
    road = situation.road
    along = np.linspace(-BEHIND, AHEAD, 361)
    lines = road.lane_lines(0.0)
    aside = np.linspace(lines[0], lines[-1], 121)
    values = situation.field(table, along, aside)
    with style.house_style():
        figure = Figure(figsize=(style.PAGE_WIDTH, 1.75), layout="constrained")
        axes = figure.subplots()
        situation.draw(axes, -BEHIND, AHEAD, "white")
        filled = draw_value_contours(axes, along, aside, values)
        for x, y, speed, value in zip(situation.x, situation.y, situation.speed, situation.values(table), strict=True):
            label = f"{speed:.0f}, {value:.0f}" if np.isfinite(value) else f"{speed:.0f}, far"
            axes.text(x, y, label, fontsize=6, ha="center", va="center", zorder=7)
        axes.text(
            situation.robot[0],
            situation.robot[1] + 1.2,
            f"{situation.robot[3]:.0f}",
            fontsize=6,
            ha="center",
            va="bottom",
            zorder=7,
        )
        axes.set_xlabel("distance from the robot along the road (m)")
        axes.set_title(title, fontsize=8)
        figure.colorbar(filled, ax=axes, label="V (m)", extend="both", ticks=[-15, 0, 15], pad=0.01)
    return style.Drawing(figure, style.columns_of([*situation.rows(table), *_field_rows(along, aside, values)]))


def _field_rows(along: np.ndarray, aside: np.ndarray, values: np.ndarray) -> list[dict[str, object]]:
    """Return a row a place, of the values (len(aside), len(along)) there."""
    x, y = np.meshgrid(along, aside)
    places = zip(x.ravel(), y.ravel(), values.ravel(), strict=True)
    return [{"vehicle": "", "x": here, "y": there, "value": value} for here, there, value in places]
