"""What gets through `ramps` with MOBIL from outside and SUMO's mandatory changes, against SUMO's own lane changing.

The same cars, drivers, streams and seeds in both; the robot keeps to its lane as one of IDM's drivers. So the
difference is who decides about the lanes of the scenario's own cars: SUMO changes those of the streams in both.
"""

import math

import libsumo
import numpy as np
import pytest

from hj_cosim.settings import RobotSettings, Scenario
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sumo.fleet import Fleet
from hj_cosim.traffic.sumo.puppet import ROBOT
from hj_cosim.traffic.sumo.world import SumoWorld

STEP, SECONDS = 0.1, 120.0
SEEDS = range(1000, 1030)
STANDS = 10.0  # s, who has not moved for as long stands
SUMOS_OWN = 1621  # setLaneChangeMode's default: all of SUMO's own reasons


def busy(scenario: Scenario, times: float) -> Scenario:
    """Return a scenario with so many times the cars on its road and in its streams."""
    traffic = scenario.traffic.model_copy(update={"density": scenario.traffic.density * times})
    streams = tuple(stream.model_copy(update={"flow": stream.flow * times}) for stream in scenario.streams)
    return scenario.model_copy(update={"traffic": traffic, "streams": streams})


def got_through(scenario: Scenario, seed: int, patch: pytest.MonkeyPatch, *, is_sumos: bool) -> list[float]:
    """Return vehicle-km driven in two minutes, mean speed (m/s), ramps' cars on the road, and who stands at the end."""
    with patch.context() as patched:
        if is_sumos:
            patched.setattr(Fleet, "request_lane_changes", lambda *_: None)
        with SumoWorld(scenario, RobotSettings(), seed, STEP) as world:
            if is_sumos:
                for name in world.vehicle_names:
                    libsumo.vehicle.setLaneChangeMode(name, SUMOS_OWN)
            driven, present, merged = 0.0, 0, set()
            for _ in range(round(SECONDS)):
                world.settle(1.0)
                names = [name for name in libsumo.vehicle.getIDList() if name != ROBOT and "ghost" not in name]
                driven += math.fsum(libsumo.vehicle.getSpeed(name) for name in names)
                present += len(names)
                merged |= {
                    name
                    for name in names
                    if libsumo.vehicle.getRoute(name)[0].startswith("on_") and libsumo.vehicle.getRoadID(name)[0] == "m"
                }
            stands = sum(libsumo.vehicle.getWaitingTime(name) > STANDS for name in names)
    return [driven / 1000.0, driven / present, float(len(merged)), float(stands)]


@pytest.mark.parametrize("times", [1.0, 2.0])
def test_no_less_gets_through_ramps_than_with_sumos_own_lane_changing(times, monkeypatch):
    scenario = busy(load_scenario("ramps"), times)
    ours, sumos = (
        np.array([got_through(scenario, seed, monkeypatch, is_sumos=is_sumos) for seed in SEEDS])
        for is_sumos in (False, True)
    )
    random = np.random.default_rng(0)
    drawn = random.integers(len(SEEDS), size=(10_000, len(SEEDS)))
    print(f"\n{times:g} times the traffic of ramps, {len(SEEDS)} seeds: ours, SUMO's, difference with 95 % interval")
    for column, what in enumerate(("vehicle-km", "speed (m/s)", "merged from ramps", "stand at the end")):
        difference = ours[:, column] - sumos[:, column]
        low, high = np.quantile(difference[drawn].mean(axis=1), [0.025, 0.975])
        print(
            f"  {what:18s} {ours[:, column].mean():8.2f} {sumos[:, column].mean():8.2f}"
            f" {difference.mean():+7.2f} [{low:+.2f}, {high:+.2f}]"
        )
    assert ours[:, 0].mean() > 0.98 * sumos[:, 0].mean()
    assert ours[:, 2].mean() > 0.98 * sumos[:, 2].mean()
