"""What of the cars is written down."""

from typing import Literal

from pydantic import Field

from hj_cosim.settings.base import Metres, Settings


class RecordingSettings(Settings):
    """Which cars a run's trajectories hold."""

    cars: Literal["near", "all"] = Field(
        "all",
        description="near: those near the robot, as of a .sumocfg unless given; all: of a .sumocfg, those on the"
        " robot's road and the ramps beside it",
    )
    within: Metres = Field(
        250.0, ge=10, le=100_000, description="how far from the robot a car is near; of a .sumocfg, scenario.own.near"
    )
