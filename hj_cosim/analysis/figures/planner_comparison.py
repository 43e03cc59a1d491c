"""What OP and HJOP want in one situation, and where it leads in the next two steps (paper, section The Mechanism)."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.road_view import body_corners
from hj_cosim.analysis.figures.staged import Situation
from hj_cosim.planning.contract import PredictedTrajectory
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Target
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.car import CAR_LENGTH, CAR_WIDTH

BEHIND, AHEAD = 30.0, 90.0  # m
STEPS = 2
SHOWN = 2  # actions ahead: where everybody is then is drawn in outline
# A gap between two cars on the left, a slower car ahead, and room on the right.
SQUEEZE = Situation.of(1, 26.0, [(9.0, 2, 20.0), (-24.0, 2, 24.0), (35.0, 1, 23.0), (54.0, 0, 25.0)])
PLANNERS = (("op", "OP"), ("hjop", "HJOP"))


def planner_comparison(
    table: ValueTable,
    settings: PlannerSettings | None = None,
    situation: Situation = SQUEEZE,
    width: int = style.PAGE,
) -> style.Drawing:
    """Return both planners' plans now and their roll-outs over two planning steps, the others at constant speed.

    Beside the plan each panel has everybody in outline where the planner expects them SHOWN actions ahead: the robot
    passes where a car is now, not where it will be.

    Args:
        table: V.
        settings: of the planners, whose `kind` is replaced.
        situation: at the start.
        width: of the figure, mm; in one column the planners stand one below the other.
    """
    settings = settings or PlannerSettings()
    rows, least = [], {}
    drawn = []
    for kind, label in PLANNERS:
        chosen = settings.model_copy(update={"kind": kind, **({"gamma_r": 1.0} if kind == "op" else {})})
        planner = OptimisticPlanner(chosen, RobotSettings(), DriverSettings(), situation.road, table)
        lane = situation.road.lane_at(situation.robot[1], situation.robot[0])
        now, target = situation, Target(lane, float(situation.robot[3]))
        values = []
        for step in range(STEPS + 1):
            plan = planner.plan(now.observation, target)
            if plan.statistics is None:
                raise ValueError("the plan carries no predicted trajectory")
            expected, time = plan.statistics.trajectory, step * chosen.action_time
            values.append(float(now.values(table).min()))
            drawn.append((now, expected, f"{label}, t = {time:g} s: least V = {values[-1]:.1f} m"))
            rows += _rows(label, time, expected)
            now, target = _one_step_on(now, expected.robot[1], chosen.action_time), plan.target
        least[label] = min(values)
    with style.house_style():
        columns = len(PLANNERS) if width == style.PAGE else 1
        road = 0.98 * width / columns * 17.6 / (BEHIND + AHEAD)
        ahead = SHOWN * settings.action_time
        message = (
            f"OP goes where V is {least['OP']:.1f} m, HJOP never below {least['HJOP']:.1f} m; in outline, where the"
            f" planner expects everybody {ahead:g} s later"
        )
        figure = style.sheet(width, (road + 5.0) * len(drawn) / columns + 4.0, message, to_scale=True)
        panels = figure.subplots(len(drawn) // columns, columns, squeeze=False)
        for axes, (now, expected, title) in zip(panels.T.flat, drawn, strict=True):
            _draw(axes, now, expected, title)
    return style.Drawing(figure, style.columns_of(rows))


def _draw(axes: Axes, now: Situation, expected: PredictedTrajectory, title: str) -> None:
    """Draw everybody now, filled, the way from there, and everybody later, in outline."""
    later = min(SHOWN, len(expected.time) - 1)
    now.draw(axes, now.robot[0] - BEHIND, now.robot[0] + AHEAD, style.CAR)
    axes.plot(expected.x[: later + 1], expected.y[: later + 1], color=style.CAR_EDGE, linewidth=0.8, zorder=2)
    axes.plot(*expected.robot[: later + 1, :2].T, color=style.ROBOT, linewidth=1.6, zorder=2.5)
    x, y = (
        np.append(expected.x[later], expected.robot[later, 0]),
        np.append(expected.y[later], expected.robot[later, 1]),
    )
    heading = np.append(np.zeros(len(x) - 1), expected.robot[later, 2])
    corners = body_corners(x, y, heading, np.full(len(x), CAR_LENGTH), np.full(len(x), CAR_WIDTH))
    for number, body in enumerate(corners):
        is_robot = number == len(corners) - 1
        axes.fill(
            *body.T,
            facecolor=style.ASPHALT,
            edgecolor=style.ROBOT if is_robot else style.CAR_EDGE,
            linewidth=1.4 if is_robot else 0.9,
            zorder=2.8,
        )
    axes.set_title(style.signed(title), pad=2)
    axes.set_xticks([])


def _one_step_on(situation: Situation, robot: np.ndarray, action_time: float) -> Situation:
    """Return the situation when the robot is where its plan led and the others drove on at their speeds."""
    return replace(situation, robot=robot.copy(), x=situation.x + action_time * situation.speed)


def _rows(label: str, time: float, expected: PredictedTrajectory) -> list[dict[str, object]]:
    """Return the robot and the cars of a plan, now and up to SHOWN actions ahead."""
    rows: list[dict[str, object]] = []
    for depth in range(min(SHOWN, len(expected.time) - 1) + 1):
        when = {"planner": label, "time": time, "ahead": depth}
        robot = expected.robot[depth]
        rows.append({**when, "vehicle": "robot", "x": robot[0], "y": robot[1], "speed": robot[3]})
        cars = zip(expected.vehicle, expected.x[depth], expected.y[depth], expected.speed[depth], strict=True)
        rows += [{**when, "vehicle": f"car {car + 1}", "x": x, "y": y, "speed": speed} for car, x, y, speed in cars]
    return rows
