"""How the stacks of a study look in its figures: a colour, a marker and a line each, in the order of the tables."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.markers import MarkerStyle

from hj_cosim.analysis.figures import style

STACK_COLUMNS = ["planner", "filter", "scheme"]

# The filter gives the colour, the planner the line and whether the marker is filled, the scheme the marker's form.
FILTER_COLOURS = {"spc": style.BLUE, "rss": style.ORANGE, "none": style.BLACK}
OTHER_FILTER = style.GREEN
PLANNER_LINES = {"hjop": "-", "op": "--", "mppi": ":"}
OTHER_PLANNER = "-."
_FORMS = {"mi": "o", "sw": "s"}
_FORM_WITHOUT_SCHEME = "^"
_FORMS_BESIDE = {("rss", "o"): "P", ("rss", "s"): "X"}  # where colours stand for something else
LIGHTEST = 0.85  # of cividis, whose end is too pale for lines


def stacks_of(table: pd.DataFrame, beside: Sequence[str] = ()) -> Iterator[tuple[str, dict[str, Any], pd.DataFrame]]:
    """Yield the label, the plot style and the rows of each stack, in the order in which they first appear.

    A label is text for matplotlib, no formula in it. Where something varies besides, each of its values has a colour,
    from dark to light, and the filters are told apart by their markers alone.

    Args:
        table: with the columns planner, filter and scheme.
        beside: further columns that tell rows of one stack apart, a scenario or a varied knob.
    """
    columns = [*beside, *STACK_COLUMNS]
    combinations = values_of(table, beside) if beside else []
    shades = {_joined(each): shade for each, shade in zip(combinations, shades_of(len(combinations)), strict=True)}
    for key in table[columns].drop_duplicates().itertuples(index=False):
        *others, planner, safety_filter, scheme = (str(part) for part in key)
        parts = [planner.upper(), "None" if safety_filter == "none" else safety_filter.upper()]
        if scheme in _FORMS and safety_filter != "none":
            parts.append(scheme.upper())
        colour = shades[", ".join(others)] if others else FILTER_COLOURS.get(safety_filter, OTHER_FILTER)
        look: dict[str, Any] = {
            "color": colour,
            "marker": MarkerStyle(_form(safety_filter, scheme, has_colour=not others)),
            "markerfacecolor": colour if planner == "hjop" else "white",
            "linestyle": PLANNER_LINES.get(planner, OTHER_PLANNER),
        }
        label = ": ".join([*([", ".join(others)] if others else []), " + ".join(parts)])
        yield label.replace("$", r"\$"), look, table[(table[columns] == list(key)).all(axis=1)]


def shades_of(count: int) -> list[str]:
    """Return as many colours as there are values, from dark to light, which colour-blind readers tell apart."""
    return [to_hex(shade) for shade in colormaps["cividis"](np.linspace(0.0, LIGHTEST, count))]


def _joined(values: Sequence[object]) -> str:
    return ", ".join(map(str, values))


def _form(safety_filter: str, scheme: str, *, has_colour: bool) -> str:
    form = _FORMS.get(scheme, _FORM_WITHOUT_SCHEME)
    return form if has_colour or safety_filter == "spc" else _FORMS_BESIDE.get((safety_filter, form), form)


def values_of(table: pd.DataFrame, factors: Sequence[str]) -> list[tuple[object, ...]]:
    """Return the combinations of values that some columns take: numbers by size, others as they first appear."""
    combinations = list(table[list(factors)].drop_duplicates().itertuples(index=False, name=None))
    return sorted(combinations, key=lambda each: tuple(as_number(value) or 0.0 for value in each))


def as_number(value: object) -> float | None:
    """Return a setting's value as a number; None if it is another text."""
    try:
        return float(str(value))
    except ValueError:
        return None


def varying_factors(table: pd.DataFrame) -> list[str]:
    """Return the columns before `planner` (scenario, varied knobs) that take more than one value."""
    before = table.columns[: list(table.columns).index(STACK_COLUMNS[0])]
    return [str(name) for name in before if table[name].nunique() > 1]
