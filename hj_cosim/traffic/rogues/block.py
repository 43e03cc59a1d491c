"""Boxing the robot in: one ahead that slows down, the others beside it."""

import itertools

from pydantic import Field

from hj_cosim.settings import Settings
from hj_cosim.settings.base import Metres, MetresPerSecond
from hj_cosim.traffic.rogues.contract import CarInput, RogueView
from hj_cosim.traffic.rogues.steering import (
    acceleration_to,
    along_with_robot,
    heading_to,
    is_in_lane,
    lane_beside_robot,
)

MOST = 3  # that take part


class Block:
    """Takes the place around the robot that is left for it among its accomplices: ahead, on the left, on the right.

    On a road of one lane, where nobody can be beside the robot, the places are ahead and behind.

    The one ahead drives `slower` than the robot once it is in the robot's lane, so that the robot slows down between
    the others, or runs into it.
    """

    class Options(Settings):
        """How close the box is."""

        gap: Metres = Field(6.0, gt=0, description="bumper to bumper, of the one ahead")
        slower: MetresPerSecond = Field(2.0, ge=0, description="than the robot, the one ahead")

    def __init__(self, options: Options) -> None:
        """Take its options."""
        self._options = options

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants; see Behaviour."""
        place = self._place(view)
        if place is None:
            return None
        lane, ahead = place
        # Whoever is to be ahead passes the robot in the lane beside it, if there is one, and else follows it.
        if lane == view.robot_lane and view.ahead < view.contact + 1.0 and view.lane == lane:
            lane = lane_beside_robot(view)
        elif lane == view.robot_lane and view.ahead < view.contact + 1.0:
            lane = view.lane
        elif lane == view.robot_lane and is_in_lane(view, lane, 1.0):
            robot_x = float(view.observation.robot[0])
            speed = max(view.robot_speed - self._options.slower, 0.0)
            return CarInput(
                heading_to(view, view.road.lane_centre(lane, view.x)),
                acceleration_to(view, max(robot_x + ahead, view.x), speed),
            )
        return along_with_robot(view, lane, ahead)

    def _place(self, view: RogueView) -> tuple[int, float] | None:
        """Return the lane, and how far ahead of the robot's centre (m) it is to be; None if the box is full.

        All of them choose alike: the way of sharing the places out that needs the least way in all.
        """
        lanes = view.road.lanes_at(float(view.observation.robot[0]))
        beside = [lane for lane in (view.robot_lane + 1, view.robot_lane - 1) if lane in lanes]
        away = view.contact + self._options.gap
        places = [(view.robot_lane, away), *([(lane, 0.0) for lane in beside] or [(view.robot_lane, -away)])]
        x, y = view.observation.x, view.observation.y
        robot_x = float(view.observation.robot[0])

        def way(car: int, place: tuple[int, float]) -> float:
            lane, ahead = place
            across = float(y[car]) - view.road.lane_centre(lane, float(x[car]))
            return abs(float(x[car]) - robot_x - ahead) + 2.0 * abs(across)

        nearest = sorted(view.accomplices, key=lambda car: abs(float(x[car]) - robot_x))[:MOST]
        taken = min(
            itertools.permutations(places, min(len(nearest), len(places))),
            key=lambda chosen: sum(way(car, place) for car, place in zip(nearest, chosen, strict=False)),
        )
        return dict(zip(nearest, taken, strict=False)).get(view.own)
