"""Safety over performance: the 1st percentile of TTC over the mean speed in ten-second windows of a study."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, stacks_of, varying_factors
from hj_cosim.metrics.threats import SAFE_TTC

LARGEST_TTC = 30.0  # s; longer, also infinite ones count as this long, for an ellipse needs finite points
DEVIATIONS = 3.0


def trade_off(windows: pd.DataFrame) -> style.Drawing:
    """Return the paper's trade-off figure: a mean and a three-sigma ellipse for each stack.

    Args:
        windows: a row per window, with planner, filter, scheme, mean_speed (m/s) and ttc_p1 (s); what varies besides
            (scenario, knobs) stands in columns before these.
    """
    beside = varying_factors(windows)
    points = windows.assign(ttc_p1=windows.ttc_p1.clip(upper=LARGEST_TTC))
    with style.house_style():
        figure = Figure(figsize=(style.PAGE_WIDTH, 3.6), layout="constrained")
        axes = figure.subplots()
        for label, look, rows in stacks_of(points, beside):
            pairs = rows[["mean_speed", "ttc_p1"]].to_numpy(float)
            centre = pairs.mean(axis=0)
            axes.plot(pairs[:, 0], pairs[:, 1], ".", color=look["color"], alpha=0.25, markersize=3)
            axes.plot([centre[0]], [centre[1]], markersize=7, label=label, zorder=5, **{**look, "linestyle": "none"})
            _draw_ellipse(axes, centre, pairs, str(look["color"]), str(look["linestyle"]))
        axes.axhline(SAFE_TTC, color=style.BLACK, linewidth=0.8, linestyle=":")
        axes.annotate(f"TTC = {SAFE_TTC:g} s", (0.995, SAFE_TTC), xycoords=("axes fraction", "data"), ha="right")
        axes.set(xlabel="mean speed in ten seconds (m/s)", ylabel=f"1st percentile TTC (s, at most {LARGEST_TTC:g})")
        axes.set_ylim(bottom=0.0)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="mean and 3σ ellipse")
    columns = [*beside, *STACK_COLUMNS, *(name for name in ("seed", "start") if name in points), "mean_speed", "ttc_p1"]
    return style.Drawing(figure, points[columns].reset_index(drop=True))


def _draw_ellipse(axes: Axes, centre: np.ndarray, pairs: np.ndarray, colour: str, line: str) -> None:
    if len(pairs) < 3:
        return
    variances, directions = np.linalg.eigh(np.cov(pairs.T))
    width, height = 2.0 * DEVIATIONS * np.sqrt(np.maximum(variances, 0.0))
    angle = np.degrees(np.arctan2(directions[1, 0], directions[0, 0]))
    axes.add_patch(
        Ellipse(tuple(centre), width, height, angle=angle, fill=False, edgecolor=colour, linestyle=line, linewidth=1.2)
    )
