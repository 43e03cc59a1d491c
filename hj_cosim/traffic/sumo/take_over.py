"""The instant and the place at which the robot comes into a user's simulation."""

from dataclasses import dataclass
from pathlib import Path

from hj_cosim.traffic.junctions import Junctions
from hj_cosim.traffic.sumo.session import libsumo

BEHIND = 500.0  # m of road behind the robot, at most with as many edges as
MOST_EDGES_BEHIND = 50


@dataclass(frozen=True)
class TakeOver:
    """The instant at which the robot takes a vehicle's place.

    Attributes:
        time: s, of the simulation.
        state: the file that SUMO saved.
        vehicle: whose place it is; empty if the robot is put in where nobody is.
        route: its way from there, in SUMO.
        behind: the edges before, as far as they are a road, on which others come up from behind.
        edges: the first of its route, as far as they are a road.
        obstacle: what is behind their end; None if the way itself ends there.
        lane: SUMO's name of its lane.
        position: m, of its front bumper along the lane.
        speed: m/s.
    """

    time: float
    state: Path
    vehicle: str
    route: tuple[str, ...]
    behind: tuple[str, ...]
    edges: tuple[str, ...]
    obstacle: str | None
    lane: str
    position: float
    speed: float


def edges_behind(junctions: Junctions, edges: tuple[str, ...], driven: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the edges before the first of `edges` as far as they are a road: those that were driven, and before them.

    Args:
        junctions: of the network.
        edges: the way ahead.
        driven: the way up to it, as far as it is known.
    """
    behind: list[str] = []
    length, edge = 0.0, edges[0]
    for step in range(1, len(driven) + MOST_EDGES_BEHIND):
        earlier = driven[-step] if step <= len(driven) else junctions.before(edge)
        if earlier is None or junctions.obstacle(earlier, edge) or earlier in (*behind, *edges):
            break
        behind.insert(0, earlier)
        edge = earlier
        length += libsumo.lane.getLength(f"{edge}_0")
        if length > BEHIND:
            break
    return tuple(behind)
