"""A stretch of road from above, with its lanes and cars, on given axes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.view import View, height_of, stretches
from hj_cosim.recording.record import RunRecord


def draw_road(axes: Axes, view: View, start: float, stop: float, height: tuple[float, float]) -> None:
    """Draw the road between two s (m), at one scale in both directions, and hide the axes' frame.

    Args:
        axes: where to.
        view: how the road is looked at.
        start, stop: m.
        height: the lowest and the highest y of its lines, m, that the picture is to hold.
    """
    for along, lines in stretches(view.road, start, stop):
        sides = [view.points(np.column_stack([along, np.full(len(along), line)])) for line in lines]
        axes.add_patch(Polygon(np.vstack([sides[0], sides[-1][::-1]]), facecolor=style.ASPHALT, zorder=0))
        for number, side in enumerate(sides):
            edge = number in (0, len(sides) - 1)
            axes.plot(
                *side.T,
                color=style.GREY if edge else style.LANE_LINE,
                linewidth=1.2 if edge else 0.8,
                linestyle="-" if edge else (0, (6, 6)),
                zorder=1,
            )
    axes.set(xlim=(start, stop), ylim=(height[0] - 0.8, height[1] + 0.8), yticks=[], aspect="equal")
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
    edge: str | Sequence[object] = style.CAR_EDGE,
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


def draw_scene(
    axes: Axes, record: RunRecord, sample: int, behind: float, ahead: float, height: tuple[float, float] | None = None
) -> np.ndarray:
    """Draw one sample of a run, from `behind` m behind the robot to `ahead` m ahead of it.

    Args:
        axes: where to.
        record, sample: of what.
        behind, ahead: m of s.
        height: the lowest and the highest y of the road, m; of this sample's picture if left out.

    Returns:
        (K,) the numbers of the cars in view.
    """
    robot = record.robot
    _, cars, traffic = record.traffic.at(sample)
    start, stop = robot.x[sample] - behind, robot.x[sample] + ahead
    view = View(record.road, float(robot.x[sample]))
    draw_road(axes, view, start, stop, height or height_of(record.road, robot.x[sample : sample + 1], behind, ahead))
    reach = 0.5 * traffic.length
    x = traffic.x[0]
    seen = np.flatnonzero((x > start - reach) & (x < stop + reach))
    places = view.place(x[seen], traffic.y[0, seen], traffic.heading[0, seen])
    colours = [style.ROGUE if traffic.names[car] in record.rogues else style.CAR for car in seen.tolist()]
    draw_cars(axes, body_corners(*places, traffic.length[seen], traffic.width[seen]), colours)
    if record.belief is not None:
        likely = np.nan_to_num(record.belief[sample, seen])
        rings = body_corners(*places, traffic.length[seen] + style.RING[0], traffic.width[seen] + style.RING[1])
        edges = [(*to_rgb(style.SUSPECT), each) for each in likely]
        draw_cars(axes, rings, "none", edges, zorder=2.9)
    own = view.place(*(column[sample : sample + 1] for column in (robot.x, robot.y, robot.heading)))
    x_0, y_0, heading = (float(column[0]) for column in own)
    draw_robot(axes, x_0, y_0, heading, record.robot_length, record.robot_width)
    return np.asarray(cars[seen])


def scene_rows(record: RunRecord, sample: int, seen: np.ndarray) -> list[dict[str, object]]:
    """Return the data of a scene, a row for the robot and for each car in view."""
    robot = record.robot
    _, cars, traffic = record.traffic.at(sample)
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
            "x": traffic.x[0, j],
            "y": traffic.y[0, j],
            "heading": traffic.heading[0, j],
            "speed": traffic.speed[0, j],
        }
        for j in np.searchsorted(cars, seen).tolist()
    )
    return rows
