"""A slice of a value function; of the highway game the paper's: two parallel cars, v_r = 10 m/s, v_o = 20 m/s."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.value_plot import VALUE_LIMIT, draw_value_contours
from hj_cosim.reachability.games.contract import TWO_CARS
from hj_cosim.reachability.table import slices
from hj_cosim.reachability.table.table import ValueTable

POINTS = (401, 161)
# What the state of two cars is called in a picture; another game's has the names that the game gives it.
_LABELS = dict(
    zip(
        TWO_CARS,
        (
            "robot ahead of the other car, $p_x$ (m)",
            "robot to its left, $p_y$ (m)",
            r"heading of the robot, $\theta_r$ (rad)",
            "speed of the robot, $v_r$ (m/s)",
            "speed of the other car, $v_o$ (m/s)",
        ),
        strict=True,
    )
)
_HELD = {"p_x": "$p_x$ = {:g} m", "p_y": "$p_y$ = {:g} m", "theta": r"$\theta_r$ = {:g} rad"}
_HELD |= {"v_r": "$v_r$ = {:g} m/s", "v_o": "$v_o$ = {:g} m/s"}


def value_slice(
    table: ValueTable, held: Mapping[str, float] | None = None, *, over: Sequence[str] = ()
) -> style.Drawing:
    """Return V over two state variables, the robot relative to the other car, which stands at the origin.

    Args:
        table: V, of any game.
        held: where the other state variables are held, as `table.slices.value_slice` takes them.
        over: the two; the first of the state unless given.

    Raises:
        ConfigurationError: if a state variable is unknown, or held where the table does not reach.
    """
    drawn = slices.value_slice(table, held, over=over, points=POINTS)
    finite = np.abs(drawn.values[np.isfinite(drawn.values)])
    limit = min(VALUE_LIMIT, float(finite.max(initial=0.0)) or VALUE_LIMIT)
    is_of_two_cars = table.game.state == TWO_CARS
    labels, shown = (_LABELS, _HELD) if is_of_two_cars else ({}, {})
    with style.house_style():
        figure = Figure(figsize=(style.COLUMN_WIDTH * 1.5, 2.9), layout="constrained")
        axes = figure.subplots()
        filled = draw_value_contours(axes, drawn.x, drawn.y, drawn.values, limit)
        axes.set(xlabel=labels.get(drawn.x_name, drawn.x_name), ylabel=labels.get(drawn.y_name, drawn.y_name))
        title = ", ".join(shown.get(name, name + " = {:g}").format(place) for name, place in drawn.held.items())
        axes.set_title(title or table.game.name, fontsize=8.5)
        axes.grid(False)
        unit = " (m)" if is_of_two_cars else ""
        ticks = np.linspace(-limit, limit, 7)
        figure.colorbar(
            filled,
            ax=axes,
            label=f"V{unit}, black: 0, dotted: ±{limit / 3.0:.3g}",
            extend="both",
            ticks=ticks,
            format="%.3g",
        )
    along, across = np.meshgrid(drawn.x, drawn.y)
    data = {drawn.x_name: along.ravel(), drawn.y_name: across.ravel(), "value": drawn.values.ravel()}
    return style.Drawing(figure, data)
