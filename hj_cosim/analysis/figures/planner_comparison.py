"""What OP and HJOP want in one situation, and where it leads in the next two steps (paper, section The Mechanism)."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.staged import Situation
from hj_cosim.planning.contract import Plan
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Target
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings

BEHIND, AHEAD = 30.0, 110.0  # m
STEPS = 2
PLAN_STEPS = 8  # of a plan are shown
# A gap between two cars on the left, a slower car ahead, and room on the right.
SQUEEZE = Situation.of(1, 26.0, [(9.0, 2, 20.0), (-24.0, 2, 24.0), (35.0, 1, 23.0), (54.0, 0, 25.0)])
PLANNERS = (("op", "OP", style.GREEN, "--", "s"), ("hjop", "HJOP", style.VERMILION, "-", "o"))


def planner_comparison(
    table: ValueTable, settings: PlannerSettings | None = None, situation: Situation = SQUEEZE
) -> style.Drawing:
    """Return both planners' plans now and their roll-outs over two planning steps, the others at constant speed.

    Args:
        table: V.
        settings: of the planners, whose `kind` is replaced.
        situation: at the start.
    """
    settings = settings or PlannerSettings()
    rows = []
    with style.house_style():
        figure = Figure(figsize=(style.PAGE_WIDTH, 0.72 * (STEPS + 1)), layout="constrained")
        panels = figure.subplots(STEPS + 1, len(PLANNERS), squeeze=False)
        for column, (kind, label, colour, line, marker) in enumerate(PLANNERS):
            chosen = settings.model_copy(update={"kind": kind, **({"gamma_r": 1.0} if kind == "op" else {})})
            planner = OptimisticPlanner(chosen, RobotSettings(), DriverSettings(), situation.road, table)
            now, target = (
                situation,
                Target(situation.road.lane_at(situation.robot[1], situation.robot[0]), float(situation.robot[3])),
            )
            for step in range(STEPS + 1):
                plan = planner.plan(now.observation, target)
                axes = panels[step, column]
                now.draw(axes, now.robot[0] - BEHIND, now.robot[0] + AHEAD, style.CAR)
                path = _plan_path(plan)
                _draw_plan(axes, path, colour, line, marker)
                least = float(now.values(table).min())
                axes.set_title(f"{label}, t = {step * chosen.action_time:g} s: min V = {least:.1f} m", fontsize=8)
                axes.set_xticks([])
                rows += _rows(label, step * chosen.action_time, path)
                now, target = _one_step_on(now, path, chosen.action_time), plan.target
    return style.Drawing(figure, style.columns_of(rows))


def _plan_path(plan: Plan) -> np.ndarray:
    """Return the first predicted robot states of a plan, (D + 1, 4), the present one first."""
    if plan.statistics is None:
        raise ValueError("the plan carries no predicted trajectory")
    return plan.statistics.trajectory.robot[: PLAN_STEPS + 1]


def _draw_plan(axes: Axes, path: np.ndarray, colour: str, line: str, marker: str) -> None:
    axes.plot(path[:, 0], path[:, 1], color=colour, linestyle=line, marker=marker, markersize=3.5, zorder=6)


def _one_step_on(situation: Situation, path: np.ndarray, action_time: float) -> Situation:
    """Return the situation when the robot is where its plan led and the others drove on at their speeds."""
    return replace(situation, robot=path[1].copy(), x=situation.x + action_time * situation.speed)


def _rows(label: str, time: float, path: np.ndarray) -> list[dict[str, object]]:
    return [
        {"planner": label, "time": time, "ahead": depth, "x": state[0], "y": state[1], "speed": state[3]}
        for depth, state in enumerate(path)
    ]
