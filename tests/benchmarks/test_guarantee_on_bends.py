"""What of the guarantee is left on bends: both cars in the world, the filter in the road frame, as everywhere.

Each preset with its own table, robot and filter. Collisions are counted twice: as the road frame has the bodies, and as
they lie in the world. An S turns from one side to the other by clothoids.
"""

import dataclasses
import math

import pytest

from hj_cosim.reachability.table.store import load_table
from hj_cosim.settings import robot_and_filter
from hj_cosim.verification.filter_games import world_pose
from hj_cosim.verification.guarantee import RolloutSettings, measure_guarantee

STRAIGHT = RolloutSettings(rollouts=4000, seed=1000)
ROADS = {
    "straight": STRAIGHT,
    "R 1000 m": dataclasses.replace(STRAIGHT, curvature=1.0 / 1000.0),
    "R 500 m": dataclasses.replace(STRAIGHT, curvature=1.0 / 500.0),
    "R 300 m": dataclasses.replace(STRAIGHT, curvature=1.0 / 300.0),
    "S of 500 m in 300 m": dataclasses.replace(STRAIGHT, curvature=1.0 / 500.0, half_wave=300.0),
    "S of 300 m in 200 m": dataclasses.replace(STRAIGHT, curvature=1.0 / 300.0, half_wave=200.0),
}


@pytest.mark.parametrize(("specification", "preset"), [("highway", "best"), ("highway_paper", "paper")])
def test_the_guarantee_on_bends(specification, preset):
    table = load_table(specification)
    robot, spc = robot_and_filter(preset)
    reports = {}
    for keeps in (True, False) if table.game.manoeuvres is not None else (False,):
        filter_settings = spc.model_copy(update={"keep_escape": keeps})
        for road, games in ROADS.items():
            name = road + (", with the escape" if keeps else "")
            reports[name] = measure_guarantee(table, games, filter_settings, robot)
    print(f"\n{specification}, {STRAIGHT.rollouts} games: entered %; collided: road frame, world; fall of V")
    for name, report in reports.items():
        print(
            f"{name:36s}{report.entered_percent:8.2f}{report.collided:7d}{report.collided_in_world:7d}"
            f"   median {report.fall_median:.2f}, 99 % {report.fall_p99:.2f}, 99.9 % {report.fall_p999:.2f} m,"
            f" no escape {report.without_escape}, rows unmet {report.unmet_percent:.1f} %"
        )
    assert all(report.rollouts == STRAIGHT.rollouts for report in reports.values())


def test_how_far_the_straightened_road_is_from_the_world():
    """Who keeps distance `ahead` in the road frame, a lane aside: how much nearer the centres are in the world."""
    print("\nnearer in the world by (m), lateral offset of the world beside the road frame (m), turned by (rad)")
    for radius in (300.0, 500.0, 1000.0):
        for ahead in (5.0, 10.0, 20.0, 50.0, 100.0):
            x, y, heading = world_pose(1.0 / radius, ahead, 8.0, 8.0, 0.0)
            print(f"R {radius:5.0f} m, {ahead:4.0f} m ahead: {ahead - math.hypot(x, y):6.2f} {y:6.2f} {heading:6.3f}")
            assert y == pytest.approx(0.5 * ahead**2 / radius, rel=0.06)
