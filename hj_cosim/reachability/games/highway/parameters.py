"""The parameters of the highway game and their defaults."""

# The order in which the game's functions unpack them.
PARAMETERS = {
    "omega_max": 0.3,  # rad/s, |ω_r| <= this
    "acceleration_min": -6.0,  # m/s², of the robot
    "acceleration_max": 4.0,
    "other_heading_max": 0.1,  # rad, |θ_o| <= this
    "other_acceleration_min": -6.0,  # m/s²
    "other_acceleration_max": 4.0,
    "length": 5.0,  # m, mean of both bodies
    "width": 2.0,
    "response_time": 0.3,  # s, ρ of RSS; the rest of RSS's parameters follow
    "acceleration": 3.0,
    "brake_min": 6.0,
    "brake_max": 6.0,
    "lateral_acceleration": 0.2,
    "lateral_brake": 0.8,
    "lateral_margin": 0.1,
    "braking_shear": 0.0,  # s²/m, k of the grid's first axis
    "lateral_acceleration_max": 1000.0,  # m/s², |v_r ω_r| <= this: what the robot's tyres hold; so much is no limit
    "responsible": 0.0,  # 1: the other car does its duties (see `other_car`); 0: anything within its limits
    "other_response_time": 1.0,  # s, with which it keeps RSS's distance
    "standing_gap": 2.0,  # m, that it leaves besides
    "side_margin": 1.0,  # m, that it leaves beside the robot
    "turned_length": 0.0,  # m, of the robot's body, which V(0, ·) counts as turned by θ; 0, as in the paper: not turned
}
