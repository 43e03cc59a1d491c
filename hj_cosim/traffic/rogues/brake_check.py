"""Brake checking: gets ahead of the robot in its lane, then brakes for nothing."""

from pydantic import Field

from hj_cosim.settings import RogueLimits, Settings
from hj_cosim.settings.base import Metres, MetresPerSecond, Seconds
from hj_cosim.traffic.rogues.contract import CarInput, RogueView
from hj_cosim.traffic.rogues.steering import along_with_robot, heading_to, is_in_lane, lane_beside_robot

ROOM = 0.7  # of the gap, with which it comes into the robot's lane


class BrakeCheck:
    """Gets ahead of the robot, and brakes as hard as its car can as soon as it is in its lane within `gap`.

    It passes beside the robot and aims for less than `gap`, so that it is within it once it has taken the lane.
    """

    class Options(Settings):
        """How it brakes."""

        gap: Metres = Field(10.0, gt=0, description="bumper to bumper, at which it brakes")
        drop: MetresPerSecond = Field(10.0, gt=0, description="of its speed, after which it stops braking")
        rest: Seconds = Field(4.0, ge=0, description="until it does it again")

    def __init__(self, options: Options, limits: RogueLimits) -> None:
        """Take its options, and what its car can."""
        self._options, self._limits = options, limits
        self._brakes_to: float | None = None  # m/s
        self._rests_until = 0.0

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants; see Behaviour."""
        now, gap = view.observation.time, view.ahead - view.contact
        if now < self._rests_until:
            return None
        if self._brakes_to is None and self._is_in_front(view) and gap <= self._options.gap:
            self._brakes_to = max(view.speed - self._options.drop, 0.0)
        if self._brakes_to is not None:
            if view.speed > self._brakes_to:
                return CarInput(heading_to(view, view.road.lane_centre(view.lane, view.x)), -self._limits.braking)
            self._brakes_to, self._rests_until = None, now + self._options.rest
            return None
        is_past = gap >= ROOM * self._options.gap
        lane = view.robot_lane if is_past else lane_beside_robot(view)
        return along_with_robot(view, lane, view.contact + ROOM * self._options.gap + (0.5 if not is_past else 0.0))

    def _is_in_front(self, view: RogueView) -> bool:
        return view.ahead > view.contact and is_in_lane(view, view.robot_lane)
