"""A user's simulation with our drivers in it: IDM to rounding, MOBIL near the robot, their bodies and speeds."""

import math
from collections.abc import Iterator

import libsumo
import numpy as np
import pytest
from own_configurations import content, simulation

from hj_cosim.settings import DriverSettings, OwnSimulationSettings, RobotSettings, Scenario
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sumo.our_drivers import AS_SUMO_HAS_THEM, TYPE
from hj_cosim.traffic.sumo.own_world import OwnWorld
from hj_cosim.traffic.sumo.puppet import ROBOT, is_ghost

STEP, TRAFFIC_STEP = 0.02, 0.1
MOBIL_MODE = 257  # SUMO's strategic changes, and requests that are safe


def open_ours(configuration, traffic: str = "idm-mobil", seed: int = 0, **own: object) -> OwnWorld:
    settings = OwnSimulationSettings(file=str(configuration), warm_up=30.0, traffic=traffic, **own)
    return OwnWorld(Scenario(name="mine", own=settings), RobotSettings(), seed, STEP, TRAFFIC_STEP)


def drive(world: OwnWorld, steps: int, desired_speed: float = 18.0) -> Iterator[None]:
    driver = robot_driver(DriverSettings(), desired_speed)
    for _ in range(steps):
        world.step(*follow_lane(world.observe(), driver, world.road, 5.0, STEP))
        yield


def others() -> list[str]:
    return [name for name in libsumo.vehicle.getIDList() if name != ROBOT and not is_ghost(name)]


def idm_acceleration(name: str) -> float | None:
    """Return what IDM (Treiber et al. 2000) does in SUMO's present state; None where that is not all."""
    vehicle = libsumo.vehicle
    speed, edge = vehicle.getSpeed(name), vehicle.getRoadID(name)
    desired = min(vehicle.getMaxSpeed(name), vehicle.getAllowedSpeed(name))
    most, comfortable = vehicle.getAccel(name), vehicle.getDecel(name)
    leader, gap_less = vehicle.getLeader(name, 0.0) or ("", 0.0)
    is_alone = vehicle.getLateralLanePosition(name) == 0.0 and leader not in ("", ROBOT)
    if not is_alone or vehicle.getLateralLanePosition(leader) or {edge, vehicle.getRoadID(leader)} != {"e0"}:
        return None
    standstill, headway = vehicle.getMinGap(name), vehicle.getTau(name)
    closing = speed * (speed - vehicle.getSpeed(leader)) / (2.0 * math.sqrt(most * comfortable))
    wanted = standstill + max(speed * headway + closing, 0.0)
    return most * (1.0 - (speed / desired) ** 4 - (wanted / (gap_less + standstill)) ** 2)


def test_everybody_drives_as_idm_says_and_keeps_their_body_and_top_speed(tmp_path):
    with open_ours(simulation(tmp_path, lengths=(1500.0, 300.0))) as world:
        checked = unlike = 0
        expected: dict[str, tuple[float, float]] = {}
        for step, _ in enumerate(drive(world, 400)):
            if step % 5 == 4:  # SUMO steps next, from the states that it has now
                for name in others():
                    lorry = name.startswith("lorries")
                    assert libsumo.vehicle.getTypeID(name).startswith(TYPE)
                    assert libsumo.vehicle.getLength(name) == (14.0 if lorry else 4.5)
                    assert libsumo.vehicle.getWidth(name) == (2.5 if lorry else 1.8)
                    assert libsumo.vehicle.getMaxSpeed(name) == (23.0 if lorry else 33.0)
                    assert libsumo.vehicle.getVehicleClass(name) == ("truck" if lorry else "passenger")
                accelerations = {name: idm_acceleration(name) for name in others()}
                expected = {
                    name: (libsumo.vehicle.getSpeed(name), acceleration)
                    for name, acceleration in accelerations.items()
                    if acceleration is not None
                }
            elif step % 5 == 0:
                for name in expected.keys() & set(others()):
                    speed, acceleration = expected[name]
                    if libsumo.vehicle.getLateralLanePosition(name) == 0.0 and libsumo.vehicle.getRoadID(name) == "e0":
                        change = (libsumo.vehicle.getSpeed(name) - speed) / TRAFFIC_STEP
                        unlike += abs(change - acceleration) > 1e-9
                        checked += 1
        assert checked > 300
        # A lorry yields to who is beside it for a while, in the middle of whose lane change the state was saved.
        assert unlike < 0.03 * checked


def test_drivers_differ_and_are_drawn_again_by_another_seed(tmp_path):
    headways = []
    for seed in (1, 1, 2):
        with open_ours(simulation(tmp_path), seed=seed, ego="cars.4", begin=30.0) as world:
            headways.append({name: libsumo.vehicle.getTau(name) for name in others()})
            known = world.drivers[: len(world.vehicle_names)]
            assert np.isfinite(known).all()
    assert headways[0] == headways[1]
    assert len(set(headways[0].values())) > 5
    assert abs(np.mean(list(headways[0].values())) - 1.5) < 0.15
    assert headways[0] != headways[2]


def test_those_near_change_lanes_by_mobil_and_the_others_as_sumo_has_them(tmp_path):
    with open_ours(simulation(tmp_path, lengths=(1500.0, 300.0)), near=150.0) as world:
        asked = []
        change = libsumo.vehicle.changeLane
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(libsumo.vehicle, "changeLane", lambda *a: (asked.append(a), change(*a)))
            changed = set()
            for _ in drive(world, 2000, 15.0):
                near = {world.vehicle_names[number] for number in world.observe().vehicle}
                seen = world.observe()
                changed |= {world.vehicle_names[n] for n in seen.vehicle[seen.target_lane != seen.lane]}
        modes = {name: libsumo.vehicle.getLaneChangeMode(name) for name in others()}
        assert {modes[name] for name in near if name in modes} == {MOBIL_MODE}
        distance = {
            name: abs(libsumo.vehicle.getLanePosition(name) - libsumo.vehicle.getLanePosition(ROBOT)) for name in modes
        }
        far = [name for name in modes if distance[name] > 200.0 and libsumo.vehicle.getRoadID(name) == "e0"]
        assert far
        assert {modes[name] for name in far} == {AS_SUMO_HAS_THEM}
        assert asked
        assert {name for name, *_ in asked} & changed
        assert all(seconds == TRAFFIC_STEP for _, _, seconds in asked)


def test_theirs_stay_theirs_unless_it_is_asked_for(tmp_path):
    with open_ours(simulation(tmp_path), "theirs") as world:
        list(drive(world, 50))
        assert {libsumo.vehicle.getTypeID(name).split("@")[0] for name in others()} <= {"car", "lorry"}
        assert np.isnan(world.drivers).all()
        assert "IDM and MOBIL:" not in world.told


def test_their_files_stay_untouched_and_what_was_done_is_told(tmp_path):
    configuration = simulation(tmp_path / "theirs")
    before = content(tmp_path / "theirs")
    with open_ours(configuration) as world:
        list(drive(world, 20))
        assert "their drivers -> IDM and MOBIL" in world.told
    assert content(tmp_path / "theirs") == before
