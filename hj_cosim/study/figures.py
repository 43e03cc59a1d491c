"""The figures of a study's folder."""

from pathlib import Path

import pandas as pd

from hj_cosim.analysis.figures.attack import BEHAVIOUR, SHARE, attack
from hj_cosim.analysis.figures.of_study import scenario_densities
from hj_cosim.analysis.figures.stacks import varying_factors
from hj_cosim.analysis.figures.style import save_drawing
from hj_cosim.analysis.figures.sweep import density_sweep, sweep
from hj_cosim.analysis.figures.target_sets import TABLE, target_sets
from hj_cosim.analysis.figures.trade_off import trade_off
from hj_cosim.files import file_name
from hj_cosim.study.tables import STACK_COLUMNS


def draw_figures(study: Path, table: pd.DataFrame, figures: Path) -> None:
    """Draw the trade-off for each scenario and setting, and what density or a varied setting does.

    Args:
        study: a study's folder with its episodes.
        table: table.csv's content.
        figures: where to; made if it is not there.
    """
    figures.mkdir(exist_ok=True)
    driven = table[table["episodes"] > 0]
    if driven.empty:
        return
    factors = list(table.columns[: table.columns.get_loc(STACK_COLUMNS[0])])
    varying = varying_factors(driven)
    if not varying:
        save_drawing(trade_off(driven), figures / "trade-off.png")
        return
    for values, own in driven.groupby(varying, sort=False):
        name = "-".join(["trade-off", *(_part(key, value) for key, value in zip(varying, values, strict=True))])
        save_drawing(trade_off(own), figures / f"{name}.png")
    if {BEHAVIOUR, SHARE} <= set(factors):
        save_drawing(attack(table), figures / "attack.png")
    if set(varying) == {"scenario", TABLE}:
        save_drawing(target_sets(driven), figures / "target-sets.png")
    if varying == ["scenario"]:
        save_drawing(density_sweep(driven, scenario_densities(study)), figures / "density-sweep.png")
    elif len(set(varying) - {"scenario"}) == 1:
        save_drawing(sweep(driven), figures / "sweep.png")


def _part(key: str, value: object) -> str:
    return file_name(str(value) if key == "scenario" else f"{key}={value}")
