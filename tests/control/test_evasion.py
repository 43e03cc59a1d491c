"""The last resort: it acts only when nothing else is left, keeps bodies apart, and in doubt never costs an escape."""

import dataclasses
import math

import numpy as np
import pytest
from filter_in_loop import ROAD, FilterInLoop

from hj_cosim.control.spc.duty_breakers import Seen, write_car
from hj_cosim.control.spc.escape import manoeuvres_for
from hj_cosim.control.spc.evasion import (
    ANSWERED,
    CAUGHT,
    COLUMNS,
    EVADED,
    HALF_ACROSS,
    HORIZON,
    NO_SHIFT,
    PASSED,
    PURSUES,
    Evader,
    Held,
    Motion,
    Shift,
    evade,
    outcome,
)
from hj_cosim.control.spc.filter import ESCAPED, HAD_NO_ESCAPE, WAS_CAUGHT, WAS_EVADED
from hj_cosim.control.spc.kept_escape import KeptEscape
from hj_cosim.control.spc.last_resort import LastResort
from hj_cosim.control.spc.pursuit import TURN_RATE, Abilities, Pursuer, Target, pursued
from hj_cosim.metrics.rectangles import rectangles_overlap
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, robot_and_filter

ROBOT, BEST = robot_and_filter("best")
STEP = 0.02
CAN = Abilities(0.1, -6.0, 4.0)
ON_ROAD = Evader.of(ROBOT, -0.7, 12.7)  # four lanes of 4 m
WALLED_IN = Evader.of(ROBOT, 4.0, 4.0)
AT = Motion(0.0, 4.0, 0.0, 20.0)
ALONE = FilterSettings(**{**BEST.model_dump(), "evade": False})


def rows(*cars, breaks=True, evader=ON_ROAD, robot=AT):
    """Return the cars, each (x, y, heading, speed, acceleration), all of whom break a duty or none."""
    found = np.empty((len(cars), COLUMNS))
    seen = [Seen(*map(float, car), 5.0, 2.0) for car in cars]
    kept = [write_car(evader, robot, each, breaks, CAN, row) for each, row in zip(seen, found, strict=True)]
    return found[kept]


def evaded(cars, evader=ON_ROAD, asked=(0.0, 0.0), driven=NO_SHIFT, robot=AT):
    return evade(evader, robot, cars, Held(*asked, STEP), driven)


def steering_in(ahead, aside):
    """Return a car on the left that steers at the robot's side."""
    return (ahead, 4.0 + aside, -0.1, 20.0, 0.0)


def driven_apart(car, seconds=4.0):
    """Return whether a robot that evades in every step stays apart from a car that goes on, by millisecond."""
    robot, shift, place = AT, NO_SHIFT, np.array(car, float)
    for step in range(round(seconds / 1e-3)):
        if step % 20 == 0:
            seen = rows(tuple(place), robot=robot)
            control, _, shift = evaded(seen, driven=shift, robot=robot) if len(seen) else (Held(0, 0, 0), 0, NO_SHIFT)
        x, y, heading, speed = robot
        speed = min(max(speed + control.acceleration * 1e-3, 0.0), ROBOT.speed_max)
        heading += control.omega * 1e-3
        robot = Motion(x + speed * math.cos(heading) * 1e-3, y + speed * math.sin(heading) * 1e-3, heading, speed)
        place[0] += place[3] * 1e-3
        place[1] = place[1] + place[3] * math.sin(place[2]) * 1e-3
        if rectangles_overlap(place[0] - robot.x, place[1] - robot.y, heading, 5.0, 2.0, place[2], 5.0, 2.0):
            return False
    return True


@pytest.mark.parametrize("car", [steering_in(0.0, 3.4), steering_in(2.0, 3.0), (-14.0, 4.0, 0.0, 28.0, 0.0)])
def test_in_a_fine_simulation_the_bodies_stay_apart(car):
    assert not rows(car)[0, ANSWERED]  # the robot does not answer for it
    assert driven_apart(car)


def test_as_long_as_something_else_is_left_the_control_passes():
    verdicts = [evaded(rows(steering_in(0.0, aside)))[1] for aside in np.arange(7.0, 2.3, -0.1)]
    assert verdicts[0] == PASSED
    first = verdicts.index(EVADED)
    assert 10 < first < len(verdicts) - 3
    control, _, shift = evaded(rows(steering_in(0.0, 3.0)), asked=(0.1, 1.0))
    assert (control.omega, control.acceleration) != (0.1, 1.0)
    assert not math.isnan(shift.lateral)
    control, verdict, shift = evaded(rows(steering_in(0.0, 7.0)), asked=(0.1, 1.0))
    assert (control, verdict) == (Held(0.1, 1.0, STEP), PASSED)
    assert math.isnan(shift.lateral)


