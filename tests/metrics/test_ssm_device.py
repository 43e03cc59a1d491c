"""Our TTC and DRAC against SUMO's surrogate safety measures on the same drive."""

from pathlib import Path
from xml.etree import ElementTree

import libsumo
import numpy as np
import pytest

from hj_cosim.locations import scenarios_folder
from hj_cosim.metrics.driving import driving_metrics
from hj_cosim.metrics.threats import threat_track
from hj_cosim.recording.record import RobotTrack, RunRecord, TrafficTrack
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings

STEP, SAMPLES = 0.02, 500
ROUTES = """<routes>
    <vType id="car" carFollowModel="IDM" length="5" width="2" minGap="5" tau="1.5" accel="3" decel="5" maxSpeed="30"/>
    <route id="way" edges="highway"/>
    <vehicle id="lead" type="car" route="way" depart="0" departPos="180" departSpeed="12" departLane="0"/>
    <vehicle id="robot" type="car" route="way" depart="0" departPos="100" departSpeed="25" departLane="0"
             insertionChecks="none">
        <param key="has.ssm.device" value="true"/>
        <param key="device.ssm.measures" value="TTC DRAC"/>
        <param key="device.ssm.thresholds" value="50 0.01"/>
        <param key="device.ssm.range" value="150"/>
        <param key="device.ssm.trajectories" value="true"/>
        <param key="device.ssm.file" value="{ssm}"/>
    </vehicle>
</routes>
"""


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> tuple[RunRecord, Path]:
    """Return a drive in which the robot, driven by SUMO, closes in on a slower car, and the device's output."""
    folder = tmp_path_factory.mktemp("ssm")
    routes, ssm = folder / "routes.rou.xml", folder / "ssm.xml"
    routes.write_text(ROUTES.format(ssm=ssm))
    network = scenarios_folder() / "two_lanes.net.xml"
    options = ["-r", str(routes), "--step-length", str(STEP), "--no-step-log", "true", "--default.speeddev", "0"]
    libsumo.start(["sumo", "-n", str(network), *options])
    robot = RobotTrack.empty(SAMPLES)
    traffic = TrafficTrack.empty(("lead",), np.array([5.0]), np.array([2.0]), SAMPLES)
    time = np.zeros(SAMPLES)
    libsumo.simulationStep()
    libsumo.vehicle.setSpeed("lead", 12.0)
    for name in ("lead", "robot"):
        libsumo.vehicle.setLaneChangeMode(name, 0)
    for sample in range(SAMPLES):
        libsumo.simulationStep()
        time[sample] = libsumo.simulation.getTime() - STEP  # the device stamps a step with its beginning
        for track, name, place in ((robot, "robot", sample), (traffic, "lead", (sample, 0))):
            track.x[place] = libsumo.vehicle.getLanePosition(name) - 2.5
            track.speed[place] = libsumo.vehicle.getSpeed(name)
            track.acceleration[place] = libsumo.vehicle.getAcceleration(name)
        traffic.present[sample, 0] = True
    libsumo.close()
    return RunRecord(time, StraightRoad(2), 5.0, 2.0, traffic, robot, threat_track(robot, traffic, 5.0, 2.0)), ssm


def device_series(ssm: Path, measure: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and the values that the device wrote for a measure, where it has one."""
    conflict = ElementTree.parse(ssm).getroot().find("conflict")
    assert conflict is not None
    times = conflict.find("timeSpan").attrib["values"].split()
    values = conflict.find(f"{measure}Span").attrib["values"].split()
    known = [(float(time), float(value)) for time, value in zip(times, values, strict=True) if value != "NA"]
    series = np.array(known)
    return series[:, 0], series[:, 1]


def test_ttc_equals_the_device_s_within_a_percent(drive):
    record, ssm = drive
    times, expected = device_series(ssm, "TTC")
    ours = dict(zip(record.time.round(3), record.threats.ttc, strict=True))
    pairs = np.array(
        [(ours[time], value) for time, value in zip(times.round(3), expected, strict=True) if time in ours]
    )
    assert len(pairs) > 200
    assert pairs[:, 1].min() < 8.0
    np.testing.assert_allclose(pairs[:, 0], pairs[:, 1], rtol=0.01)


def test_the_largest_drac_equals_the_device_s(drive):
    record, ssm = drive
    _, expected = device_series(ssm, "DRAC")
    assert driving_metrics(record, FilterSettings())["drac_max"] == pytest.approx(expected.max(), rel=0.01)
