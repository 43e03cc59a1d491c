"""Tailgating: close behind the robot, whatever lane it takes."""

from pydantic import Field

from hj_cosim.settings import Settings
from hj_cosim.settings.base import Metres
from hj_cosim.traffic.rogues.contract import CarInput, RogueView
from hj_cosim.traffic.rogues.steering import along_with_robot, lane_beside_robot

ROOM = 1.0  # m behind the robot's rear, from which on it takes the robot's lane


class Tailgate:
    """Falls back beside the robot until it is behind it, then follows at `gap`."""

    class Options(Settings):
        """How close it comes."""

        gap: Metres = Field(2.0, gt=0, description="bumper to bumper, behind the robot")

    def __init__(self, options: Options) -> None:
        """Take its options."""
        self._options = options

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants; see Behaviour."""
        is_behind = -view.ahead >= view.contact + ROOM
        lane = view.robot_lane if is_behind else lane_beside_robot(view)
        return along_with_robot(view, lane, -view.contact - self._options.gap)
