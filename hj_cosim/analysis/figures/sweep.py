"""What a varied setting, or the density of the traffic, does to each stack: speed, safety and interventions over it."""

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, as_number, stacks_of, values_of, varying_factors
from hj_cosim.errors import OutputError
from hj_cosim.metrics.catalogue import METRICS

PANELS = tuple(
    (name, METRICS[name].label_with_unit)
    for name in ("mean_speed", "ttc_2d_p1", "intervention_percent", "mean_abs_acceleration")
)
SCENARIO = "scenario"
DENSITY = "density (cars/km and lane)"
GREATEST_SHIFT = 0.012  # of the axis, by which stacks are moved apart, so that no interval hides another


def density_sweep(table: pd.DataFrame, densities: Mapping[str, float], width: int = style.PAGE) -> style.Drawing:
    """Return the metrics of a study over the density of its scenarios, with their intervals.

    Where several have one density it is not what differs: then they stand side by side, the thinnest traffic first.

    Args:
        table: a study's table.csv, with a column `scenario`.
        densities: of each scenario, cars per km and lane.
        width: of the figure, mm.
    """
    beside = [name for name in varying_factors(table) if name != SCENARIO]
    density = [round(densities[name], 6) for name in table[SCENARIO]]
    rows = table.assign(density=density).sort_values("density", kind="stable")
    if rows.groupby("density")[SCENARIO].nunique().max() > 1:
        return _sweep(rows, SCENARIO, "traffic, the thinnest first", beside, width)
    return _sweep(rows, "density", DENSITY, beside, width)


def sweep(table: pd.DataFrame, width: int = style.PAGE) -> style.Drawing:
    """Return the metrics of a study over the setting that it varies, with their intervals.

    Args:
        table: a study's table.csv.
        width: of the figure, mm.

    Raises:
        OutputError: if no setting takes more than one value.
    """
    factors = varying_factors(table)
    knobs = [name for name in factors if name != SCENARIO]
    if not knobs:
        raise OutputError(
            "figure sweep needs a study that varies a setting: hj-cosim study --vary planner.gamma_r=0.8,0.9"
        )
    knob = max(knobs, key=lambda name: table[name].nunique())  # the one of most values is the axis
    order = {value: place for place, (value,) in enumerate(values_of(table, [knob]))}
    rows = table.iloc[table[knob].map(order).argsort(kind="stable")]
    return _sweep(rows, knob, knob, [name for name in factors if name != knob], width)


def _sweep(rows: pd.DataFrame, along: str, label: str, beside: Sequence[str], width: int) -> style.Drawing:
    """Return four panels over a column, whose rows are in its order."""
    names = list(dict.fromkeys(rows[along]))
    numbers = [as_number(name) for name in names]
    is_numeric = None not in numbers
    places = dict(zip(names, numbers if is_numeric else range(len(names)), strict=True))
    with style.house_style():
        columns = 2 if width == style.PAGE else 1
        figure = style.sheet(width, 110.0 if columns == 2 else 170.0, _message(rows, along, label, beside))
        panels = figure.subplots(len(PANELS) // columns, columns, sharex=True, squeeze=False)
        for axes, (metric, title) in zip(panels.flat, PANELS, strict=True):
            _draw(axes, rows.assign(place=rows[along].map(places).astype(float)), metric, beside, along != SCENARIO)
            axes.set_ylabel(title)
        for axes in panels[-1]:
            axes.set_xlabel(label)
            if not is_numeric or len(names) <= 6:
                upright = {"rotation": 90} if along == SCENARIO else {}
                axes.set_xticks(list(places.values()), [_shown(name) for name in names], **upright)
        style.legend_beside(figure, panels[0, 0], width, "95 % intervals")
    metrics = [f"{metric}{ending}" for metric, _ in PANELS for ending in ("", "_lo", "_hi")]
    scenario = [SCENARIO] if SCENARIO in rows and SCENARIO not in beside and along != SCENARIO else []
    return style.Drawing(figure, dict(rows[[*scenario, along, *beside, *STACK_COLUMNS, *metrics]].items()))


def _draw(axes: Axes, rows: pd.DataFrame, metric: str, beside: Sequence[str], is_joined: bool) -> None:
    """Draw a metric: a line a stack, or points where there is nothing between; what varies besides has a colour."""
    lines = list(stacks_of(rows, beside))
    reach = max(float(rows.place.max() - rows.place.min()), 1e-9)
    for number, (name, look, own) in enumerate(lines):
        shift = reach * GREATEST_SHIFT * (number - 0.5 * (len(lines) - 1)) / max(0.5 * (len(lines) - 1), 1.0)
        low, high = own[metric] - own[f"{metric}_lo"], own[f"{metric}_hi"] - own[metric]
        axes.errorbar(
            own.place + shift,
            own[metric],
            yerr=[low.clip(lower=0.0), high.clip(lower=0.0)],
            capsize=2,
            markersize=5,
            label=name,
            **(look if is_joined else {**look, "linestyle": "none"}),
        )


def _shown(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _message(rows: pd.DataFrame, along: str, label: str, beside: Sequence[str]) -> str:
    """Return what the speed of the first stack does between the ends of the axis."""
    name, _, own = next(iter(stacks_of(rows, beside)))
    if along == SCENARIO:
        slowest, fastest = own.loc[own.mean_speed.idxmin()], own.loc[own.mean_speed.idxmax()]
        return (
            f"{name} drives {slowest.mean_speed:.2f} m/s in {slowest[SCENARIO]}, where it is slowest, and"
            f" {fastest.mean_speed:.2f} m/s in {fastest[SCENARIO]}"
        )
    first, last = own.iloc[0], own.iloc[-1]
    return (
        f"From {_shown(first[along])} to {_shown(last[along])} of {label} the mean speed of {name} goes from"
        f" {first['mean_speed']:.2f} to {last['mean_speed']:.2f} m/s"
    )
