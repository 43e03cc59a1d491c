"""Safety over performance by what counts as unsafe: a panel a scenario, a cross for each value table."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS
from hj_cosim.analysis.figures.trade_off import METRICS_SHOWN, SAFETY, SPEED, reach
from hj_cosim.metrics.catalogue import METRICS

TABLE = "table"
_COLOURS = (style.GREEN, style.BLUE, style.VERMILION, style.ORANGE, style.PURPLE, style.SKY_BLUE, style.BLACK)
_MARKERS = "osD^vP*"
COLUMN_WIDTH, HEIGHT = 1.8, 2.8  # inches


def target_sets(table: pd.DataFrame) -> style.Drawing:
    """Return speed and 2D TTC of a study in which the value table varies, with their 95 % intervals over episodes.

    Args:
        table: rows of a study's table.csv, with the columns `scenario`, TABLE, and METRICS_SHOWN with `_lo` and `_hi`.
    """
    scenarios, names = (list(dict.fromkeys(table[column])) for column in ("scenario", TABLE))
    stacks = table[STACK_COLUMNS].drop_duplicates()
    with style.house_style():
        size = (max(style.PAGE_WIDTH, COLUMN_WIDTH * len(scenarios) + 1.5), HEIGHT)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(1, len(scenarios), sharey=True, squeeze=False)[0]
        for axes, scenario in zip(panels, scenarios, strict=True):
            for number, name in enumerate(names):
                _draw(axes, table[(table["scenario"] == scenario) & (table[TABLE] == name)], str(name), number)
            axes.set_title(str(scenario))
            axes.margins(x=0.15)
        panels[0].set_ylabel(METRICS[SAFETY].label_with_unit)
        panels[0].set_ylim(bottom=-0.03 * panels[0].get_ylim()[1])
        figure.supxlabel(METRICS[SPEED].label_with_unit, fontsize=9)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", title="95 % intervals")
    shown = [f"{metric}{ending}" for metric in METRICS_SHOWN for ending in ("", "_lo", "_hi")]
    told = STACK_COLUMNS if len(stacks) > 1 else []
    return style.Drawing(figure, dict(table[["scenario", TABLE, *told, *shown]].items()))


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
