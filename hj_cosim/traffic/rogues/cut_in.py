"""Cutting in: from the lane beside into a gap ahead of the robot that RSS forbids."""

from pydantic import Field

from hj_cosim.settings import Settings
from hj_cosim.settings.base import Metres, Seconds
from hj_cosim.traffic.rogues.contract import CarInput, RogueView
from hj_cosim.traffic.rogues.steering import along_with_robot, heading_to, is_in_lane, lane_beside_robot

ARRIVED = 1.0  # m, by which it may miss the gap that it wants before it steers


class CutIn:
    """Goes along beside the robot until its rear is `gap` ahead of the robot's front, then takes the robot's lane."""

    class Options(Settings):
        """How it cuts in."""

        gap: Metres = Field(3.0, gt=0, description="bumper to bumper; RSS asks some 10 m at 22 m/s")
        rest: Seconds = Field(4.0, ge=0, description="until it does it again")

    def __init__(self, options: Options) -> None:
        """Take its options."""
        self._options = options
        self._lane: int | None = None  # that it is cutting into
        self._rests_until = 0.0

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants; see Behaviour."""
        now = view.observation.time
        if now < self._rests_until:
            return None
        ahead = view.contact + self._options.gap
        if self._lane is None:
            beside = lane_beside_robot(view)
            if not (is_in_lane(view, beside) and abs(view.ahead - ahead) <= ARRIVED):
                return along_with_robot(view, beside, ahead)
            self._lane = view.robot_lane
        if is_in_lane(view, self._lane):
            self._lane, self._rests_until = None, now + self._options.rest
            return None
        steered = heading_to(view, view.road.lane_centre(self._lane, view.x))
        return CarInput(steered, along_with_robot(view, self._lane, ahead).acceleration)