def test_what_passes_leaves_a_manoeuvre_that_no_body_meets():
    cars = rows(steering_in(0.0, 5.0), (30.0, 0.0, 0.0, 15.0, 0.0), (-15.0, 8.0, 0.0, 20.0, 0.0))
    asked = Held(0.0, 0.0, STEP)
    assert evaded(cars)[1] == PASSED
    best = max(
        outcome(ON_ROAD, AT, asked, Shift(lateral, gain), cars, -1.0)
        for lateral in np.arange(-0.7, 12.8, 0.1)
        for gain in (-6.0, -3.0, 0.0, 2.0, 4.0)
    )
    assert best > 2.0 * HORIZON


def test_it_turns_away_where_there_is_a_lane_and_brakes_or_gains_where_there_is_none():
    free, _, _ = evaded(rows(steering_in(0.0, 3.2)))
    assert free.omega < 0.0
    between, _, _ = evaded(rows(steering_in(0.0, 3.2), evader=WALLED_IN), evader=WALLED_IN)
    assert between.omega == pytest.approx(0.0, abs=1e-9)
    assert abs(between.acceleration) >= 3.0


def test_nowhere_to_go_is_said_and_the_longest_is_driven():
    boxed = rows(steering_in(0.0, 2.6), (0.0, 1.4, 0.1, 20.0, 0.0))
    _, verdict, shift = evaded(boxed)
    assert verdict == CAUGHT
    at_once = Held(0.0, 0.0, 0.0)
    most = outcome(ON_ROAD, AT, at_once, shift, boxed, -1.0)
    for lateral in (0.4, 2.0, 4.0, 6.0):
        assert outcome(ON_ROAD, AT, at_once, Shift(lateral, 0.0), boxed, -1.0) <= most


def test_it_would_rather_be_run_into_than_run_into_somebody():
    ahead, chaser = (14.0, 4.0, 0.0, 14.0, -6.0), (-9.0, 4.0, 0.0, 26.0, 0.0)
    both = np.vstack([rows(ahead, breaks=False), rows(chaser)])
    control, verdict, _ = evaded(both, evader=WALLED_IN)
    assert verdict == CAUGHT
    assert control.acceleration == ROBOT.acceleration_min
    fleeing, _, _ = evaded(rows(chaser), evader=WALLED_IN)
    assert fleeing.acceleration > 0.0


def test_behind_who_is_ahead_room_to_brake_is_left():
    at_once, straight = Held(0.0, 0.0, 0.0), Shift(4.0, 0.0)
    # As fast as the robot; 20² − 15² over 2 · 6 m/s² is 14.6 m, where it brakes and 5 m/s remain of 3 s at 15 m/s.
    for gap, reaches in ((15.0, False), (31.0, True)):
        found = outcome(ON_ROAD, AT, at_once, straight, rows((gap + 5.0, 4.0, 0.0, 15.0, 0.0), breaks=False), -1.0)
        assert (found > HORIZON) is reaches
    assert outcome(ON_ROAD, AT, at_once, straight, rows((20.0, 4.0, 0.0, 20.0, 0.0), breaks=False), -1.0) > HORIZON


def test_a_manoeuvre_is_kept_unless_another_is_clearly_better():
    cars = rows(steering_in(0.0, 3.2))
    _, verdict, best = evaded(cars)
    assert verdict == EVADED
    at_once = Held(0.0, 0.0, 0.0)
    most = outcome(ON_ROAD, AT, at_once, best, cars, -1.0)
    nearly, worse = (Shift(best.lateral + aside, best.acceleration) for aside in (1.0, 3.0))
    assert most - 0.3 < outcome(ON_ROAD, AT, at_once, nearly, cars, -1.0) < most
    assert evaded(cars, driven=nearly)[2] == nearly
    assert outcome(ON_ROAD, AT, at_once, worse, cars, -1.0) < most - 0.5
    assert evaded(cars, driven=worse)[2] == best


