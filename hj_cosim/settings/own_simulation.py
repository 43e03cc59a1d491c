"""A user's own SUMO simulation, in which the robot takes over a vehicle."""

from typing import Literal

from pydantic import Field

from hj_cosim.settings.base import Metres, Seconds, Settings


class OwnSimulationSettings(Settings):
    """Which of a user's simulations is driven in, from when on, and in whose place."""

    file: str = Field("", description="a .sumocfg; its network and traffic take the place of the scenario's")
    ego: str = Field(
        "", description="the vehicle whose place the robot takes, as soon as it can; one with a long way unless given"
    )
    begin: Seconds | None = Field(
        None, ge=0, description="when the robot takes over, in the simulation's own time; after warm_up unless given"
    )
    warm_up: Seconds = Field(
        300.0, ge=0, le=86400, description="before the robot takes over, half of the simulation at most"
    )
    near: Metres = Field(250.0, ge=10, le=2000, description="the cars within it are observed and recorded")

    traffic: Literal["theirs", "idm-mobil"] = Field(
        "theirs",
        description="who drives the others: their own drivers, or IDM and MOBIL as scenario.drivers has them, each at"
        " the speed that it desired before",
    )

    @property
    def is_given(self) -> bool:
        """Whether there is one."""
        return bool(self.file)
