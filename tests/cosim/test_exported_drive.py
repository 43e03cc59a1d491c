"""A drive in SUMO in which the robot straddles two lanes: what its files hold, and that SUMO replays them."""

from pathlib import Path

import libsumo
import numpy as np
import pandas as pd
import pytest
import sumolib.xml

from hj_cosim.analysis.export import export_files, export_run
from hj_cosim.control.catalogue import make_filter
from hj_cosim.cosim.configuration import config_toml, resolve_config
from hj_cosim.cosim.episode import drive
from hj_cosim.locations import scenarios_folder
from hj_cosim.planning.contract import LEFT, Plan
from hj_cosim.recording.run_folder import write_run
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.traffic.sumo.puppet import GHOST
from hj_cosim.traffic.sumo.world import SumoWorld

SAMPLES = 120


class GoLeft:
    def plan(self, observation: Observation, previous: Target) -> Plan:
        return Plan(LEFT, Target(lane=2, speed=previous.speed))


class WatchedWorld(SumoWorld):
    """Counts the steps for which the ghost was in SUMO."""

    ghostly_steps = 0

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        super().step(robot_state, robot_acceleration)
        self.ghostly_steps += GHOST in libsumo.vehicle.getIDList()


@pytest.fixture(scope="module")
def straddling_run(small_table, tmp_path_factory) -> Path:
    config = resolve_config("light", assignments=["filter.kind=none", f"simulation.duration={SAMPLES * 0.02}"])
    with WatchedWorld(config.scenario, config.robot, seed=3) as world:
        safety_filter = make_filter(config.filter, config.robot, world.road, small_table, 0.02)
        record = drive(world, GoLeft(), safety_filter, small_table, config).record
        assert world.ghostly_steps > 20
    folder = tmp_path_factory.mktemp("runs") / "run"
    write_run(folder, record, config_toml(config), {}, world.drivers)
    return folder


def everybody() -> set[str]:
    return {"robot"} | {f"car_{number:02}" for number in range(100)}


@pytest.mark.parametrize("format", ["parquet", "csv", "fcd"])
def test_every_file_holds_the_robot_and_the_cars_at_every_step_and_no_ghost(straddling_run, format):
    path = export_run(straddling_run, format)
    if format == "fcd":
        seen = {
            (round(float(step.time) / 0.02), car.id)
            for step in sumolib.xml.parse(str(path), "timestep")
            for car in step.vehicle
        }
    else:
        rows = pd.read_csv(path) if format == "csv" else pd.read_parquet(path)
        seen = set(zip(np.rint(rows.time / 0.02).astype(int), rows.vehicle, strict=True))
    assert seen == {(step, name) for step in range(SAMPLES) for name in everybody()}
    assert "ghost" not in path.read_bytes().decode(errors="ignore")


def test_the_drivers_file_has_everybodys_parameters(straddling_run):
    drivers = pd.read_parquet(straddling_run / "drivers.parquet")
    assert set(drivers.vehicle) == everybody() - {"robot"}
    assert drivers.desired_speed.std() > 0.5


def test_sumo_replays_the_floating_car_data(straddling_run):
    """SUMO shows everybody where the file has them, some of them one of its steps later."""
    path, types = export_files(straddling_run, "fcd", straddling_run / "replayed.xml")
    rows = pd.read_parquet(straddling_run / "trajectories.parquet").sort_values(["vehicle", "time"])
    network = scenarios_folder() / "four_lanes.net.xml"
    options = ["--step-length", "0.02", "--no-step-log", "--no-warnings", "--additional-files", str(types)]
    options += ["--device.fcd-replay.file", str(path)]
    names = sorted(everybody())
    shown = np.full((len(names), SAMPLES, 2), np.nan)
    libsumo.start(["sumo", "--net-file", str(network), *options])
    try:
        for step in range(SAMPLES):
            libsumo.simulationStep()
            if step >= 2:
                shown[:, step] = [libsumo.vehicle.getPosition(name) for name in names]
        assert [name for name in names if libsumo.vehicle.getTypeID(name) == "robot"] == ["robot"]
        assert libsumo.vehicle.getWidth("robot") == 2.0
    finally:
        libsumo.close()
    for name, places in zip(names, shown, strict=True):
        car = rows[rows.vehicle == name]
        front_x = (car.x + 2.5 * np.cos(car.heading)).to_numpy()
        front_y = (car.y + 2.5 * np.sin(car.heading)).to_numpy()
        front = np.column_stack([front_x, front_y])
        late = [np.abs(places[2:] - front[2 - lag : SAMPLES - lag]).max() for lag in (0, 1)]
        assert min(late) < 1e-3, name
