"""How the stacks of a study look in its figures: a colour, a marker and a line each, in the order of the tables."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd
from matplotlib.markers import MarkerStyle

from hj_cosim.analysis.figures import style

STACK_COLUMNS = ["planner", "filter", "scheme"]

# The filter gives the colour, the planner whether the marker is filled, the scheme its form.
_COLOURS = {"spc": style.GREEN, "rss": style.BLUE, "none": style.VERMILION}
_FORMS = {"mi": "o", "sw": "s"}
_FORM_WITHOUT_SCHEME = "^"


def stacks_of(table: pd.DataFrame, beside: Sequence[str] = ()) -> Iterator[tuple[str, dict[str, Any], pd.DataFrame]]:
    """Yield the label, the plot style and the rows of each stack, in the order in which they first appear.

    A label is text for matplotlib, no formula in it.

    Args:
        table: with the columns planner, filter and scheme.
        beside: further columns that tell rows of one stack apart, a scenario or a varied knob.
    """
    columns = [*beside, *STACK_COLUMNS]
    for key in table[columns].drop_duplicates().itertuples(index=False):
        *others, planner, safety_filter, scheme = (str(part) for part in key)
        parts = [planner.upper(), "None" if safety_filter == "none" else safety_filter.upper()]
        if scheme in _FORMS and safety_filter != "none":
            parts.append(scheme.upper())
        colour = _COLOURS.get(safety_filter, style.BLACK)
        look: dict[str, Any] = {
            "color": colour,
            "marker": MarkerStyle(_FORMS.get(scheme, _FORM_WITHOUT_SCHEME)),
            "markerfacecolor": colour if planner == "hjop" else "white",
            "linestyle": "-" if planner == "hjop" else "--",
        }
        label = ": ".join([*([", ".join(others)] if others else []), " + ".join(parts)])
        yield label.replace("$", r"\$"), look, table[(table[columns] == list(key)).all(axis=1)]


def varying_factors(table: pd.DataFrame) -> list[str]:
    """Return the columns before `planner` (scenario, varied knobs) that take more than one value."""
    before = table.columns[: list(table.columns).index(STACK_COLUMNS[0])]
    return [str(name) for name in before if table[name].nunique() > 1]
