"""Safety over performance: the 1st percentile of 2D TTC over the mean speed of each stack, with their intervals.

The paper draws the TTC of the car ahead. That is capped by what does not overlap sideways: where cars cut in it says
nothing before they touch, and in nine of ten rows it is as good as infinite. 2D TTC sees bodies that come together
from any side.
"""

from collections.abc import Sequence

import pandas as pd

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, stacks_of, varying_factors
from hj_cosim.metrics.catalogue import METRICS

SPEED, SAFETY = "mean_speed", "ttc_2d_p1"
METRICS_SHOWN = (SPEED, SAFETY)


def trade_off(table: pd.DataFrame, width: int = style.PAGE) -> style.Drawing:
    """Return the trade-off figure: a cross for each stack, its means and their 95 % intervals over episodes.

    Args:
        table: rows of a study's table.csv, with planner, filter, scheme, and each of METRICS_SHOWN with its `_lo` and
            `_hi`; what varies besides (scenario, knobs) stands in columns before these.
        width: of the figure, mm.
    """
    beside = varying_factors(table)
    with style.house_style():
        figure = style.sheet(width, 90.0 if width == style.PAGE else 110.0, _message(table, beside))
        axes = figure.subplots()
        for label, look, rows in stacks_of(table, beside):
            axes.errorbar(
                rows[SPEED],
                rows[SAFETY],
                xerr=reach(rows, SPEED),
                yerr=reach(rows, SAFETY),
                capsize=2,
                markersize=6,
                elinewidth=1.0,
                label=label,
                **{**look, "linestyle": "none"},
            )
        axes.set(xlabel=METRICS[SPEED].label_with_unit, ylabel=METRICS[SAFETY].label_with_unit)
        axes.set_ylim(bottom=-0.03 * axes.get_ylim()[1])  # a marker at 0, where bodies touched, is seen whole
        style.legend_beside(figure, axes, width, "mean, 95 % interval")
    shown = [f"{metric}{ending}" for metric in METRICS_SHOWN for ending in ("", "_lo", "_hi")]
    return style.Drawing(figure, dict(table[[*beside, *STACK_COLUMNS, *shown]].items()))


def _message(table: pd.DataFrame, beside: Sequence[str]) -> str:
    """Return who is fastest and who is safest."""
    stacks = {
        label: rows.iloc[0]
        for label, _, rows in stacks_of(table, beside)
        if rows[list(METRICS_SHOWN)].notna().all(axis=None)
    }
    if not stacks:
        return "No stack has a speed and a 2D TTC"
    fastest = max(stacks, key=lambda label: stacks[label][SPEED])
    safest = max(stacks, key=lambda label: stacks[label][SAFETY])
    both = {name: f"{stacks[name][SPEED]:.1f} m/s and {stacks[name][SAFETY]:.1f} s" for name in (fastest, safest)}
    if fastest == safest:
        return f"{fastest} is fastest and safest, at {both[fastest]} (up is safer, right is faster)"
    return (
        f"{fastest} is fastest, at {both[fastest]}, {safest} safest, at {both[safest]} (up is safer, right is faster)"
    )


def reach(rows: pd.DataFrame, metric: str) -> list[pd.Series]:
    """Return how far the interval reaches below and above the mean, neither negative."""
    low, high = rows[metric] - rows[f"{metric}_lo"], rows[f"{metric}_hi"] - rows[metric]
    return [low.clip(lower=0.0), high.clip(lower=0.0)]
