"""A million draws of extreme scenes, states and controls: every answer finite and within the limits.

Half of them go to the filters (SPC and RSS, each MI and SW, and none), the others to the look-up and to the bicycle
with its tracking controller. Prints what became of them: nothing here depends on time.
"""

import math
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.control.tracking import tracking_control
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings, RobotSettings, TrackingSettings
from hj_cosim.vehicles.bicycle import SLOWEST_FULL_TURN, bicycle_step, steering_for

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "control"))

from extreme_scenes import ABSURD, HEADINGS, NOT_FINITE, SPEEDS, draw_desired, draw_scene
from filter_in_loop import FilterInLoop

FILTER_DRAWS, LOOK_UP_DRAWS, BICYCLE_DRAWS = 500_000, 250_000, 250_000
STACKS = [("spc", "mi"), ("spc", "sw"), ("rss", "mi"), ("rss", "sw"), ("none", "mi")]
STEP = 0.02
ROBOT = RobotSettings()


@pytest.fixture(scope="module")
def table() -> ValueTable:
    return load_table("highway")


def is_within_limits(control: Control) -> bool:
    """Return whether a control is finite and the robot may take it; a comparison with NaN is false."""
    return (
        abs(control.omega) <= ROBOT.omega_max
        and ROBOT.acceleration_min <= control.acceleration <= ROBOT.acceleration_max
    )


@pytest.mark.parametrize(("kind", "scheme"), STACKS)
def test_every_control_of_a_filter_is_finite_and_within_the_limits(table: ValueTable, kind: str, scheme: str) -> None:
    draw = np.random.default_rng([STACKS.index((kind, scheme)), 9])
    safety_filter = FilterInLoop(FilterSettings(kind=kind, scheme=scheme), table)
    counts: Counter[str] = Counter()
    for _ in range(FILTER_DRAWS // len(STACKS)):
        scene = draw_scene(draw)
        result = safety_filter.filter(scene, draw_desired(draw))
        counts["draws"] += 1
        counts["of them with 500 cars"] += len(scene.x) == 500
        counts["without a car"] += len(scene.x) == 0
        counts["intervening"] += result.constrained
        counts["outside the limits or not finite"] += not is_within_limits(result.control)
        counts["slack not finite"] += not math.isfinite(result.slack + getattr(result, "least_slack", 0.0))
    print(f"\n{kind} {scheme}: {dict(counts)}; counted by the filter: {dict(safety_filter.counts)}")
    assert counts["outside the limits or not finite"] == 0
    assert counts["slack not finite"] == 0
    if kind != "none":
        assert counts["intervening"] > 1000


def test_every_value_is_finite_within_the_grid_and_unknown_where_the_state_is(table: ValueTable) -> None:
    draw = np.random.default_rng(10)
    corners = [*table.grid.lower, *table.grid.upper, 0.0, -0.0, 5e-324, 1e-300, *ABSURD, *NOT_FINITE]
    states = draw.uniform(-1.2, 1.2, (LOOK_UP_DRAWS, 5)) * table.grid.upper
    special = draw.random(states.shape) < 0.4
    states[special] = draw.choice(corners, np.count_nonzero(special))
    with np.errstate(invalid="ignore"):  # what is no angle is refused in a sentence, as the tests of states know
        states[:, 2] = np.where(np.isfinite(states[:, 2]), np.clip(states[:, 2], -np.pi, np.pi), states[:, 2])
    values, gradients = table.value_and_gradient(states)
    finite = np.isfinite(states).all(axis=1)
    clamped = states.copy()  # heading and speeds are taken for the grid's last ones
    clamped[:, 2:] = np.clip(states[:, 2:], table.grid.lower[2:], table.grid.upper[2:])
    within = finite & table.in_grid(clamped)
    print(f"\nlook-up: {len(states)} draws, {within.sum()} within the grid, {(~finite).sum()} not finite")
    assert within.sum() > 10_000
    assert np.isfinite(values[within]).all()
    assert np.isfinite(gradients[within]).all()
    # Beside the grid it is V(0, ·); along the road, and a million metres aside, a car is safe.
    abreast = clamped.copy()
    abreast[:, 1] = 0.0
    beyond = finite & ~table.in_grid(abreast)
    beside = finite & ~within & ~beyond & (np.abs(states[:, 1]) <= 1e6)
    far = beyond | (finite & (np.abs(states[:, 1]) > 1e6))
    assert np.isfinite(values[beside]).all()
    assert np.isfinite(gradients[beside]).all()
    assert (values[far] == np.inf).all()
    assert (gradients[far] == 0.0).all()
    assert np.isnan(values[~finite]).all()


def test_every_state_of_the_bicycle_is_finite_and_turns_no_faster_than_it_may() -> None:
    draw = np.random.default_rng(11)
    road, gains = StraightRoad(lane_count=4), TrackingSettings()
    fastest_turn, fastest_change = 0.0, 0.0
    for _ in range(BICYCLE_DRAWS):
        heading = draw.choice(HEADINGS) if draw.random() < 0.5 else draw.uniform(-7.0, 7.0)
        speed = draw.choice(SPEEDS) if draw.random() < 0.5 else draw.uniform(0.0, 40.0)
        state = np.array([draw.uniform(-1e5, 1e5), draw.uniform(-50.0, 50.0), heading, speed])
        wanted = draw.choice(ABSURD[2:]) if draw.random() < 0.1 else draw.uniform(0.0, 60.0)
        control = tracking_control(state, Target(int(draw.integers(0, 4)), float(wanted)), road, gains, ROBOT)
        assert is_within_limits(control)
        if draw.random() < 0.5:  # as a filter may leave it
            control = Control(
                float(draw.choice([-1.0, 1.0])) * ROBOT.omega_max,
                float(draw.choice([ROBOT.acceleration_min, 0.0, 1e-300, ROBOT.acceleration_max])),
            )
        steering = steering_for(control.omega, float(speed), ROBOT.wheelbase)
        reached = bicycle_step(state, steering, control.acceleration, ROBOT.wheelbase, ROBOT.speed_max, STEP)
        assert np.isfinite(reached).all()
        assert 0.0 <= reached[3] <= ROBOT.speed_max
        fastest_turn = max(fastest_turn, abs(reached[2] - heading) / STEP)
        if 0.0 <= speed <= ROBOT.speed_max:
            fastest_change = max(fastest_change, abs(reached[3] - speed) / STEP)
    print(f"\nbicycle: {BICYCLE_DRAWS} draws, fastest turn {fastest_turn:.4f} rad/s, change {fastest_change:.4f} m/s²")
    # Steering is chosen for the speed at the beginning of a step in which the car gets faster.
    assert fastest_turn <= ROBOT.omega_max * (1.0 + 0.5 * ROBOT.acceleration_max * STEP / SLOWEST_FULL_TURN) + 1e-9
    assert fastest_change <= -ROBOT.acceleration_min + 1e-9
