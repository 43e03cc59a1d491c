"""How densely a scenario's cars stand on a road of so many lanes, and how fast they then drive."""

import math

from hj_cosim.settings import Scenario, TrafficSettings
from hj_cosim.settings.scenario import CAR_LENGTH
from hj_cosim.vehicles.drivers import equilibrium_speed, mean_driver


def mean_spacing(traffic: TrafficSettings, lane_count: int) -> float:
    """Return the mean distance (m) from a car to the next one in whichever lane, 1.5 v exp(−5 n/30) times a factor."""
    if traffic.density is not None:
        return 1000.0 / (traffic.density * lane_count)
    speed = 0.5 * (traffic.speed_low + traffic.speed_high)
    return traffic.spacing_factor * 1.5 * speed * math.exp(-5.0 * lane_count / 30.0)


def density(traffic: TrafficSettings, lane_count: int) -> float:
    """Return the cars per km and lane."""
    return 1000.0 / (mean_spacing(traffic, lane_count) * lane_count)


def stream_speed(scenario: Scenario, lane_count: int) -> float:
    """Return the speed (m/s) that a mean driver keeps when every lane holds the scenario's density evenly."""
    gap = mean_spacing(scenario.traffic, lane_count) * lane_count - mean_length(scenario)
    return equilibrium_speed(gap, mean_driver(scenario.drivers)) if gap > 0.0 else 0.0


def mean_length(scenario: Scenario) -> float:
    """Return how long the drawn vehicles are on average, m."""
    return CAR_LENGTH + sum(each.share * (each.length - CAR_LENGTH) for each in scenario.vehicles)
