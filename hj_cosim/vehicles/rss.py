"""Distances of Responsibility-Sensitive Safety (Shalev-Shwartz, Shammah, Shashua 2017), bumper to bumper."""

from numba import njit


@njit(cache=True)
def longitudinal_distance(
    rear_speed: float,
    front_speed: float,
    response_time: float,
    acceleration: float,
    brake_min: float,
    brake_max: float,
) -> float:
    """Return d_long, what the rear car must keep so that it stops in time if the front car brakes its hardest.

    [v_r ρ + ½ a ρ² + (v_r + ρ a)² / (2 b_min) − v_f² / (2 b_max)]_+  (Definition 1 of the paper).

    Args:
        rear_speed, front_speed: m/s.
        response_time: ρ, s, of the rear car.
        acceleration: a, m/s², the rear car's during ρ.
        brake_min: b_min, m/s², what the rear car brakes at least.
        brake_max: b_max, m/s², what the front car brakes at most.

    Returns:
        m, at least 0.
    """
    after_response = rear_speed + response_time * acceleration
    distance = (
        rear_speed * response_time
        + 0.5 * acceleration * response_time**2
        + after_response**2 / (2.0 * brake_min)
        - front_speed**2 / (2.0 * brake_max)
    )
    return max(distance, 0.0)


@njit(cache=True)
def stopping_distance(speed: float, brake: float) -> float:
    """Return v² / (2 b), m; 0 for a car that stands or rolls back."""
    return max(speed, 0.0) ** 2 / (2.0 * brake)


@njit(cache=True)
def lateral_travel(speed_towards: float, response_time: float, acceleration: float, brake: float) -> float:
    """Return how far a car gets towards the other until it has no speed towards it, m (signed).

    It accelerates towards the other for ρ, then brakes. As in the ad-rss library, the way that it moves apart
    during ρ counts as negative, and a car that is still moving apart after ρ need not brake.

    Args:
        speed_towards: lateral speed towards the other car, m/s.
        response_time: ρ, s.
        acceleration: lateral acceleration towards the other during ρ, m/s².
        brake: lateral braking after it, m/s².
    """
    after_response = speed_towards + response_time * acceleration
    return 0.5 * (speed_towards + after_response) * response_time + stopping_distance(after_response, brake)


# Nine parameters: the definition's own, three for each of two cars.
@njit(cache=True)
def lateral_distance(
    left_speed_rightwards: float,
    right_speed_leftwards: float,
    left_response_time: float,
    left_acceleration: float,
    left_brake: float,
    right_response_time: float,
    right_acceleration: float,
    right_brake: float,
    margin: float,
) -> float:
    """Return d_lat = [travel of the left car to the right + travel of the right car to the left + μ]_+, m.

    Args:
        left_speed_rightwards: the left car's lateral speed towards the right one, m/s.
        right_speed_leftwards: the right car's lateral speed towards the left one, m/s.
        left_response_time, left_acceleration, left_brake: of the left car (s, m/s², m/s²).
        right_response_time, right_acceleration, right_brake: of the right car.
        margin: μ, m.
    """
    distance = (
        lateral_travel(left_speed_rightwards, left_response_time, left_acceleration, left_brake)
        + lateral_travel(right_speed_leftwards, right_response_time, right_acceleration, right_brake)
        + margin
    )
    return max(distance, 0.0)
