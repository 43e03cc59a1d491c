"""FCD of drives on routes: on which of SUMO's lanes everybody is, against SUMO's own reading of the network."""

import math
import tomllib

import pandas as pd
import pytest
import sumolib
import tomli_w
from sumolib.geomhelper import positionAtShapeOffset

from hj_cosim.analysis.export import export_run
from hj_cosim.errors import NetworkError
from hj_cosim.locations import scenarios_folder
from hj_cosim.recording.run_folder import write_run
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sources.scenarios import load_scenario


def written(folder, make_record, scenario, **own) -> list:
    """Return FCD's lines of a made-up drive on a scenario's route, one car of which is on the verge."""
    network = load_scenario(scenario).network
    road, _ = read_network(scenarios_folder() / network.file, network)
    record = make_record(samples=40, road=road)
    record.traffic.y[:, 0] += 2.0 * road.lane_width
    config = {"scenario": {"name": "made up", "network": network.model_dump(exclude_none=True), **own}}
    write_run(folder / "run", record, tomli_w.dumps(config), {})
    path = export_run(folder / "run", "fcd")
    return [car for step in sumolib.xml.parse(str(path), "timestep") for car in step.vehicle]


@pytest.mark.parametrize(("scenario", "sometimes_none"), [("ring", False), ("curves", False), ("ramps", True)])
def test_everybody_is_on_the_lane_of_sumo_s_network_where_it_is_drawn(tmp_path, make_record, scenario, sometimes_none):
    lines = written(tmp_path, make_record, scenario)
    network = sumolib.net.readNet(str(scenarios_folder() / load_scenario(scenario).network.file), withInternal=True)
    placed = [car for car in lines if car.hasAttribute("lane")]
    assert len(placed) > 200
    for car in placed:
        lane = network.getLane(car.lane)
        shape = lane.getShape()
        way = sum(map(math.dist, shape, shape[1:]))
        drawn = positionAtShapeOffset(shape, float(car.pos) / lane.getLength() * way)
        # The robot changes lanes meanwhile, and its lane is the one nearest to it.
        assert math.dist(drawn, (float(car.x), float(car.y))) < 0.5 * lane.getWidth() + 0.5
    nowhere = {car.id for car in lines} - {car.id for car in placed}
    assert "car0" in nowhere
    assert len(nowhere) > 1 or not sometimes_none


def test_of_a_users_own_simulation_no_lane_is_named_for_its_route_is_not_known_afterwards(tmp_path, make_record):
    lines = written(tmp_path, make_record, "ring", own={"file": "mine.sumocfg"})
    assert len(lines) > 200
    assert not any(car.hasAttribute("lane") or car.hasAttribute("pos") for car in lines)


def test_a_network_that_is_gone_is_named(tmp_path, make_record):
    written(tmp_path, make_record, "ring")
    config = tmp_path / "run" / "config.toml"
    data = tomllib.loads(config.read_text())
    data["scenario"]["network"]["file"] = "gone.net.xml"
    config.write_text(tomli_w.dumps(data))
    before = pd.read_parquet(tmp_path / "run" / "trajectories.parquet")
    with pytest.raises(NetworkError, match=r"gone\.net\.xml"):
        export_run(tmp_path / "run", "fcd", tmp_path / "new.fcd.xml")
    assert not (tmp_path / "new.fcd.xml").exists()
    pd.testing.assert_frame_equal(before, pd.read_parquet(tmp_path / "run" / "trajectories.parquet"))