def test_who_drives_a_manoeuvre_that_somebody_meets_gives_it_up_for_one_that_nobody_meets():
    draw, at_once = np.random.default_rng(0), Held(0.0, 0.0, 0.0)
    ways = [Shift(4.0 + aside, gain) for aside in (0, 1, -1, 2, -2, 3.6, -3.6) for gain in (-6.0, -3.0, 0.0, 2.0, 4.0)]
    hardly_met = given_up = 0
    for _ in range(4000):
        near, other = (
            draw.uniform([-25, 2.3, -0.1, 14, -3], [15, 6, 0.1, 30, 3]),
            draw.uniform([-25, 0, -0.1, 14, -3], [15, 12, 0.1, 30, 3]),
        )
        near[1] = 4.0 + draw.choice([-1.0, 1.0]) * near[1]
        cars, driven = rows(near, other), ways[draw.integers(25)]
        _, verdict, chosen = evaded(cars, driven=driven)
        if verdict == PASSED:
            continue
        before, ends = (outcome(ON_ROAD, AT, at_once, shift, cars, -1.0) for shift in (driven, chosen))
        assert (verdict == EVADED) is (ends > 2.0 * HORIZON)
        if 2.0 * HORIZON - 0.35 < before <= 2.0 * HORIZON:  # driven, it may be as much worse than another
            hardly_met += 1
            another_is_free = any(outcome(ON_ROAD, AT, at_once, way, cars, -1.0) > 2.0 * HORIZON for way in ways)
            assert verdict == EVADED or not another_is_free
            given_up += another_is_free
    assert hardly_met > given_up > 0


def test_no_shift_leads_beyond_the_road():
    at_edge = AT._replace(y=0.0)
    for aside in np.arange(2.3, 3.5, 0.1):
        _, _, shift = evaded(rows((0.0, aside, -0.1, 20.0, 0.0), robot=at_edge), robot=at_edge)
        assert math.isnan(shift.lateral) or ON_ROAD.lowest <= shift.lateral <= ON_ROAD.highest


def test_who_follows_and_does_its_duty_is_left_out_and_who_touches_already_is():
    assert len(rows((-8.0, 4.0, 0.0, 20.0, 0.0), breaks=False)) == 0
    assert len(rows((-8.0, 4.0, 0.0, 20.0, 0.0))) == 1
    assert len(rows((-8.0, 8.0, 0.0, 20.0, 0.0), breaks=False)) == 1
    assert len(rows((3.0, 4.5, 0.0, 20.0, 0.0))) == 0


def test_a_turned_body_is_wider():
    straight, turned = rows((0.0, 8.0, 0.0, 20.0, 0.0)), rows((0.0, 8.0, 0.1, 20.0, 0.0))
    assert turned[0, HALF_ACROSS] - straight[0, HALF_ACROSS] == pytest.approx(
        2.5 * math.sin(0.1) - (1.0 - math.cos(0.1)), abs=1e-9
    )


@pytest.fixture(scope="module")
def duties(table):
    """A table whose V is V(0, ·), among cars that do their duties."""
    specification = table.specification.model_copy(update={"parameters": {"responsible": 1.0}})
    return dataclasses.replace(table, specification=specification)


def test_the_filter_gives_way_only_where_a_duty_is_broken(duties, observe):
    steering, straight = (observe([0.0, 4.0, 0.0, 20.0], [[0.0, 7.2, heading, 20.0]]) for heading in (-0.1, 0.0))
    evading, alone = FilterInLoop(BEST, duties, ROBOT), FilterInLoop(ALONE, duties, ROBOT)
    assert evading.filter(straight, Control(0.0, 0.0)).control == alone.filter(straight, Control(0.0, 0.0)).control
    assert not evading.counts[WAS_EVADED] + evading.counts[WAS_CAUGHT]
    assert evading.filter(steering, Control(0.0, 0.0)).control.omega < 0.0
    assert alone.filter(steering, Control(0.0, 0.0)).control.omega == 0.0
    assert evading.counts[WAS_EVADED] + evading.counts[WAS_CAUGHT] == 1
    assert not alone.counts[WAS_EVADED] + alone.counts[WAS_CAUGHT]


def test_it_counts_where_nothing_helps(duties, observe):
    boxed = observe([0.0, 4.0, 0.0, 20.0], [[0.0, 6.5, -0.1, 20.0], [0.0, 1.5, 0.1, 20.0], [7.0, 4.0, 0.0, 20.0]])
    evading = FilterInLoop(BEST, duties, ROBOT)
    evading.filter(boxed, Control(0.0, 0.0))
    assert evading.counts[WAS_CAUGHT] == 1


