"""A stretch of road from above, with its lanes and cars, on given axes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle

from hj_cosim.analysis.figures import style
from hj_cosim.recording.record import RunRecord
from hj_cosim.scene.road import Road


def draw_road(axes: Axes, road: Road, start: float, stop: float) -> None:
    """Draw the road between two arc lengths (m), at one scale in both directions, and hide the axes' frame."""
    lines = road.lane_lines(start)
    low, high = lines[0], lines[-1]
    axes.add_patch(Rectangle((start, low), stop - start, high - low, facecolor=style.ASPHALT, zorder=0))
    for line in lines:
        edge = line in (low, high)
        axes.hlines(
            line,
            start,
            stop,
            color=style.GREY if edge else style.LANE_LINE,
            linewidth=1.2 if edge else 0.8,
            linestyle="-" if edge else (0, (6, 6)),
            zorder=1,
        )
    axes.set(xlim=(start, stop), ylim=(low - 0.8, high + 0.8), yticks=[], aspect="equal")
    axes.grid(False)
    axes.spines[:].set_visible(False)


def body_corners(
    x: np.ndarray, y: np.ndarray, heading: np.ndarray, length: np.ndarray, width: np.ndarray
) -> np.ndarray:
    """Return the corners of cars, (J, 4, 2) in m, from their centres (m), headings (rad) and sizes (m), each (J,)."""
    ahead = 0.5 * np.stack([length * np.cos(heading), length * np.sin(heading)], axis=-1)
    aside = 0.5 * np.stack([-width * np.sin(heading), width * np.cos(heading)], axis=-1)
    centre = np.stack([x, y], axis=-1)
    return np.stack([centre + ahead + aside, centre - ahead + aside, centre - ahead - aside, centre + ahead - aside], 1)


def draw_cars(
    axes: Axes,
    corners: np.ndarray,
    colours: object = style.CAR,
    edge: str | Sequence[str] = style.CAR_EDGE,
    zorder: float = 3.0,
) -> None:
    """Draw cars, whose corners are as body_corners returns them; `colours` and `edge` are one colour or one a car."""
    axes.add_collection(
        PolyCollection(list(corners), facecolors=colours, edgecolors=edge, linewidths=0.7, zorder=zorder)
    )


def draw_robot(axes: Axes, x: float, y: float, heading: float, length: float, width: float) -> None:
    """Draw the robot: the one dark car, with an arrow head as its nose."""
    corners = body_corners(*np.array([[x], [y], [heading], [length], [width]]))
    draw_cars(axes, corners, style.ROBOT, style.BLACK, zorder=5.0)
    nose = np.array([[0.45, 0.0], [0.1, 0.35], [0.1, -0.35]]) * [length, width]
    cos, sin = np.cos(heading), np.sin(heading)
    turned = nose @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
    axes.fill(turned[:, 0], turned[:, 1], color="white", zorder=6.0, linewidth=0)


def draw_scene(axes: Axes, record: RunRecord, sample: int, behind: float, ahead: float) -> np.ndarray:
    """Draw one sample of a run, from `behind` m behind the robot to `ahead` m ahead of it.

    Returns:
        (K,) the numbers of the cars in view.
    """
    robot, traffic = record.robot, record.traffic
    start, stop = robot.x[sample] - behind, robot.x[sample] + ahead
    draw_road(axes, record.road, start, stop)
    reach = 0.5 * traffic.length
    x = traffic.x[sample]
    seen = np.flatnonzero(traffic.present[sample] & (x > start - reach) & (x < stop + reach))
    corners = body_corners(
        x[seen], traffic.y[sample, seen], traffic.heading[sample, seen], traffic.length[seen], traffic.width[seen]
    )
    draw_cars(axes, corners, [style.ROGUE if rogue else style.CAR for rogue in record.is_rogue[seen]])
    draw_robot(
        axes,
        robot.x[sample],
        robot.y[sample],
        robot.heading[sample],
        record.robot_length,
        record.robot_width,
    )
    return seen


def scene_rows(record: RunRecord, sample: int, seen: np.ndarray) -> list[dict[str, object]]:
    """Return the data of a scene, a row for the robot and for each car in view."""
    robot, traffic = record.robot, record.traffic
    time = record.time[sample]
    rows: list[dict[str, object]] = [
        {
            "time": time,
            "vehicle": "robot",
            "x": robot.x[sample],
            "y": robot.y[sample],
            "heading": robot.heading[sample],
            "speed": robot.speed[sample],
        }
    ]
    rows.extend(
        {
            "time": time,
            "vehicle": traffic.names[j],
            "x": traffic.x[sample, j],
            "y": traffic.y[sample, j],
            "heading": traffic.heading[sample, j],
            "speed": traffic.speed[sample, j],
        }
        for j in seen
    )
    return rows
