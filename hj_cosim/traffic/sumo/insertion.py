"""A place for the robot in a user's simulation where it takes over nobody: an edge, a lane, a speed."""

from pathlib import Path

import numpy as np

from hj_cosim.errors import ScenarioError
from hj_cosim.settings import RobotStart, shown
from hj_cosim.traffic.junctions import Junctions
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo.take_over import TakeOver, edges_behind

SEARCHED_EVERY = 5.0  # m of the lane
HEADWAY, STANDING = 2.0, 10.0  # s and m that are free ahead and behind, bumper to bumper
REAR_MARGIN = 2.0  # m, of the edge, behind the robot


def inserted(start: RobotStart, length: float, junctions: Junctions, state: Path) -> TakeOver | str:
    """Return where the robot is put in now, or why it cannot be now: the first place of the lane with room.

    Its way goes on as the road does, by the most lanes, up to where no road goes on.

    Args:
        start: edge, lane (SUMO's index on the edge) and speed.
        length: of the robot, m.
        junctions: of the network.
        state: the file that SUMO's state is saved in.

    Raises:
        ScenarioError: if there is no such edge or lane, or it is too short.
    """
    lane = f"{start.edge}_{start.lane}"
    if start.edge not in libsumo.edge.getIDList():
        raise ScenarioError(f"robot.edge = {shown(repr(start.edge))}: the simulation's network has no such edge")
    count = libsumo.edge.getLaneNumber(start.edge)
    if start.lane >= count:
        raise ScenarioError(f"robot.lane = {start.lane}: edge {start.edge!r} has the lanes 0 to {count - 1}")
    longest = float(libsumo.lane.getLength(lane))
    places = np.arange(length + REAR_MARGIN, longest, SEARCHED_EVERY)
    if not len(places):
        raise ScenarioError(f"robot.edge = {start.edge!r} is {longest:.0f} m long, too short for the robot")
    front = next((float(place) for place in places if _has_room(lane, float(place), length, start.speed)), None)
    if front is None:
        return f"lane {lane!r} has no room of {HEADWAY:g} s and {STANDING:g} m ahead and behind"
    edges, onward = [start.edge], junctions.after(start.edge)
    while onward is not None and onward not in edges:
        edges.append(onward)
        onward = junctions.after(onward)
    return TakeOver(
        time=float(libsumo.simulation.getTime()),
        state=state,
        vehicle="",
        route=tuple(edges),
        behind=edges_behind(junctions, tuple(edges)),
        edges=tuple(edges),
        obstacle="road",
        lane=lane,
        position=front,
        speed=start.speed,
    )


def _has_room(lane: str, front: float, length: float, speed: float) -> bool:
    """Return whether nobody in a lane is too near to a robot whose front is at a place, m, at a speed, m/s."""
    vehicle = libsumo.vehicle
    for name in libsumo.lane.getLastStepVehicleIDs(lane):
        ahead = float(vehicle.getLanePosition(name))
        if ahead - vehicle.getLength(name) < front + STANDING + HEADWAY * speed and ahead > front:
            return False
        if ahead <= front and ahead > front - length - STANDING - HEADWAY * float(vehicle.getSpeed(name)):
            return False
    return True
