"""A slice of a value function; of the highway game the paper's: two parallel cars, v_r = 10 m/s, v_o = 20 m/s."""

from collections.abc import Mapping, Sequence

import numpy as np

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
NEIGHBOURHOOD = 0.08  # of the coloured part's size, shown around it


def value_slice(
    table: ValueTable, held: Mapping[str, float] | None = None, *, over: Sequence[str] = (), width: int = style.COLUMN
) -> style.Drawing:
    """Return V over two state variables, the robot relative to the other car, which stands at the origin.

    The picture is cut to where |V| is below its colour scale's end, and a little around it; the data are all.

    Args:
        table: V, of any game.
        held: where the other state variables are held, as `table.slices.value_slice` takes them.
        over: the two; the first of the state unless given.
        width: of the figure, mm.

    Raises:
        ConfigurationError: if a state variable is unknown, or held where the table does not reach.
    """
    drawn = slices.value_slice(table, held, over=over, points=POINTS)
    finite = np.abs(drawn.values[np.isfinite(drawn.values)])
    limit = min(VALUE_LIMIT, float(finite.max(initial=0.0)) or VALUE_LIMIT)
    is_of_two_cars = table.game.state == TWO_CARS
    labels = _LABELS if is_of_two_cars else {}
    unit = " (m)" if is_of_two_cars else ""
    with style.house_style():
        figure = style.sheet(width, 62.0 if width == style.COLUMN else 75.0, _message(drawn, table))
        axes = figure.subplots()
        filled = draw_value_contours(axes, drawn.x, drawn.y, drawn.values, limit)
        shown = np.abs(drawn.values) < limit
        axes.set(xlim=_around(drawn.x, shown.any(axis=0)), ylim=_around(drawn.y, shown.any(axis=1)))
        axes.set(xlabel=labels.get(drawn.x_name, drawn.x_name), ylabel=labels.get(drawn.y_name, drawn.y_name))
        axes.grid(False)
        figure.colorbar(
            filled,
            ax=axes,
            label=f"V{unit}, line: 0, dotted: ±{limit / 3.0:.3g}",
            extend="both",
            ticks=np.linspace(-limit, limit, 7),
            format=lambda value, _: style.signed(f"{value:.3g}"),
        )
    along, across = np.meshgrid(drawn.x, drawn.y)
    data = {drawn.x_name: along.ravel(), drawn.y_name: across.ravel(), "value": drawn.values.ravel()}
    return style.Drawing(figure, data)


def _around(axis: np.ndarray, inside: np.ndarray) -> tuple[float, float]:
    """Return the limits of an axis (N,) around where it is inside, with some neighbourhood, within the axis."""
    places = axis[inside]
    if len(places) < 2:
        return float(axis[0]), float(axis[-1])
    room = NEIGHBOURHOOD * float(places[-1] - places[0])
    return max(float(places[0]) - room, float(axis[0])), min(float(places[-1]) + room, float(axis[-1]))


def _message(drawn: slices.ValueSlice, table: ValueTable) -> str:
    """Return how far the unsafe set reaches in the slice, as a sentence."""
    shown = _HELD if table.game.state == TWO_CARS else {}
    held = ", ".join(shown.get(name, name + " = {:g}").format(place) for name, place in drawn.held.items())
    where = f" at {held}" if held else ""
    unsafe = drawn.values < 0.0
    if not unsafe.any():
        return f"{table.game.name}: V < 0 nowhere{where}"
    x, y = drawn.x[unsafe.any(axis=0)], drawn.y[unsafe.any(axis=1)]
    names, unit = ("$p_x$", "$p_y$"), " m"
    if table.game.state != TWO_CARS or (drawn.x_name, drawn.y_name) != TWO_CARS[:2]:
        names, unit = (drawn.x_name, drawn.y_name), ""
    return (
        f"Unsafe (V < 0) from {names[0]} = {x[0]:.3g} to {x[-1]:.3g}{unit} and {names[1]} = {y[0]:.2g} to"
        f" {y[-1]:.2g}{unit}{where}"
    )
