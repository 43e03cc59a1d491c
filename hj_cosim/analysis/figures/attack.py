"""What drivers who mean harm do to each stack: collisions, whose they are, and speed, over their share."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, stacks_of, varying_factors
from hj_cosim.analysis.figures.sweep import SCENARIO
from hj_cosim.metrics.catalogue import METRICS

BEHAVIOUR, SHARE = "scenario.rogues.behaviour", "scenario.rogues.share"
COUNTS = ("collisions", "collisions_responsible")  # over all drives of a row; drawn as of one
ROWS = (
    ("collisions", "collisions a drive"),
    ("collisions_responsible", "the robot's own, a drive"),
    ("mean_speed", METRICS["mean_speed"].label_with_unit),
)
ROW_HEIGHT = 37.0  # mm


def attack(table: pd.DataFrame, width: int = style.PAGE) -> style.Drawing:
    """Return the metrics of a study in which behaviour and share of the rogues vary, with their intervals.

    Collisions are those of one drive, in the picture and in its data. Where something varies besides, a scenario or a
    knob, a stack has a line for each of its values.

    Args:
        table: a study's table.csv, with the columns BEHAVIOUR and SHARE.
        width: of the figure, mm.
    """
    metrics = [f"{metric}{ending}" for metric, _ in ROWS for ending in ("", "_lo", "_hi")]
    beside = [name for name in varying_factors(table) if name not in (BEHAVIOUR, SHARE)]
    table = table[[BEHAVIOUR, SHARE, *beside, *STACK_COLUMNS, "episodes", *metrics]].copy()
    for count in COUNTS:
        for ending in ("", "_lo", "_hi"):
            table[f"{count}{ending}"] /= table["episodes"]
    behaviours = list(dict.fromkeys(table[BEHAVIOUR]))
    with style.house_style():
        figure = style.sheet(width, ROW_HEIGHT * len(ROWS) + 15.0, _message(table, beside))
        panels = figure.subplots(len(ROWS), len(behaviours), sharex=True, sharey="row", squeeze=False)
        for column, behaviour in enumerate(behaviours):
            rows = table[table[BEHAVIOUR] == behaviour].sort_values(SHARE, kind="stable")
            for row, (metric, _) in enumerate(ROWS):
                _draw(panels[row, column], rows, metric, beside)
            panels[0, column].set_title(str(behaviour))
            panels[-1, column].set_xlabel("share (%)")
        for row, (_, label) in enumerate(ROWS):
            panels[row, 0].set_ylabel(label.replace(" ", "\n", 1))
        style.legend_beside(figure, panels[0, 0], width, "95 % intervals")
    return style.Drawing(figure, dict(table.items()))


def _message(table: pd.DataFrame, beside: Sequence[str]) -> str:
    """Return who collides most and least where most drivers mean harm: the mean over their behaviours.

    What varies besides is not averaged over: stacks are compared where they collide most.
    """
    metric = ROWS[0][0]
    driven = table[table[metric].notna()]
    if driven.empty:
        return "Nobody has driven among drivers who mean harm"
    most = driven[SHARE].max()
    rows = driven[driven[SHARE] == most]
    among = f"Among {100.0 * most:.3g} % of drivers who mean harm"
    if beside and rows[metric].any():
        groups = rows.groupby(list(beside), sort=False, dropna=False)
        values, rows = max(groups, key=lambda group: float(group[1][metric].mean()))
        among = f"{among}, where collisions are most ({_named(beside, values)}),"
    means = {name: float(own[metric].mean()) for name, _, own in stacks_of(rows)}
    worst, best = max(means, key=lambda name: means[name]), min(means, key=lambda name: means[name])
    if worst == best:
        return f"{among} {worst} has {means[worst]:.2g} collisions a drive"
    return f"{among} {best} has {means[best]:.2g} collisions a drive, {worst} {means[worst]:.2g}"


def _named(factors: Sequence[str], values: Sequence[object]) -> str:
    """Return a combination of values as text for matplotlib, a knob's with its name."""
    pairs = zip(factors, values, strict=True)
    parts = [str(value) if name == SCENARIO else f"{name} = {value}" for name, value in pairs]
    return ", ".join(parts).replace("$", r"\$")


def _draw(axes: Axes, rows: pd.DataFrame, metric: str, beside: Sequence[str]) -> None:
    for name, look, own in stacks_of(rows, beside):
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
