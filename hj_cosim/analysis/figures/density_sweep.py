"""What denser traffic does to each stack: speed, safety and interventions over the density."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, stacks_of, varying_factors
from hj_cosim.metrics.catalogue import METRICS

PANELS = tuple(
    (name, METRICS[name].label_with_unit)
    for name in ("mean_speed", "ttc_ge_3", "intervention_percent", "mean_abs_acceleration")
)


def density_sweep(table: pd.DataFrame, densities: Mapping[str, float]) -> style.Drawing:
    """Return the metrics of a study over several scenarios, with their intervals.

    Args:
        table: a study's table.csv, with a column `scenario`.
        densities: of each scenario, cars per km and lane.
    """
    beside = [name for name in varying_factors(table) if name != "scenario"]
    rows = table.assign(density=[densities[name] for name in table.scenario]).sort_values("density", kind="stable")
    with style.house_style():
        figure = Figure(figsize=(style.PAGE_WIDTH, 4.6), layout="constrained")
        panels = figure.subplots(2, 2, sharex=True)
        for axes, (metric, label) in zip(panels.flat, PANELS, strict=True):
            for name, look, own in stacks_of(rows, beside):
                low, high = own[metric] - own[f"{metric}_lo"], own[f"{metric}_hi"] - own[metric]
                axes.errorbar(
                    own.density,
                    own[metric],
                    yerr=[low.clip(lower=0.0), high.clip(lower=0.0)],
                    capsize=2,
                    markersize=5,
                    label=name,
                    **look,
                )
            axes.set_ylabel(label)
        for axes in panels[1]:
            axes.set_xlabel("density (cars/km and lane)")
        handles, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside right center", title="95 % intervals")
    metrics = [f"{metric}{ending}" for metric, _ in PANELS for ending in ("", "_lo", "_hi")]
    return style.Drawing(figure, dict(rows[["scenario", "density", *beside, *STACK_COLUMNS, *metrics]].items()))
