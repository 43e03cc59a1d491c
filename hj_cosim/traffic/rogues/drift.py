"""Drifting: leaves its lane slowly, as who looks at a telephone."""

import numpy as np
from pydantic import Field

from hj_cosim.settings import Settings
from hj_cosim.settings.base import Metres, MetresPerSecond, Seconds
from hj_cosim.traffic.rogues.contract import CarInput, RogueView
from hj_cosim.traffic.rogues.steering import heading_to, is_in_lane


class Drift:
    """Near the robot it drifts into the next lane, the robot's side of it, and looks up when it is in there."""

    class Options(Settings):
        """How it drifts."""

        rate: MetresPerSecond = Field(0.5, gt=0, description="across the road")
        near: Metres = Field(30.0, gt=0, description="of the robot, along the road, it looks away")
        rest: Seconds = Field(6.0, ge=0, description="until it looks away again")

    def __init__(self, options: Options, random: np.random.Generator) -> None:
        """Take its options, and what decides on a side where neither is the robot's."""
        self._options, self._random = options, random
        self._lane: int | None = None  # that it drifts into
        self._rests_until = 0.0

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants; see Behaviour."""
        now = view.observation.time
        if self._lane is None and now >= self._rests_until and abs(view.ahead) <= self._options.near:
            self._lane = self._next_lane(view)
        if self._lane is None:
            return None
        if is_in_lane(view, self._lane):
            self._lane, self._rests_until = None, now + self._options.rest
            return None
        lateral = view.road.lane_centre(self._lane, view.x)
        return CarInput(heading_to(view, lateral, self._options.rate), view.ordinary.acceleration)

    def _next_lane(self, view: RogueView) -> int | None:
        lanes = view.road.lanes_at(view.x)
        if view.lane != view.robot_lane:
            return view.lane + (1 if view.robot_lane > view.lane else -1)
        beside = [lane for lane in (view.lane - 1, view.lane + 1) if lane in lanes]
        return int(self._random.choice(beside)) if beside else None
