"""Any configuration either drives, or is refused in one sentence: drawn over the real schema."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w
from any_configuration import anything, tables
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from hj_cosim.cosim.configuration import config_toml, resolve_config
from hj_cosim.cosim.episode import run_in_sumo
from hj_cosim.errors import HjCosimError
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.run import new_run_folder
from hj_cosim.settings import EpisodeConfig, Scenario, parse_assignment, read_toml

# The same examples every time; a scene of four cars for half a second, so that hundreds of them are cheap.
few = settings(
    max_examples=20,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.filter_too_much],
)
DURATION = 0.5  # s


def require_sentence(error: HjCosimError) -> None:
    assert 10 < len(str(error)) < 600
    assert "\n" not in str(error).strip()


def written(path: Path, content: dict[str, Any]) -> Path:
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def with_few_cars(scenario: dict[str, Any]) -> dict[str, Any]:
    traffic = scenario.get("traffic", {})
    return {**scenario, "traffic": {"count": 4, **traffic} if isinstance(traffic, dict) else traffic}


def drive_or_refuse(path: Path, flags: dict[str, Any], table: ValueTable) -> None:
    try:
        config = resolve_config(str(path), flags=flags)
        clocks = {"duration": min(config.simulation.duration, DURATION), "settle_time": 0.1}
        config = config.model_copy(update={"simulation": config.simulation.model_copy(update=clocks)})
        episode = run_in_sumo(config, table)
    except HjCosimError as error:
        require_sentence(error)
    else:
        limits, robot = config.robot, episode.record.robot
        assert (abs(robot.omega) <= limits.omega_max).all()
        assert ((robot.acceleration >= limits.acceleration_min) & (robot.acceleration <= limits.acceleration_max)).all()
        path.write_text(config_toml(config), encoding="utf-8")
        assert EpisodeConfig.model_validate(read_toml(path)) == config


@few
@given(scenario=tables(Scenario))
@example(scenario={"cars": [{"lane": 0, "x": 20.0, "speed": 0.0, "colour": "red"}], "name": "x"})
@example(scenario={"robot": {"speed": 5e-324}, "name": "x"})
@example(scenario={"drivers": {"time_headway": {"mean": 1.0, "deviation": 0.1, "truncation": 1e-300}}, "name": "x"})
@example(scenario={"name": "../../../x\x00", "description": "\x1b[31m"})
def test_any_scenario_drives_or_is_refused_in_a_sentence(tmp_path, small_table, scenario):
    drive_or_refuse(written(tmp_path / "mine.toml", with_few_cars(scenario)), {}, small_table)


@few
@given(config=tables(EpisodeConfig))
@example(config={"robot": {"omega_max": 2.3e-308}})
@example(config={"planner": {"prediction_step": 1e-9}})
@example(config={"planner": {"action_time": 1e9}})
@example(config={"simulation": {"step": 1e-9}})
@example(config={"robot": {"speed_max": 1.0}, "planner": {"kind": "idle"}})
def test_any_configuration_drives_or_is_refused_in_a_sentence(tmp_path, small_table, config):
    path = written(tmp_path / "mine.toml", {"traffic": {"count": 4}})
    drive_or_refuse(path, {key: value for key, value in config.items() if key != "scenario"}, small_table)


@settings(few, max_examples=40)
@given(content=st.dictionaries(st.text(max_size=5), anything, max_size=4))
def test_a_file_of_anything_is_refused_in_a_sentence_or_is_a_scenario(tmp_path, content):
    try:
        resolve_config(str(written(tmp_path / "mine.toml", content)))
    except HjCosimError as error:
        require_sentence(error)


@settings(few, max_examples=40)
@given(content=st.binary(max_size=60) | st.text("[]{}=.\"'#\n aé0", max_size=60).map(str.encode))
@example(content=b"a=" + b"[" * 100_000)
@example(content=b"a" + b".a" * 100_000 + b"=1")
@example(content=b"a=" + b"{a=" * 100_000)
@example(content=b"a=" + b"9" * 5000)
@example(content=b"# " + b"x" * 2_000_001)
def test_bytes_of_any_kind_are_refused_in_a_sentence_or_are_a_scenario(tmp_path, content):
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    try:
        resolve_config(str(path))
    except HjCosimError as error:
        require_sentence(error)


@settings(few, max_examples=40)
@given(text=st.text(max_size=40))
@example(text="a=" + "[" * 100_000)
@example(text="a" + ".a" * 100_000 + "=1")
@example(text="seed=" + "9" * 5000)
@example(text="scenario.description=\udcff")
@example(text="scenario.cars=[{lane=1, x=1, speed=1, colour=1}]")
@example(text="scenario.network.file=" + "x/" * 5000)
@example(text="scenario.network.file=\x00")
def test_any_assignment_is_refused_in_a_sentence_or_taken(text):
    try:
        parse_assignment(text)
        resolve_config("light", assignments=[text])
    except HjCosimError as error:
        require_sentence(error)


@pytest.mark.parametrize("name", ["..", "../../x", "/etc/x", "a/b", ".hidden", "x" * 400, "é" * 400, "a\x00b"])
def test_a_scenario_s_name_cannot_lead_out_of_the_runs_folder(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    folder = new_run_folder(resolve_config(str(written(tmp_path / "mine.toml", {"name": name}))))
    assert folder.resolve().parent == tmp_path / "runs"
    assert not folder.name.startswith(".")
    folder.mkdir(parents=True)
