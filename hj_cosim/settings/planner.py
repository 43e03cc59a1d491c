"""The planner: optimistic planning, its reward, and what it predicts with."""

from typing import Any

from pydantic import Field, model_validator

from hj_cosim.settings.base import Metres, MetresPerSecond, MetresPerSecondSquared, Number, Radians, Seconds, Settings

# What one action of the planner's tree is predicted in, at most.
MOST_PREDICTION_STEPS = 1000


class PlannerSettings(Settings):
    """Optimistic planning and its reward (paper, section Planner Dynamics and Reward Function)."""

    kind: str = Field(
        "hjop",
        description="hjop, op, mppi, idle, a name that a package registers, FILE.py:Class or package.module:Class",
        examples=["hjop", "op", "mppi", "idle"],
    )
    gamma_r: Number = Field(0.9, ge=0, le=1, description="γ_R, weight of the driving reward in HJOP; OP has 1")
    value_clip: Metres = Field(8.0, gt=0, description="the HJI reward is clipped to ± this")
    expansions: int = Field(300, ge=1, le=1_000_000, description="node expansions per plan, some 4 to 6 ms of them")
    discount: Number = Field(0.9, gt=0, lt=1, description="γ of the tree search")
    speed_weight: Number = Field(0.4, ge=0, description="γ_1, of the speed in the driving reward")
    lane_weight: Number = Field(1.0, ge=0, description="γ_2, of the lane in the driving reward")
    crash_weight: Number = Field(1.0, ge=0, description="γ_3, of a crash in the driving reward")
    speed_low: MetresPerSecond = Field(15.0, ge=0, description="where the speed reward is 0")
    speed_high: MetresPerSecond = Field(30.0, gt=0, description="where the speed reward is γ_1")
    speed_step: MetresPerSecond = Field(1.0, gt=0, description="what one action adds to the planned speed")
    speed_window: MetresPerSecond = Field(4.0, gt=0, description="the planned speed stays this near the robot's")
    speed_floor: MetresPerSecond = Field(
        0.0, ge=0, description="nothing slower is planned; 15, the paper's lower limit, does not follow a jam"
    )
    action_time: Seconds = Field(1.0, gt=0, description="the duration of one action in the tree")
    sensing_range: Metres = Field(120.0, gt=0, description="cars within it enter the tree")
    prediction_step: Seconds = Field(0.25, gt=0, description="about the step of the predicted car following")
    lane_change_time: Seconds = Field(2.0, gt=0, description="in which the tracked robot gets one lane across")
    heading_max: Radians = Field(
        0.4, gt=0, lt=1.57, description="towards a lane, at most; a slow robot takes longer across, as it is tracked"
    )
    others_lane_change_time: Seconds = Field(3.0, gt=0, description="in which the other cars do")
    speed_response: Seconds = Field(0.6, gt=0, description="time constant of the tracked speed, 1/K_2")
    polite_braking: MetresPerSecondSquared = Field(
        9.0,
        ge=0,
        description="no lane change is planned for which who is behind then has to brake harder; 9 minds nobody, as the"
        " paper",
    )
    options: dict[str, Any] = Field({}, description="settings that a planner of one's own brings")

    @model_validator(mode="after")
    def _speeds_are_ordered(self) -> "PlannerSettings":
        if self.speed_high <= self.speed_low:
            raise ValueError(f"speed_high ({self.speed_high}) must exceed speed_low ({self.speed_low})")
        if self.speed_floor > self.speed_low:
            raise ValueError(f"speed_floor ({self.speed_floor}) must not exceed speed_low ({self.speed_low})")
        if self.action_time > MOST_PREDICTION_STEPS * self.prediction_step:
            raise ValueError(
                f"prediction_step ({self.prediction_step}) must be at least action_time ({self.action_time}) /"
                f" {MOST_PREDICTION_STEPS}"
            )
        return self
