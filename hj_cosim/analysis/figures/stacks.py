"""How the stacks of a study look in its figures: a colour, a marker and a line each, in the order of the tables."""

from collections.abc import Iterator
from typing import Any

import pandas as pd
from matplotlib.markers import MarkerStyle

from hj_cosim.analysis.figures import style

STACK_COLUMNS = ["planner", "filter", "scheme"]

# The filter gives the colour, the planner whether the marker is filled, the scheme its form.
_COLOURS = {"spc": style.GREEN, "rss": style.BLUE, "none": style.VERMILION}
_FORMS = {"mi": "o", "sw": "s"}
_FORM_WITHOUT_SCHEME = "^"


def stacks_of(table: pd.DataFrame) -> Iterator[tuple[str, dict[str, Any], pd.DataFrame]]:
    """Yield the label, the plot style and the rows of each stack, in the order in which they first appear."""
    for stack in table[STACK_COLUMNS].drop_duplicates().itertuples(index=False):
        planner, safety_filter, scheme = (str(part) for part in stack)
        parts = [planner.upper(), "None" if safety_filter == "none" else safety_filter.upper()]
        if scheme in _FORMS:
            parts.append(scheme.upper())
        colour = _COLOURS.get(safety_filter, style.BLACK)
        look: dict[str, Any] = {
            "color": colour,
            "marker": MarkerStyle(_FORMS.get(scheme, _FORM_WITHOUT_SCHEME)),
            "markerfacecolor": colour if planner == "hjop" else "white",
            "linestyle": "-" if planner == "hjop" else "--",
        }
        same = (table[STACK_COLUMNS] == list(stack)).all(axis=1)
        yield " + ".join(parts), look, table[same]
