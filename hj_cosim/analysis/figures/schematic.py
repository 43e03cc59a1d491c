"""The paper's idea in one picture: the robot among cars, on the value function that planner and filter share."""

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.staged import Situation
from hj_cosim.analysis.figures.value_plot import draw_value_contours
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.vehicles.car import CAR_LENGTH

BEHIND = 40.0  # m
AHEAD = {style.COLUMN: 60.0, style.PAGE: 80.0}  # m, by the figure's width
ROOM = 27.0  # m of road that a label takes
FAR = 100.0  # m, larger V are not told apart
WEAVING = Situation.of(1, 25.0, [(28.0, 1, 19.0), (-18.0, 2, 25.0), (53.0, 3, 22.0), (12.0, 0, 22.0)])
BOXED_IN = Situation.of(1, 23.0, [(14.0, 1, 20.0), (-14.0, 1, 25.0), (3.0, 2, 23.0), (-2.0, 0, 23.0)])


def schematic(table: ValueTable, width: int = style.PAGE) -> style.Drawing:
    """Return the robot and four cars, over the least V that the robot would have at each place.

    Args:
        table: V.
        width: of the figure, mm.
    """
    message = (
        f"Where the road is blue (V > 0) the robot, at {WEAVING.robot[3]:g} m/s, can keep its distance from each of"
        " these cars; in the red it cannot"
    )
    return _situation_on_values(WEAVING, table, message, width)


def boxed_in(table: ValueTable, width: int = style.PAGE) -> style.Drawing:
    """Return the robot boxed in by four cars: no place nearby is safe, if all cars behave adversarially.

    Args:
        table: V.
        width: of the figure, mm.
    """
    message = (
        f"Boxed in at {BOXED_IN.robot[3]:g} m/s: V < 0 (red) where the robot is, before it, behind it and on both sides"
    )
    return _situation_on_values(BOXED_IN, table, message, width)


def _situation_on_values(situation: Situation, table: ValueTable, message: str, width: int) -> style.Drawing:
    road, ahead = situation.road, AHEAD[width]
    along = np.linspace(-BEHIND, ahead, round(3 * (BEHIND + ahead)) + 1)
    lines = road.lane_lines(0.0)
    aside = np.linspace(lines[0], lines[-1], 121)
    values = situation.field(table, along, aside)
    with style.house_style():
        road_height = 0.85 * width * np.ptp(lines) / (BEHIND + ahead)
        figure = style.sheet(width, road_height + 14.0, message, to_scale=True)
        axes = figure.subplots()
        situation.draw(axes, -BEHIND, ahead, "white")
        filled = draw_value_contours(axes, along, aside, values)
        for x, y, speed, value in zip(situation.x, situation.y, situation.speed, situation.values(table), strict=True):
            room = f"V = {value:.0f}" if value < FAR else f"V > {FAR:.0f}"
            _label(axes, x, y, room if width == style.COLUMN else f"{speed:.0f} m/s, {room}", ahead)
        axes.set_xlabel("distance from the robot along the road (m)")
        figure.colorbar(filled, ax=axes, label="V (m)", extend="both", ticks=[-15, 0, 15], pad=0.01)
    return style.Drawing(figure, style.columns_of([*situation.rows(table), *_field_rows(along, aside, values)]))


def _field_rows(along: np.ndarray, aside: np.ndarray, values: np.ndarray) -> list[dict[str, object]]:
    """Return a row a place, of the values (len(aside), len(along)) there."""
    x, y = np.meshgrid(along, aside)
    places = zip(x.ravel(), y.ravel(), values.ravel(), strict=True)
    return [{"vehicle": "", "x": here, "y": there, "value": value} for here, there, value in places]


def _label(axes: Axes, x: float, y: float, text: str, ahead: float) -> None:
    """Write beside a car, in its own lane and away from the robot, so that no car is hidden."""
    behind = x < 0.0 or x + ROOM > ahead
    side = -1.0 if behind else 1.0
    axes.text(
        x + side * (0.5 * CAR_LENGTH + 1.0),
        y,
        style.signed(text),
        fontsize=style.SMALLEST_FONT,
        ha="right" if behind else "left",
        va="center_baseline",
        zorder=7,
        path_effects=[effects.withStroke(linewidth=2.0, foreground="white")],
    )