def test_in_doubt_no_evasion_costs_an_escape(duties, observe):
    draw, escape = np.random.default_rng(6), KeptEscape(duties, ROBOT, BEST.epsilon, STEP)
    evaded_to, would_cost = 0, 0
    for _ in range(2000):
        cars = [[draw.uniform(-9.0, 9.0), 4.0 + draw.uniform(3.0, 4.6), -0.1, draw.uniform(15.0, 25.0)]]
        cars += [[draw.uniform(-9.0, 9.0), 4.0 - draw.uniform(3.1, 3.8), 0.0, draw.uniform(15.0, 25.0)]]
        seen = observe([0.0, 4.0, draw.uniform(-0.1, 0.1), 20.0], cars)
        value, asked = car_values(duties, seen).value, Control(0.0, 0.0)
        evasion = LastResort(ROBOT, ROAD, escape.games, escape.numbers, STEP).evasion(seen, asked)
        if evasion is None or not evasion.is_in_doubt or not escape.leaves_one(seen, value, asked):
            continue
        would_cost += not escape.leaves_one(seen, value, evasion.control)
        decision = FilterInLoop(BEST, duties, ROBOT).filter(seen, asked)
        if decision.diagnostics.keys() & {WAS_EVADED, WAS_CAUGHT}:
            evaded_to += 1
            assert escape.leaves_one(seen, value, decision.control)
    assert evaded_to > 5
    assert would_cost > 5


def test_what_is_not_driven_is_neither_remembered_nor_counted(duties, observe, monkeypatch):
    draw, asked = np.random.default_rng(6), Control(0.0, 0.0)
    remembered = []
    for which in (KeptEscape, LastResort):
        monkeypatch.setattr(which, "forget", lambda self, forget=which.forget: remembered.append(forget(self) or self))
    refused = instead = 0
    for _ in range(500):
        cars = [[draw.uniform(-9.0, 9.0), 4.0 + draw.uniform(3.0, 4.6), -0.1, draw.uniform(15.0, 25.0)]]
        cars += [[draw.uniform(-9.0, 9.0), 4.0 - draw.uniform(3.1, 3.8), 0.0, draw.uniform(15.0, 25.0)]]
        seen = observe([0.0, 4.0, draw.uniform(-0.1, 0.1), 20.0], cars)
        remembered.clear()
        decision = FilterInLoop(BEST, duties, ROBOT).filter(seen, asked)
        evades = bool(decision.diagnostics.keys() & {WAS_EVADED, WAS_CAUGHT})
        assert not (evades and decision.diagnostics.keys() & {ESCAPED, HAD_NO_ESCAPE})
        assert [type(each) for each in remembered] in ([], [KeptEscape] if evades else [LastResort])
        assert not evades or remembered
        instead += evades
        refused += bool(remembered) and not evades
    assert instead > 5
    assert refused > 5


def test_a_manoeuvre_is_forgotten_when_nobody_breaks_a_duty_any_more(duties, observe):
    escape, asked = KeptEscape(duties, ROBOT, BEST.epsilon, STEP), Control(0.0, 0.0)
    scenes = [[[0.0, 7.2, -0.1, 20.0]], [[0.0, 7.2, 0.0, 20.0]], [[0.0, 7.4, -0.1, 20.0]]]
    remembering, fresh = (LastResort(ROBOT, ROAD, escape.games, escape.numbers, STEP) for _ in range(2))
    first, nobody, later = (remembering.evasion(observe([0.0, 4.0, 0.0, 20.0], cars), asked) for cars in scenes)
    assert first is not None
    assert nobody is None
    # Who drives a manoeuvre already wants more room than the one who begins one.
    assert later == fresh.evasion(observe([0.0, 4.0, 0.0, 20.0], scenes[2]), asked)
    remembering.evasion(observe([0.0, 4.0, 0.0, 20.0], scenes[0]), asked)
    assert remembering.evasion(observe([0.0, 4.0, 0.0, 20.0], scenes[2]), asked) != later


def test_where_nobody_has_duties_nobody_breaks_one(table, observe):
    assert not manoeuvres_for(table, ROBOT).game.other.responsible
    evading = FilterInLoop(BEST, table, ROBOT)
    evading.filter(observe([0.0, 4.0, 0.0, 20.0], [[1.0, 6.9, -0.1, 20.0]]), Control(0.0, 0.0))
    assert not evading.counts[WAS_EVADED] + evading.counts[WAS_CAUGHT]


