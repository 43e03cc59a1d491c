"""Reading the road frame from a SUMO network: any straight edge of two or more equally wide lanes."""

import math
from pathlib import Path

import numpy as np

from hj_cosim.errors import NetworkError
from hj_cosim.scene.road import StraightRoad
from hj_cosim.traffic.net_file import CAR_CLASS, NetLane, lane_of, read_elements

# What counts as straight, parallel and equally wide (m), and as parallel (rad): above the centimetres that nets are
# rounded to, below what a planner or a table would notice.
POSITION_TOLERANCE = 0.05
LENGTH_TOLERANCE = 0.1
NARROWEST_LANE = 2.5  # m


def read_road(path: Path, edge: str) -> StraightRoad:
    """Return the road that `edge` of the SUMO network at `path` is.

    Raises:
        NetworkError: if the file is missing or malformed, or the edge is not a straight one of two or more
            equally wide, parallel lanes that admit cars.
    """
    lanes, edges = _read_lanes(path, edge)
    if edge not in edges:
        shown = ", ".join(sorted(edges)[:8]) or "none"
        raise NetworkError(f"{path} has no edge {edge!r}; set network.edge to one of its edges ({shown})")
    where = f"{path}: edge {edge!r}"
    if len(lanes) < 2:
        raise NetworkError(f"{where} has {len(lanes)} lane; two or more are needed to overtake")
    return _road_of(lanes, where)


def _read_lanes(path: Path, edge: str) -> tuple[list[NetLane], set[str]]:
    """Return the lanes of `edge`, from the right, and the names of all edges that are not inside a junction."""
    lanes: dict[int, NetLane] = {}
    edges: set[str] = set()
    inside = False

    def on_element(name: str, attributes: dict[str, str]) -> None:
        nonlocal inside
        if name == "edge" and attributes.get("function") != "internal":
            edges.add(attributes.get("id", ""))
            inside = attributes.get("id") == edge
        elif name == "edge":
            inside = False
        elif name == "lane" and inside:
            lanes[int(attributes["index"])] = lane_of(attributes)

    read_elements(path, on_element, f"edge {edge!r}")
    return [lanes[index] for index in sorted(lanes)], edges


def _road_of(lanes: list[NetLane], where: str) -> StraightRoad:
    """Return the road that these lanes are, or say what keeps them from being one."""
    first = lanes[0]
    origin = first.shape[0, :2]
    along = first.shape[-1, :2] - origin
    length = float(np.hypot(*along))
    if length < 1.0:
        raise NetworkError(f"{where} is {length:.2f} m long; name a longer one")
    heading = math.atan2(along[1], along[0])
    leftwards = np.array([-math.sin(heading), math.cos(heading)])
    for number, lane in enumerate(lanes):
        name = f"{where}, lane {number}"
        if not lane.admits_cars:
            raise NetworkError(f"{name} does not admit cars ({CAR_CLASS}); name an edge of car lanes only")
        if abs(lane.width - first.width) > POSITION_TOLERANCE or lane.width < NARROWEST_LANE:
            raise NetworkError(
                f"{name} is {lane.width:.2f} m wide and lane 0 {first.width:.2f} m; lanes must be equally wide,"
                f" and at least {NARROWEST_LANE} m"
            )
        if np.ptp(lane.shape[:, 2]) > POSITION_TOLERANCE:
            raise NetworkError(f"{name} has a slope; only flat roads are supported")
        offset = (lane.shape[:, :2] - origin) @ leftwards - number * first.width
        if np.abs(offset).max() > POSITION_TOLERANCE:
            raise NetworkError(
                f"{name} is not straight and parallel: its centre line is {np.abs(offset).max():.2f} m"
                f" from where lane 0 puts it; name a straight edge"
            )
        if abs(lane.length - length) > LENGTH_TOLERANCE:
            raise NetworkError(
                f"{name} states a length of {lane.length:.2f} m, but its shape is {length:.2f} m long; make them agree"
            )
    return StraightRoad(len(lanes), first.width, length, float(origin[0]), float(origin[1]), heading)
