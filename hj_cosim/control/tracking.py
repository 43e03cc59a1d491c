"""The controller that follows the planner's lane and speed (paper, eq. case study closed-loop controller)."""

import math

import numpy as np

from hj_cosim.scene.observation import Control, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings, TrackingSettings

_SLOWEST = 1e-3  # m/s, below which v ω holds nobody back


def eased(desired: Control, before: Control, jerk_max: float, step: float) -> Control:
    """Return a desired control whose acceleration has changed by no more than a jerk allows.

    Measured from what was desired before, not from what was applied: a filter that brakes does not drag it along.

    Args:
        desired: by the tracking controller.
        before: what was desired in the step before, eased.
        jerk_max: m/s³.
        step: s.
    """
    if not math.isfinite(desired.acceleration):
        return desired
    most = jerk_max * step
    eased_to = min(max(desired.acceleration, before.acceleration - most), before.acceleration + most)
    return Control(desired.omega, eased_to)


def tracking_control(
    state: np.ndarray, target: Target, road: Road, settings: TrackingSettings, robot: RobotSettings
) -> Control:
    """Return ω = −K_θ [θ + arcsin(K_1 Δℓ / v)] and a = K_2 (v_p − v), within the robot's limits.

    The paper's δ is arctan(L ω / v) of this ω. The heading towards the lane, arcsin(K_1 Δℓ / v), is clipped to
    ± `heading_max`: a slow car cannot approach its lane at K_1 Δℓ, and the value table knows no larger heading. And it
    approaches no faster than it can straighten up again within Δℓ, at half the lateral acceleration that it may have,
    else it overshoots its lane.

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s) of the robot in the road frame.
        target: the lane and speed to follow.
    """
    along, lateral, heading, speed = state.tolist()
    off_centre = lateral - road.lane_centre(target.lane, along)
    limit = math.sin(settings.heading_max)
    sideways = min(settings.lateral_acceleration_max, robot.lateral_acceleration_max)
    can_be_stopped = math.sqrt(sideways * abs(off_centre))
    towards_lane = math.copysign(min(settings.k_1 * abs(off_centre), can_be_stopped), off_centre)
    # |K_1 Δℓ| < v limit, without the division that fails at a standstill.
    if abs(towards_lane) < speed * limit:
        approach = math.asin(towards_lane / speed)
    else:
        approach = math.copysign(settings.heading_max, off_centre) if off_centre else 0.0
    omega = -settings.k_theta * (heading + approach)
    acceleration = settings.k_2 * (target.speed - speed)
    if not (math.isfinite(omega) and math.isfinite(acceleration)):
        # Within the limits it would look like any other; as it is, the filter brakes instead, and counts it.
        return Control(omega, acceleration)
    turning_max = min(robot.omega_max, sideways / max(speed, _SLOWEST))
    return Control(
        omega=min(max(omega, -turning_max), turning_max),
        acceleration=min(max(acceleration, robot.acceleration_min), robot.acceleration_max),
    )
