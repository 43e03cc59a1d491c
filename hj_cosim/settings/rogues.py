"""Drivers who mean harm: how many, what they do, when they begin, and what their cars can."""

from typing import Any

from pydantic import Field, model_validator

from hj_cosim.settings.base import Metres, MetresPerSecondSquared, Number, Radians, RadiansPerSecond, Seconds, Settings

# A behaviour drawn for each rogue among those that come with the package.
MIXED = "mixed"


class RogueLimits(Settings):
    """What a rogue's car can do; the defaults are those of the other car in the game of `highway`."""

    heading: Radians = Field(0.1, gt=0, le=0.5, description="the largest heading against the road, either way")
    turn_rate: RadiansPerSecond = Field(0.3, gt=0, le=2, description="the fastest change of that heading")
    braking: MetresPerSecondSquared = Field(6.0, gt=0, le=10, description="the hardest")
    acceleration: MetresPerSecondSquared = Field(4.0, gt=0, le=10, description="the strongest")


class RogueSettings(Settings):
    """Which of the cars are driven by rogues, and how; cars placed by hand name a behaviour of their own."""

    share: Number = Field(0.0, ge=0, le=1, description="of the drawn cars; which ones is drawn too")
    behaviour: str = Field(
        MIXED,
        min_length=1,
        description="what they do; FILE.py:Class or package.module:Class is one of one's own, mixed draws one for each",
        examples=["cut_in", "brake_check", "tailgate", "drift", "block", "worst", MIXED],
    )
    options: dict[str, Any] = Field({}, description="settings of the behaviour's own, where its class has any")
    within: Metres = Field(250.0, gt=0, description="of the robot, along the road, a rogue begins")
    after: Seconds = Field(0.0, ge=0, description="and no earlier than this, since the robot took over")
    limits: RogueLimits = Field(RogueLimits(), description="what their cars can do")

    @model_validator(mode="after")
    def _is_consistent(self) -> "RogueSettings":
        if self.options and self.behaviour == MIXED:
            raise ValueError(f"options are one behaviour's own; name that in behaviour in place of {MIXED!r}")
        return self
