"""The safe controls of SPC and RSS at one moment of a run, and what MI and SW choose among them."""

import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.guard import GuardedFilter
from hj_cosim.control.problem.nearest_control import RowsDecision
from hj_cosim.errors import OutputError
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings

FILTERS = (("spc", "SPC"), ("rss", "RSS"))
SCHEMES = (("mi", "MI", style.BLUE, "o", 6), ("sw", "SW", style.BLACK, "s", 10))
MEMORY = 1.0  # s of the run before the moment that the filters see, for RSS remembers


def control_sets(run: Run, table: ValueTable, time: float | None = None, width: int = style.PAGE) -> style.Drawing:
    """Return the half-planes and the chosen controls of SPC and RSS, MI and SW.

    Args:
        run: whose cars and desired controls are used.
        table: V.
        time: of the moment, s; unless given, the one with most constraints that can be met, of those the one of the
            least value.
        width: of the figure, mm.
    """
    sample = _busiest_sample(run) if time is None else int(np.argmin(np.abs(run.record.time - time)))
    robot = RobotSettings.model_validate(run.config["robot"])
    results = {
        (kind, scheme): _filtered(run, table, sample, robot, kind, scheme)
        for kind, _ in FILTERS
        for scheme, *_ in SCHEMES
    }
    with style.house_style():
        moment = f"t = {run.record.time[sample]:.2f} s"
        figure = style.sheet(width, 72.0 if width == style.PAGE else 68.0, _message(results, moment))
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (kind, label) in zip(panels, FILTERS, strict=True):
            _draw_set(axes, results[kind, "mi"], robot)
            for scheme, name, colour, marker, size in SCHEMES:
                _draw_control(axes, results[kind, scheme].control, marker, colour, size, name)
            _draw_control(axes, results[kind, "mi"].desired, "*", style.BLACK, 7, "desired")
            count = len(results[kind, "mi"].rows)
            axes.set_title(f"{label}: {count} {'condition' if count == 1 else 'conditions'}")
            axes.set_xlabel("ω (rad/s)")
            axes.set_xticks([-robot.omega_max, 0.0, robot.omega_max])
        panels[0].set_ylabel("a (m/s²)")
        style.legend_beside(figure, panels[1], width)
    return style.Drawing(figure, style.columns_of(_rows(results)))


def _busiest_sample(run: Run) -> int:
    robot = run.record.robot
    unmeetable = robot.slack > 1e-6  # where the rows leave no control, there is no set to show
    return int(np.lexsort((robot.value, -robot.constraints, unmeetable))[0])


def _filtered(run: Run, table: ValueTable, sample: int, robot: RobotSettings, kind: str, scheme: str) -> RowsDecision:
    """Return what a filter decides at a sample, after it has watched the run for a while."""
    record = run.record
    step = float(run.config["simulation"]["step"])
    settings = FilterSettings.model_validate({**run.config["filter"], "kind": kind, "scheme": scheme, "options": {}})
    safety_filter = make_filter(settings, robot, record.road, table, step)
    guarded = GuardedFilter(safety_filter, robot)
    first = max(sample - round(MEMORY / step), 0)
    start = record.observation(first)
    guarded.prepare(start, car_values(table, start))
    for seen in range(first, sample + 1):
        desired = Control(float(record.robot.omega_desired[seen]), float(record.robot.acceleration_desired[seen]))
        observation = record.observation(seen)
        decision = guarded.filter(observation, car_values(table, observation), desired)
    if not isinstance(decision, RowsDecision):
        raise OutputError(f"{run.folder} at {record.time[sample]:.2f} s: no filter can judge what was recorded there")
    return decision


def _message(results: dict[tuple[str, str], RowsDecision], moment: str) -> str:
    """Return what the schemes do to the desired control, and what a condition is."""
    changing = [label for kind, label in FILTERS if not _is_met(results[kind, "mi"])]
    if not changing:
        return f"At {moment} the desired control meets every car's condition, and MI leaves it; SW takes the safest"
    changes = " and ".join(changing) + (" change" if len(changing) > 1 else " changes")
    return (
        f"At {moment} {changes} the desired control: MI to the nearest that meets every car's condition, SW to the"
        " safest"
    )


def _is_met(result: RowsDecision) -> bool:
    desired, rows = result.desired, result.rows
    return bool(np.all(rows.p * desired.omega + rows.q * desired.acceleration + rows.c >= 0.0))


def _draw_control(axes: Axes, control: Control, marker: str, colour: str, size: float, label: str) -> None:
    """Draw a control as a hollow marker, for several may be at one place, the corners included."""
    axes.plot(
        control.omega,
        control.acceleration,
        marker,
        markersize=size,
        markerfacecolor="none",
        markeredgecolor=colour,
        markeredgewidth=1.8,
        clip_on=False,
        zorder=5,
        label=label,
    )


def _draw_set(axes: Axes, result: RowsDecision, robot: RobotSettings) -> None:
    """Shade the controls that meet every condition p ω + q a + c >= 0, and draw the edge of each."""
    omega = np.linspace(-robot.omega_max, robot.omega_max, 241)
    acceleration = np.linspace(robot.acceleration_min, robot.acceleration_max, 241)
    grid_omega, grid_acceleration = np.meshgrid(omega, acceleration)
    safe = np.ones(grid_omega.shape, bool)
    for p, q, c in zip(result.rows.p, result.rows.q, result.rows.c, strict=True):
        row = p * grid_omega + q * grid_acceleration + c
        safe &= row >= 0.0
        if row.min() < 0.0 < row.max():
            axes.contour(omega, acceleration, row, levels=[0.0], colors=style.GREY, linewidths=1.2)
    axes.contourf(omega, acceleration, safe, levels=[0.5, 1.5], colors=[style.ORANGE], alpha=0.45)
    axes.plot([], [], color=style.GREY, linewidth=1.2, label="edge of a condition")
    axes.fill([], [], color=style.ORANGE, alpha=0.45, linewidth=0, label="all are met")
    axes.set(xlim=(omega[0], omega[-1]), ylim=(acceleration[0], acceleration[-1]))


def _rows(results: dict[tuple[str, str], RowsDecision]) -> list[dict[str, object]]:
    """Return a row for each half-plane p ω + q a + c >= 0, with the control chosen under it."""
    rows: list[dict[str, object]] = []
    for (kind, scheme), result in results.items():
        chosen = {
            "filter": kind,
            "scheme": scheme,
            "omega": result.control.omega,
            "acceleration": result.control.acceleration,
            "omega_desired": result.desired.omega,
            "acceleration_desired": result.desired.acceleration,
            "slack": result.slack,
        }
        halves = zip(result.rows.vehicle, result.rows.p, result.rows.q, result.rows.c, strict=True)
        rows += [{**chosen, "vehicle": int(car), "p": p, "q": q, "c": c} for car, p, q, c in halves] or [chosen]
    return rows
