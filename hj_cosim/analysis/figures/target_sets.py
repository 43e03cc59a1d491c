"""Safety over performance by what counts as unsafe: a panel a scenario, a cross for each value table."""

import pandas as pd
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS
from hj_cosim.analysis.figures.trade_off import METRICS_SHOWN, SAFETY, SPEED, reach
from hj_cosim.metrics.catalogue import METRICS

TABLE = "table"
_COLOURS = (style.GREEN, style.BLUE, style.VERMILION, style.ORANGE, style.PURPLE, style.SKY_BLUE, style.BLACK)
_MARKERS = "osD^vP*"
ABREAST = {style.COLUMN: 2, style.PAGE: 3}  # panels, by the figure's width
HEIGHT = 55.0  # mm, of a row of panels


def target_sets(table: pd.DataFrame, width: int = style.PAGE) -> style.Drawing:
    """Return speed and 2D TTC of a study in which the value table varies, with their 95 % intervals over episodes.

    Args:
        table: rows of a study's table.csv, with the columns `scenario`, TABLE, and METRICS_SHOWN with `_lo` and `_hi`.
        width: of the figure, mm.
    """
    scenarios, names = (list(dict.fromkeys(table[column])) for column in ("scenario", TABLE))
    stacks = table[STACK_COLUMNS].drop_duplicates()
    with style.house_style():
        columns = min(len(scenarios), ABREAST[width])
        rows = -(-len(scenarios) // columns)
        figure = style.sheet(width, HEIGHT * rows + 12.0, _message(table))
        panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for axes in panels.flat[max(len(scenarios) - columns, 0) : len(scenarios)]:
            axes.set_xlabel(METRICS[SPEED].label_with_unit)
        for axes in panels.flat[len(scenarios) :]:
            axes.remove()
        for axes, scenario in zip(panels.flat, scenarios, strict=False):
            for number, name in enumerate(names):
                _draw(axes, table[(table["scenario"] == scenario) & (table[TABLE] == name)], str(name), number)
            axes.set_title(str(scenario).replace("$", r"\$"))
            axes.margins(x=0.15)
        for axes in panels[:, 0]:
            axes.set_ylabel(METRICS[SAFETY].label_with_unit)
        panels[0, 0].set_ylim(bottom=-0.03 * panels[0, 0].get_ylim()[1])
        style.legend_beside(figure, panels[0, 0], width, "95 % intervals")
    shown = [f"{metric}{ending}" for metric in METRICS_SHOWN for ending in ("", "_lo", "_hi")]
    told = STACK_COLUMNS if len(stacks) > 1 else []
    return style.Drawing(figure, dict(table[["scenario", TABLE, *told, *shown]].items()))


def _message(table: pd.DataFrame) -> str:
    """Return which table is safest, or as safe as another, most often."""
    known = table.dropna(subset=[SAFETY])
    if known.empty:
        return "No stack has a 2D TTC"
    safest = known.loc[known.groupby("scenario", sort=False)[SAFETY].idxmax()]
    name = safest[TABLE].mode(dropna=False).iloc[0]
    own, count = int((safest[TABLE] == name).sum()), len(safest)
    where = str(safest["scenario"].iloc[0]) if count == 1 else f"{own} of {count} traffics"
    return f"In {where} no table is safer than {name} (up is safer, right is faster)".replace("$", r"\$")


def _draw(axes: Axes, rows: pd.DataFrame, name: str, number: int) -> None:
    axes.errorbar(
        rows[SPEED],
        rows[SAFETY],
        xerr=reach(rows, SPEED),
        yerr=reach(rows, SAFETY),
        color=_COLOURS[number % len(_COLOURS)],
        marker=_MARKERS[number % len(_MARKERS)],
        linestyle="none",
        capsize=2,
        markersize=5,
        elinewidth=1.0,
        label=name.replace("$", r"\$"),
    )
