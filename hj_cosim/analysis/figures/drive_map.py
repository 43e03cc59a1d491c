"""A map of the drive: the network from above, the route, and the robot's way on it in the colours of its speed."""

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.view import stretches
from hj_cosim.recording.run_folder import CONFIG, Run
from hj_cosim.settings import NetworkSettings, validate
from hj_cosim.traffic.net_graph import read_graph
from hj_cosim.traffic.sources.scenarios import network_path

LARGEST_SHARE = 1.2  # height over width
LEAST_SHARE = {style.COLUMN: 0.3, style.PAGE: 0.15}  # by the figure's width
MARGIN = 60.0  # m around the route
SHORT = 0.2  # of the road's extent: of a drive shorter than this only its surroundings are shown


def drive_map(run: Run, width: int = style.PAGE) -> style.Drawing:
    """Return the map of a run's drive, in the world's coordinates (m).

    Args:
        run: the run.
        width: of the figure, mm.

    Raises:
        NetworkError: if the network that it was driven on is not there any more.
    """
    record = run.record
    road, robot = record.road, record.robot
    x, y, _ = road.to_world(robot.x, robot.y, robot.heading)
    length = road.lap or road.length
    outlines = []
    for along, lines in stretches(road, 0.0, length):
        sides = [np.column_stack(road.to_world(along, np.full(len(along), line), 0.0 * along)[:2]) for line in lines]
        outlines += [sides[0], sides[-1]]
    way = np.column_stack([x, y])
    corners = np.vstack(outlines)
    if np.ptp(way, axis=0).max() < SHORT * np.ptp(corners, axis=0).max():
        around = max(MARGIN, float(np.ptp(way, axis=0).max()))
        corners = np.clip(corners, way.min(axis=0) - around, way.max(axis=0) + around)
    low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
    share = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), LEAST_SHARE[width], LARGEST_SHARE))
    low[1], high[1] = 0.5 * (low[1] + high[1]) + 0.5 * share * (high[0] - low[0]) * np.array([-1.0, 1.0])
    with style.house_style():
        figure = style.sheet(width, 0.85 * width * share + 20.0, _message(run, length), to_scale=True)
        axes = figure.subplots()
        axes.add_collection(LineCollection(_network_lanes(run), colors=style.LANE_LINE, linewidths=0.6, zorder=1))
        axes.add_collection(LineCollection(outlines, colors=style.GREY, linewidths=0.8, zorder=2))
        pieces = LineCollection(list(np.stack([way[:-1], way[1:]], axis=1)), cmap="viridis", linewidths=2.5, zorder=3)
        pieces.set_array(robot.speed[:-1])
        axes.add_collection(pieces)
        axes.plot(*way[0], "o", color=style.BLACK, markersize=4, zorder=4)
        axes.annotate("start", way[0], xytext=(4, 4), textcoords="offset points", fontsize=style.SMALLEST_FONT)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x (m)", ylabel="y (m)")
        figure.colorbar(pieces, ax=axes, label="speed (m/s)", pad=0.01, ticks=MaxNLocator(4))
    return style.Drawing(figure, {"time": record.time, "x": x, "y": y, "speed": robot.speed})


def _message(run: Run, length: float) -> str:
    robot = run.record.robot
    return (
        f"The robot drives {robot.x[-1] - robot.x[0]:.0f} m of {length / 1000.0:.3g} km, at {robot.speed.min():.0f} to"
        f" {robot.speed.max():.0f} m/s"
    )


def _network_lanes(run: Run) -> list[np.ndarray]:
    """Return the centre lines (points, 2), m, of all lanes of the network, but for those inside junctions."""
    network = validate(NetworkSettings, run.config["scenario"]["network"], f"{run.folder / CONFIG}: scenario.network")
    graph = read_graph(Path(network_path(network)))
    edges = [edge for edge in graph.lanes if edge not in graph.inner]
    return [graph.lane(edge, index).shape[:, :2] for edge in edges for index in graph.lanes[edge]]
