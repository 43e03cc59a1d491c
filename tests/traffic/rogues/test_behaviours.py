"""What rogues do to a robot that keeps its lane and its speed, in SUMO: what their names say."""

import numpy as np
import pytest
from rogue_scenes import LENGTH, ROBOT_LANE, SPEED, TRAFFIC_STEP, coast, touches

from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import CarValues, Observation
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import CarStart, RogueLimits
from hj_cosim.traffic.rogues.contract import CarInput, RogueView
from hj_cosim.traffic.rogues.worst import Worst
from hj_cosim.vehicles.rss import longitudinal_distance

ROBOT_Y = 4.0 * ROBOT_LANE


def test_cut_in_takes_a_gap_ahead_of_the_robot_that_rss_forbids(drive, rogue):
    track = drive([rogue("cut_in", 2, -4.0)], 9.0).of(0)
    asked = longitudinal_distance(SPEED, SPEED, 0.3, 3.0, 6.0, 6.0)
    enters = np.flatnonzero(np.abs(track["aside"]) < 2.0)
    assert len(enters) > 0
    gap = track["ahead"][enters[0]] - LENGTH
    assert 1.0 < gap < 0.6 * asked
    assert np.abs(track["aside"][:5]).min() > 3.5  # it came from the lane beside
    assert np.abs(track["aside"]).min() < 0.5


def test_brake_check_gets_ahead_of_the_robot_in_its_lane_and_brakes_with_six(drive, rogue):
    track = drive([rogue("brake_check", 2, 0.0)], 12.0).of(0)
    brakes = np.flatnonzero(track["acceleration"] < -5.9)
    assert len(brakes) * TRAFFIC_STEP == pytest.approx(10.0 / 6.0, abs=0.25)  # 10 m/s of its speed
    assert track["acceleration"].min() >= -6.001
    first = brakes[0]
    assert 0.0 < track["ahead"][first] - LENGTH < 11.0
    assert abs(track["aside"][first]) < 0.5


def test_brake_check_brakes_for_nothing(drive, rogue):
    track = drive([rogue("brake_check", 1, 14.0)], 2.0).of(0)
    assert track["acceleration"].min() == pytest.approx(-6.0, abs=0.01)


def test_tailgate_follows_closely_and_into_another_lane_too(drive, rogue):
    def changes_lanes(state, time):
        x, y, _, speed = coast(state, time)
        return np.array([x, min(y + 0.03, 8.0) if time > 8.0 else y, 0.0, speed])

    track = drive([rogue("tailgate", 1, -20.0)], 16.0, changes_lanes).of(0)
    gap = -track["ahead"] - LENGTH
    assert gap[79] == pytest.approx(2.0, abs=0.5)
    assert abs(track["aside"][79]) < 0.2
    assert track["y"][-1] == pytest.approx(8.0, abs=0.2)
    assert gap[-1] == pytest.approx(2.0, abs=0.5)
    assert not touches(track)


def test_tailgate_comes_from_ahead_as_well(drive, rogue):
    track = drive([rogue("tailgate", 2, 15.0)], 14.0).of(0)
    assert -track["ahead"][-1] - LENGTH == pytest.approx(2.0, abs=0.5)
    assert abs(track["aside"][-1]) < 0.2


def test_drift_leaves_its_lane_slowly_towards_the_robot(drive, rogue):
    track = drive([rogue("drift", 2, 12.0)], 8.0).of(0)
    rate = -np.diff(track["y"]) / TRAFFIC_STEP
    assert rate.max() == pytest.approx(0.5, abs=0.02)
    crossed = np.flatnonzero(track["y"] < ROBOT_Y + 2.0)[0] * TRAFFIC_STEP
    assert crossed == pytest.approx(2.0 / 0.5, abs=0.6)


def test_block_boxes_the_robot_in_on_three_sides(drive, rogue):
    cars = [rogue("block", 2, -15.0), rogue("block", 0, -15.0), rogue("block", 3, 10.0)]
    tracks = drive(cars, 9.0)
    at_the_end = np.array([[tracks.of(car)[name][-1] for name in ("ahead", "aside")] for car in range(3)])
    right, left, ahead = at_the_end[np.argsort(at_the_end[:, 1])][[0, 2, 1]]
    assert abs(right[0]) < 2.5
    assert right[1] == pytest.approx(-4.0, abs=0.4)
    assert abs(left[0]) < 2.5
    assert left[1] == pytest.approx(4.0, abs=0.4)
    assert LENGTH < ahead[0] < LENGTH + 8.0
    assert abs(ahead[1]) < 1.0


def test_block_shares_the_places_out_among_two(drive, rogue):
    tracks = drive([rogue("block", 2, 12.0), rogue("block", 0, -8.0)], 6.0)
    assert abs(tracks.of(0)["aside"][-1]) < 1.0
    assert tracks.of(1)["aside"][-1] == pytest.approx(-4.0, abs=0.4)
    assert abs(tracks.of(1)["ahead"][-1]) < 2.5


def test_worst_hits_a_robot_that_does_nothing_from_where_an_ordinary_driver_does_not(drive, rogue):
    ordinary = CarStart(lane=1, x=25.0, speed=SPEED, desired_speed=SPEED)
    assert touches(drive([rogue("worst", 1, 25.0)], 6.0).of(0))
    assert not touches(drive([ordinary], 6.0).of(0))


def test_worst_lowers_v_as_fast_as_any_input_does(small_table: ValueTable):
    limits, random = RogueLimits(), np.random.default_rng(3)
    tried = 0
    for state in small_table.draw_states(400, random):
        p_x, p_y, heading, v_r, v_o = state
        value, gradient = (each[0] for each in small_table.value_and_gradient(state[None]))
        if not np.isfinite(value) or not gradient[:2].any():
            continue
        values = CarValues(np.array([value]), gradient[None], value, 0)
        one = np.zeros(1)
        observation = Observation(
            0.0, np.array([p_x, p_y, heading, v_r]), 0.0, one.astype(int), one, one, one, np.array([v_o]), one,
            one.astype(int), one.astype(int), np.full(1, 5.0), np.full(1, 2.0),
        )  # fmt: skip
        view = RogueView(observation, 0, (0,), StraightRoad(4), 5.0, 24.0, CarInput(0.0, 0.0))
        chosen = Worst(limits, lambda _, values=values: values).act(view)

        def fall(angle, acceleration, gradient=gradient, v_o=v_o):
            return -v_o * (gradient[0] * np.cos(angle) + gradient[1] * np.sin(angle)) + acceleration * gradient[4]

        angles, accelerations = np.linspace(-0.1, 0.1, 41), np.linspace(-6.0, 4.0, 11)
        least = min(fall(angle, acceleration) for angle in angles for acceleration in accelerations)
        assert fall(*chosen) <= least + 1e-9
        assert abs(chosen.heading) <= limits.heading
        assert -6.0 <= chosen.acceleration <= 4.0
        tried += 1
    assert tried > 100
