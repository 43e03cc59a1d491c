"""What passengers and tyres feel on a bend, against a circle's closed form."""

import pytest
from bent_roads import circle

from hj_cosim.metrics.jerk_and_turning import jerk_and_turning


def test_the_lateral_acceleration_of_a_bend_is_what_the_world_feels(make_record):
    record = make_record(road=circle(300.0))
    record.robot.omega[:], record.robot.heading[:], record.robot.y[:], record.robot.speed[:] = 0.0, 0.0, 7.0, 24.0
    felt = jerk_and_turning(record)
    assert felt["mean_abs_lateral_acceleration"] == pytest.approx(24.0**2 / 300.0, rel=1e-3)