def test_who_follows_too_closely_and_as_fast_keeps_nobody_from_slowing_down():
    tailgater = rows((-11.3, 4.0, 0.0, 20.0, 0.0), evader=WALLED_IN)
    assert evaded(tailgater, evader=WALLED_IN, asked=(0.0, -2.0))[1] == PASSED


def test_a_manoeuvre_gains_speed_for_a_second():
    # After it 24 m/s behind 20: of a gap of 35 m, 10 m are driven off in 3 s and 14.7 are needed to brake; with 32 m/s
    # there would be 17 and 52.
    ahead = rows((40.0, 4.0, 0.0, 20.0, 0.0), breaks=False)
    assert outcome(ON_ROAD, AT, Held(0.0, 0.0, 0.0), Shift(4.0, 4.0), ahead, -1.0) > 2.0 * HORIZON


def chased(car, seconds, robot=(30.0, 6.0, 20.0), can=CAN, gain=0.0, step=0.1):
    """Return where a pursuer comes to of a robot at x, y that drives on at a speed."""
    x, y, speed = robot
    for _ in range(round(seconds / step)):
        car = pursued(car, can, gain, Target(x - car.x, y - car.y, 5.0, speed), step)
        x += speed * step
    return car, x


def test_a_pursuer_comes_over_as_fast_as_its_car_can_and_keeps_level():
    after, _ = chased(Pursuer(0.0, 0.0, 0.0, 25.0), 1.0)
    # It turns to 0.1 rad in 1/3 s and has 2.5 m/s across from then on: 2.5 · (1 − 1/6) m.
    assert (after.heading, after.speed) == (pytest.approx(0.1), 25.0)
    assert after.y == pytest.approx(25.0 * 0.1 * (1.0 - 0.5 * 0.1 / TURN_RATE), rel=0.03)
    assert after.x == pytest.approx(25.0)
    level, x = chased(Pursuer(0.0, 0.0, 0.0, 25.0), 8.0)
    assert level.speed == pytest.approx(20.0)
    assert abs(x - level.x) < 5.0
    assert level.y == pytest.approx(6.0, abs=0.01)
    assert level.heading == pytest.approx(0.0, abs=0.01)


def test_a_pursuer_gains_as_it_does_now_within_what_its_car_can():
    start = Pursuer(0.0, 6.0, 0.0, 20.0)
    for gain, speed in ((2.0, 22.0), (9.0, 24.0), (-9.0, 14.0)):
        assert chased(start, 1.0, gain=gain)[0].speed == pytest.approx(speed)
    assert chased(start._replace(speed=2.0), 1.0, gain=-6.0)[0].speed == 0.0


def test_who_breaks_a_duty_is_feared_to_follow_and_who_does_them_is_not():
    # 11 m behind with 7 m/s more: who only goes on leaves room to step aside; who follows there has to be fled from.
    chaser = (-16.0, 4.0, 0.0, 27.0, 0.0)
    breaking = rows(chaser)
    assert breaking[0, PURSUES]
    going_on = breaking.copy()
    going_on[0, PURSUES] = 0.0
    assert evaded(going_on)[1] == PASSED
    _, verdict, shift = evaded(breaking)
    assert verdict != PASSED
    assert not math.isnan(shift.lateral)
    assert not rows((8.0, 8.0, 0.0, 20.0, 0.0), breaks=False)[0, PURSUES]


def test_a_pursuer_comes_nearer_while_a_control_is_held():
    # Of who goes on in the next lane nothing touches; straight on, held or not, is the same manoeuvre.
    chaser, straight = rows((-14.0, 8.0, 0.0, 27.0, 0.0)), Shift(4.0, 0.0)
    at_once, held = (outcome(ON_ROAD, AT, Held(0.0, 0.0, time), straight, chaser, -1.0) for time in (0.0, 0.1))
    assert HORIZON < at_once < 2.0 * HORIZON
    assert held == pytest.approx(at_once, abs=0.06)


def test_who_drifts_over_ahead_is_not_passed_so_near_that_nothing_is_left():
    drifting = (9.0, 1.2, 0.023, 22.0, 0.0)
    robot = AT._replace(speed=29.0)
    seen = rows(drifting, robot=robot)
    assert seen[0, ANSWERED]
    assert seen[0, PURSUES]
    _, verdict, _ = evaded(seen, robot=robot)
    assert verdict == EVADED
