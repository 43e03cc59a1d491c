"""How a rogue gets to where it wants to be: a place beside, ahead of or behind the robot."""

import math

from hj_cosim.traffic.rogues.contract import CarInput, RogueView

LATERAL_RATE = 1.2  # 1/s, of the way across that is left
PLACE_RATE = 0.4  # 1/s, of the way along
SPEED_RATE = 2.0  # 1/s, of the difference in speed
MOST_CLOSING = 6.0  # m/s, faster or slower than whom it goes along with
FAR = 25.0  # m
FALLING_BACK = 0.7  # of its desired speed
LEAST_SPEED = 1.0  # m/s, below which the way across is not divided by the speed


def heading_to(view: RogueView, lateral: float, most: float = math.inf) -> float:
    """Return the heading, rad, that leads to an offset across the road.

    Args:
        view: of whom.
        lateral: p_y, m, to go to.
        most: m/s across the road.
    """
    across = LATERAL_RATE * (lateral - view.y)
    across = max(min(across, most), -most)
    return math.asin(max(min(across / max(view.speed, LEAST_SPEED), 1.0), -1.0))


def acceleration_to(view: RogueView, along: float, speed: float) -> float:
    """Return the acceleration, m/s², that leads to a place p_x, m, which moves at `speed`, m/s.

    Who has to fall back far does so at a pace that does not bring the road to a standstill.
    """
    closing = max(min(PLACE_RATE * (along - view.x), MOST_CLOSING), -MOST_CLOSING)
    least = FALLING_BACK * view.desired_speed if view.x - along > FAR else 0.0
    return SPEED_RATE * (max(speed + closing, least) - view.speed)


def along_with_robot(view: RogueView, lane: int, ahead: float) -> CarInput:
    """Return what leads into a lane, to a place `ahead` m ahead of the robot's centre, and keeps it there.

    Where there is no lane in which to pass the robot, it takes the like place on its own side of it, behind or ahead.
    """
    if lane == view.robot_lane == lane_beside_robot(view):
        ahead = math.copysign(ahead, view.ahead)
    acceleration = acceleration_to(view, float(view.observation.robot[0]) + ahead, view.robot_speed)
    return CarInput(heading_to(view, view.road.lane_centre(lane, view.x)), acceleration)


def lane_beside_robot(view: RogueView) -> int:
    """Return the lane next to the robot's on the rogue's side; the left one if it is in the robot's lane.

    It is the one on the other side where there is none on this, and the robot's own where there is no other.
    """
    lanes = view.road.lanes_at(view.x)
    side = 1 if view.lane >= view.robot_lane else -1
    beside = (view.robot_lane + side, view.robot_lane - side)
    return next((lane for lane in beside if lane in lanes), view.robot_lane)


def is_in_lane(view: RogueView, lane: int, within: float = 0.4) -> bool:
    """Return whether its centre is `within` m of a lane's centre line."""
    return abs(view.y - view.road.lane_centre(lane, view.x)) <= within
