"""What drivers who mean harm do to each stack: collisions, whose they are, and speed, over their share."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, stacks_of
from hj_cosim.metrics.catalogue import METRICS

BEHAVIOUR, SHARE = "scenario.rogues.behaviour", "scenario.rogues.share"
ROWS = tuple((name, METRICS[name].label_with_unit) for name in ("collisions", "collisions_responsible", "mean_speed"))
COLUMN_WIDTH, ROW_HEIGHT = 1.5, 1.5  # inches


def attack(table: pd.DataFrame) -> style.Drawing:
    """Return the metrics of a study in which behaviour and share of the rogues vary, with their intervals.

    Args:
        table: a study's table.csv, with the columns BEHAVIOUR and SHARE.
    """
    behaviours = list(dict.fromkeys(table[BEHAVIOUR]))
    with style.house_style():
        size = (max(style.PAGE_WIDTH, COLUMN_WIDTH * len(behaviours) + 1.5), ROW_HEIGHT * len(ROWS) + 0.6)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(ROWS), len(behaviours), sharex=True, sharey="row", squeeze=False)
        for column, behaviour in enumerate(behaviours):
            rows = table[table[BEHAVIOUR] == behaviour].sort_values(SHARE, kind="stable")
            for row, (metric, _) in enumerate(ROWS):
                _draw(panels[row, column], rows, metric)
            panels[0, column].set_title(str(behaviour))
            panels[-1, column].set_xlabel("share (%)")
        for row, (_, label) in enumerate(ROWS):
            panels[row, 0].set_ylabel(label.replace(" ", "\n", 1))
        handles, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside right center", title="95 % intervals")
    metrics = [f"{metric}{ending}" for metric, _ in ROWS for ending in ("", "_lo", "_hi")]
    data = table[[BEHAVIOUR, SHARE, *STACK_COLUMNS, "episodes", *metrics]]
    return style.Drawing(figure, dict(data.items()))


def _draw(axes: Axes, rows: pd.DataFrame, metric: str) -> None:
    for name, look, own in stacks_of(rows):
        low, high = own[metric] - own[f"{metric}_lo"], own[f"{metric}_hi"] - own[metric]
        axes.errorbar(
            100.0 * own[SHARE],
            own[metric],
            yerr=[low.clip(lower=0.0), high.clip(lower=0.0)],
            capsize=2,
            markersize=4,
            label=name,
            **look,
        )
