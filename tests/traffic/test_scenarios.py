"""Finding and reading scenarios, their list, template and schema."""

import tomllib

import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import EpisodeConfig, Scenario, validate
from hj_cosim.traffic.sources.catalogue import list_scenarios, scenario_schema, scenario_template
from hj_cosim.traffic.sources.scenarios import load_scenario, scenario_data, scenario_names


def test_every_scenario_of_sumo_net_is_valid_and_described():
    assert {"light", "paper", "dense", "jam", "two_lanes", "six_lanes"} <= set(scenario_names())
    for name in scenario_names():
        scenario = load_scenario(name)
        assert scenario.name == name
        assert scenario.description


def test_a_path_is_read_and_named_after_its_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("seed = 7\n[traffic]\ncount = 12\n")
    scenario = load_scenario(str(path))
    assert (scenario.name, scenario.seed, scenario.traffic.count) == ("mine", 7, 12)
    assert scenario_data(str(path)) == {"name": "mine", "seed": 7, "traffic": {"count": 12}}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[traffic]\ncuont = 1", "unknown key 'traffic.cuont'; known keys are count"),
        ("[traffic]\ncount = -1", "traffic.count = -1: input should be greater"),
        ("[traffic]\ncount = 'many'", "traffic.count = 'many'"),
        ("[traffic]\ndensity = 10\nspacing_factor = 2.0", "density and spacing_factor say the same thing twice"),
        ("[traffic]\nspeed_low = 30.0", "speed_high"),
        ("[drivers]\ndesired_speed = {mean = 2.0, deviation = 1.5}", "reaches zero"),
        ("[[cars]]\nlane = 1", "[[cars]] entry 1, x: field required"),
        ("[traffic", "is not TOML"),
    ],
)
def test_a_mistake_is_named_with_its_file_and_key(tmp_path, text, said):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as error:
        load_scenario(str(path))
    assert said in str(error.value)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[robot]\nspeed = 120.0",
            r"mine\.toml: scenario\.robot\.speed \(120 m/s\) must not exceed robot\.speed_max \(40 m/s\)",
        ),
        ("[traffic]\ncount = -1", r"mine\.toml: traffic\.count = -1: "),
        ("count = 3", r"mine\.toml: unknown key 'count'; known keys are name, "),
        (
            "[[cars]]\nlane = 1\nx = 9.0\nspeed = 1.0\n[[cars]]\nlane = -2\nx = 40.0\nspeed = 1.0",
            r"mine\.toml: \[\[cars\]\] entry 2, lane = -2: ",
        ),
        ("[[cars]]\nlan = 1", r"mine\.toml: \[\[cars\]\] entry 1, lane: field required"),
    ],
)
def test_an_episode_names_the_keys_of_a_scenarios_file_as_the_file_has_them(tmp_path, text, said):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=said):
        resolve_config(str(path))


def test_a_robot_may_start_as_fast_as_it_can_be():
    assert resolve_config("paper", assignments=["robot.speed_max=24"]).robot.speed_max == 24.0
    with pytest.raises(ConfigurationError, match=r"robot\.speed_max=23\.9: .*\(24 m/s\) .*\(23\.9 m/s\)"):
        resolve_config("paper", assignments=["robot.speed_max=23.9"])


def test_an_unknown_name_is_answered_with_those_that_exist():
    with pytest.raises(ConfigurationError, match=r"no scenario is called 'papre'; choose one of .*paper"):
        load_scenario("papre")


def test_the_scenarios_seed_is_the_episodes_unless_another_is_given():
    scenario = {"name": "mine", "seed": 7}
    assert EpisodeConfig.model_validate({"scenario": scenario}).seed == 7
    assert EpisodeConfig.model_validate({"scenario": scenario, "seed": 3}).seed == 3
    assert EpisodeConfig.model_validate({"scenario": {"name": "mine"}}).seed == 0


def test_the_list_tells_lanes_cars_and_density():
    entries = {entry.name: entry for entry in list_scenarios()}
    assert entries["paper"].lanes == 4
    assert (entries["paper"].cars_ahead, entries["paper"].cars_behind) == (100, 0)
    assert entries["paper"].density == pytest.approx(13.5, abs=0.1)
    assert entries["light"].density < entries["paper"].density < entries["dense"].density < entries["jam"].density
    assert entries["light"].stream_speed > entries["jam"].stream_speed
    assert entries["six_lanes"].lanes == 6


def test_the_template_is_a_scenario_that_states_every_default():
    data = tomllib.loads(scenario_template())
    assert validate(Scenario, {"name": "mine", **data}, "template") == Scenario(name="mine", description="my scenario")
    stated = {f"{table}.{key}" for table in ("network", "traffic", "drivers", "robot") for key in data[table]}
    known = {
        f"{table}.{key}"
        for table in ("network", "traffic", "drivers", "robot")
        for key in Scenario.model_fields[table].annotation.model_fields
    }
    left_out = {"traffic.density", "network.route", "network.from_edge", "network.to_edge"}
    assert known - stated == left_out  # shown as comments: TOML has no null


def test_the_templates_hand_placed_car_is_valid_once_uncommented():
    text = scenario_template()
    car = text[text.index("# [[cars]]") :].replace("# ", "", 1).replace("\n# ", "\n")
    data = tomllib.loads(car)
    assert Scenario.model_validate({"name": "mine", **data}).cars[0].x == 40.0


def test_the_schema_knows_every_key_and_does_not_ask_for_the_name():
    schema = scenario_schema()
    assert set(schema["properties"]) == set(Scenario.model_fields)
    assert "name" not in schema["required"]
    assert schema["additionalProperties"] is False
    assert schema["$defs"]["TrafficSettings"]["properties"]["count"]["minimum"] == 0
