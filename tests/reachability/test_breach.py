"""Who breaks a duty is seen; who does them, as the game lets him, is never said to break one beyond doubt."""

import math

import numpy as np
import pytest

from hj_cosim.reachability.games.highway.breach import BREAKS, DOES_DUTIES, WILL_BREAK, breach
from hj_cosim.reachability.games.highway.other_car import Disturbance, allowed

DUTIES = Disturbance(heading_max=0.1, acceleration_min=-6.0, acceleration_max=4.0, responsible=True)
STEP = 0.02


def seen(p_x, p_y, v_r=20.0, v_o=20.0, across=0.0, gain=0.0, leftwards=0.0, duties=DUTIES):
    """Return what is said of a car at 20 m/s beside a robot as fast; across in m/s to the left."""
    return breach(duties, p_x, p_y, leftwards, v_r, v_o, across / v_o, gain)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_steers_at_the_robots_side_will_break_a_duty_and_then_breaks_it(side):
    said = [seen(0.0, side * aside, across=side * 1.0) for aside in np.arange(4.5, 2.3, -0.1)]
    assert said == sorted(said)  # it only becomes worse
    assert set(said) == {DOES_DUTIES, WILL_BREAK, BREAKS}
    assert seen(0.0, side * 3.6, across=side * 1.0) == WILL_BREAK
    assert seen(0.0, side * 2.8, across=side * 1.0) == BREAKS


def test_who_is_beside_and_stays_there_or_goes_away_breaks_none():
    for aside in (2.2, 3.0, 4.0):
        assert seen(-1.0, aside) == DOES_DUTIES
        assert seen(-1.0, aside, across=-1.5) == DOES_DUTIES
        assert seen(-1.0, aside, across=0.25) == DOES_DUTIES  # as a driver sways in his lane


def test_a_slow_car_that_changes_lanes_where_no_duty_forbids_it_breaks_none():
    # 1.33 m/s across, a lane in 3 s, is more than the 0.1 rad that the table takes a car to turn.
    for speed in (4.0, 6.0, 10.0):
        away, far, ahead = ((0.0, -3.5, 1.33), (0.0, -8.0, -1.33), (-60.0, -4.0, -1.33))
        for p_x, p_y, across in (away, far, ahead):
            assert seen(p_x, p_y, v_r=speed, v_o=speed, across=across) == DOES_DUTIES
        assert seen(0.0, -2.6, v_r=speed, v_o=speed, across=-1.33) == BREAKS
        assert seen(0.0, -2.6, v_r=speed, v_o=speed, across=1.33) == DOES_DUTIES


def test_who_cuts_in_breaks_a_duty_only_where_there_is_no_room():
    assert seen(-12.0, 2.8, across=1.5) == BREAKS  # it is 7 m ahead of a robot as fast
    assert seen(-60.0, 2.8, across=1.5) == DOES_DUTIES


def test_who_follows_breaks_a_duty_where_it_is_too_near_and_does_not_brake():
    assert seen(60.0, 0.0) == DOES_DUTIES
    assert seen(9.0, 0.0, v_o=25.0, gain=0.0) == BREAKS
    assert seen(9.0, 0.0, v_o=25.0, gain=-6.0) == DOES_DUTIES
    assert seen(9.0, 4.0, gain=4.0) == DOES_DUTIES  # in the lane beside


def test_who_keeps_the_distance_that_drivers_do_breaks_no_duty():
    # A second behind as fast: RSS asks 38 m of it and 6 m/s² where there are 25; it need not brake to keep away.
    assert allowed(DUTIES, 25.0, 0.0, 0.0, 20.0, 20.0).most == pytest.approx(-6.0)
    assert seen(25.0, 0.0) == DOES_DUTIES
    assert seen(25.0, 0.0, gain=1.5) == DOES_DUTIES
    # 26² − 20² over 2 · 6 m/s² is 23 m, more than the 18 there are beside the 2 m that it leaves.
    assert seen(25.0, 0.0, v_o=26.0) == BREAKS
    assert seen(31.0, 0.0, v_o=26.0) == DOES_DUTIES
    # Lanes of 3.2 m: RSS has who is half a length behind there as one who follows.
    assert allowed(DUTIES, 1.5, 3.0, 0.0, 20.0, 20.0).most == pytest.approx(-6.0)
    assert seen(1.5, 3.0, v_o=22.0) == DOES_DUTIES


def test_who_has_no_duties_breaks_none():
    free = DUTIES._replace(responsible=False)
    assert seen(9.0, 0.0, gain=4.0, duties=free) == seen(0.0, 2.5, across=2.0, duties=free) == DOES_DUTIES


def test_who_did_what_the_game_allowed_a_step_ago_is_never_said_to_break_a_duty_beyond_doubt():
    draw, doubted, count = np.random.default_rng(5), 0, 200_000
    states = draw.uniform([-30.0, -4.5, 0.0, 0.0, -0.15], [30.0, 4.5, 30.0, 30.0, 0.15], (count, 5)).tolist()
    choices = draw.integers(2, size=(count, 2)).tolist()
    for (p_x, p_y, v_r, v_o, heading), (turns, gains) in zip(states, choices, strict=True):
        may = allowed(DUTIES, p_x, p_y, v_r * math.sin(heading), v_r, v_o)
        sine, gain = (may.right, may.left)[turns], (may.least, may.most)[gains]
        p_x += (v_r * math.cos(heading) - v_o * math.sqrt(1.0 - sine * sine)) * STEP
        p_y += (v_r * math.sin(heading) - v_o * sine) * STEP
        v_o = max(v_o + gain * STEP, 0.0)
        said = breach(DUTIES, p_x, p_y, v_r * math.sin(heading), v_r, v_o, sine, gain)
        assert said != BREAKS, (p_x, p_y, v_r, v_o, heading, sine, gain)
        doubted += said == WILL_BREAK
    assert doubted > 50  # such as move on to where they will have to stop at once
