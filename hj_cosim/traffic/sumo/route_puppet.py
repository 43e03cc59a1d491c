"""The robot as a puppet on a route of many edges: bends, junctions, lanes that end."""

import math

from hj_cosim.errors import DriveEnded, SimulationError
from hj_cosim.scene.road import Road
from hj_cosim.traffic.sumo.puppet import KEEP_EXACT_POSITION, ROBOT, Placement, Puppet
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo_lanes import SumoLanes

OFF_THE_ROAD = "off the road"


class RoutePuppet(Puppet):
    """Puts the robot where SUMO has its lane, s and offset: there the others' gaps to it are those of the road frame.

    The smooth road and SUMO's polylines are some centimetres apart, at the corners of real networks half a metre.
    """

    def __init__(self, road: Road, lanes: SumoLanes, route: str, name: str = ROBOT) -> None:
        """Take the robot, or another vehicle, which is in SUMO already, over.

        Args:
            road: the road.
            lanes: what SUMO calls its lanes.
            route: of the vehicle and its ghost, a name in SUMO.
            name: the vehicle's, and its type's.
        """
        super().__init__(road, lanes.edges[0], route, name)
        self._lanes = lanes
        self._placement: Placement | None = None

    def place(self, robot: Placement, is_beside_somebody: bool) -> None:
        """Tell SUMO where the robot is to be when the next step ends; see Puppet.

        A ghost that would be where its lane has ended already is left out.
        """
        other = robot.second_lane if robot.front_lane == robot.lane else robot.lane
        if other != robot.front_lane and self._lanes.place(other, robot.along) is None:
            robot = robot._replace(lane=robot.front_lane, second_lane=robot.front_lane)
        self._placement = robot
        if robot.second_lane == robot.lane and libsumo.vehicle.getShadowLaneID(self._name):
            # A line crossed close to a junction leaves the old lane blocked, whatever lane the robot was set into.
            self._put_into_lane(self._name, self._neighbour(robot.lane))
            self._put_into_lane(self._name, robot.lane)
        super().place(robot, is_beside_somebody)

    def _neighbour(self, lane: int) -> int:
        edge = libsumo.vehicle.getRoadID(self._name)
        return lane - 1 if self._lanes.index_on(edge, lane + 1) is None else lane + 1

    def _move_to(self, name: str, lane: int, place: tuple[float, float, float]) -> None:
        along, lateral, heading = place
        found = self._lanes.place(lane, along)
        if found is None:
            raise SimulationError(f"the road has no lane {lane} at s = {along:.1f} m, where {name} is to be")
        sumo_lane, position = found
        offset = lateral - self._road.lane_centre(lane, along)
        x, y, direction = sumo_lane.world(position, offset)
        angle = 90.0 - math.degrees(direction + heading)
        libsumo.vehicle.moveToXY(name, sumo_lane.edge, sumo_lane.index, x, y, angle, KEEP_EXACT_POSITION)

    def _put_into_lane(self, name: str, lane: int) -> None:
        edge = libsumo.vehicle.getRoadID(name)
        index = self._lanes.index_on(edge, lane)
        if index is not None:
            libsumo.vehicle.moveTo(name, f"{edge}_{index}", libsumo.vehicle.getLanePosition(name))

    def after_step(self, speed: float) -> None:
        """Give the robot and its ghost their speed (m/s), which SUMO takes from their way, corners and all.

        Raises:
            DriveEnded: if the robot is beside the road, where nobody sees it.
            SimulationError: if SUMO has lost it on the road.
        """
        if not libsumo.vehicle.getLaneID(self._name):
            self._tell_that_it_is_lost()
        libsumo.vehicle.setPreviousSpeed(self._name, speed)
        if self._has_ghost and libsumo.vehicle.getLaneID(self._ghost):
            libsumo.vehicle.setPreviousSpeed(self._ghost, speed)

    def _tell_that_it_is_lost(self) -> None:
        placement = self._placement
        if placement is None:
            return
        x, y, _ = self._road.to_world(placement.along, placement.lateral, 0.0)
        where = f"s = {placement.along:.1f} m, d = {placement.lateral:.2f} m (x = {x:.1f}, y = {y:.1f})"
        lines = self._road.lane_lines(placement.along)
        if not lines[0] <= placement.lateral <= lines[-1]:
            raise DriveEnded(OFF_THE_ROAD, f"the robot left the road at {where}; nobody sees it there")
        raise SimulationError(f"SUMO has the robot in no lane at {where}; does the network have a gap there?")
