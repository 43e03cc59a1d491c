"""The robot: its body, its limits, and the controller that tracks a plan."""

from pydantic import Field

from hj_cosim.settings.base import (
    Metres,
    MetresPerSecond,
    MetresPerSecondCubed,
    MetresPerSecondSquared,
    PerSecond,
    Radians,
    RadiansPerSecond,
    Settings,
)


class RobotSettings(Settings):
    """The robot's body and limits (paper, case study)."""

    length: Metres = Field(5.0, ge=0.1, le=100, description="of the body, bumper to bumper")
    width: Metres = Field(2.0, ge=0.1, le=20, description="of the body")
    wheelbase: Metres = Field(5.0, ge=0.1, le=100, description="between the axles, the paper's L")
    omega_max: RadiansPerSecond = Field(0.3, ge=0.001, le=10, description="the fastest it turns, limit on |ω_r|")
    acceleration_min: MetresPerSecondSquared = Field(-6.0, ge=-100, le=-0.01, description="the hardest it brakes")
    acceleration_max: MetresPerSecondSquared = Field(4.0, ge=0.01, le=100, description="the hardest it accelerates")
    lateral_acceleration_max: MetresPerSecondSquared = Field(
        1000.0, ge=0.1, le=1000, description="what its tyres hold, limit on |v ω_r|; 1000, the paper's, is no limit"
    )
    # What the value table knows of turning is against the road, as far as omega_max and lateral_acceleration_max go.
    # These two are kept beside it for the road's own bends, so that all of that is there on a bend as well.
    bend_rate_max: RadiansPerSecond = Field(
        0.15, ge=0, le=10, description="what it can turn beyond omega_max, for bends of the road: |κ| v"
    )
    bend_acceleration_max: MetresPerSecondSquared = Field(
        4.5, ge=0, le=1000, description="what its tyres hold beyond lateral_acceleration_max, for bends: |κ| v²"
    )
    speed_max: MetresPerSecond = Field(40.0, ge=0.1, le=1000, description="the fastest it drives")


class TrackingSettings(Settings):
    """Gains of the closed-loop tracking controller (paper, eq. case study closed-loop controller)."""

    k_theta: PerSecond = Field(5.0, gt=0, description="K_θ, of the heading's error")
    k_1: PerSecond = Field(2.0, gt=0, description="K_1, of the error across the road")
    k_2: PerSecond = Field(1.67, gt=0, description="K_2, of the speed's error")
    lateral_acceleration_max: MetresPerSecondSquared = Field(
        1000.0, ge=0.1, le=1000, description="how hard it turns, |v ω|, as far as the robot may; 1000 is no limit"
    )
    jerk_max: MetresPerSecondCubed = Field(
        1e6, gt=0, le=1e6, description="how fast the desired acceleration changes; the paper's 1e6 is no limit"
    )
    heading_max: Radians = Field(0.4, gt=0, lt=1.57, description="towards the lane; the value table reaches 0.4")
