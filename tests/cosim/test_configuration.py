"""Which layer of the configuration lies over which."""

import tomllib

import numpy as np
import pytest

from hj_cosim.cosim.configuration import config_toml, resolve_config, stack_flags
from hj_cosim.errors import ConfigurationError, NetworkError
from hj_cosim.reachability.table.store import find_specification, for_pair, read_specification
from hj_cosim.settings import Scenario
from hj_cosim.traffic.sources.scenarios import load_scenario, scenario_data


@pytest.fixture
def scenario_with_fast_drivers(tmp_path):
    path = tmp_path / "fast.toml"
    path.write_text("[drivers.desired_speed]\nmean = 28.0\ndeviation = 2.0\n")
    return str(path)


def test_best_assumes_others_answer_for_their_duties_and_paper_assumes_the_worst():
    for preset, gentle in (("best", True), ("paper", False)):
        config = resolve_config("paper", preset=preset)
        specification = read_specification(find_specification(config.table))
        assert (specification.parameters.get("responsible", 0.0) == 1.0) is gentle
        assert (config.filter.approach > 0.0) is gentle
        assert (config.robot.lateral_acceleration_max < 10.0) is gentle
        assert for_pair(specification, config.robot) == specification  # the table that is kept under its name


def test_preset_lies_over_the_defaults_and_under_the_scenario(scenario_with_fast_drivers):
    assert resolve_config("paper").scenario.drivers.desired_speed.mean == 24.0
    assert resolve_config("paper", preset="paper").scenario.drivers.desired_speed.mean == 23.0
    assert resolve_config(scenario_with_fast_drivers, preset="paper").scenario.drivers.desired_speed.mean == 28.0


def test_assignments_lie_over_flags_and_the_last_wins():
    config = resolve_config(
        flags=stack_flags(planner="op", seed=3), assignments=["planner.kind=idle", "planner.kind=hjop", "seed=5"]
    )
    assert (config.planner.kind, config.seed) == ("hjop", 5)


def test_flags_that_were_not_given_change_nothing():
    assert resolve_config(flags=stack_flags()) == resolve_config()


def test_config_toml_says_everything(scenario_with_fast_drivers):
    config = resolve_config(scenario_with_fast_drivers)
    assert type(config).model_validate(tomllib.loads(config_toml(config))) == config


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"preset": "bset"}, "no preset is called 'bset'; choose one of best, paper"),
        ({"scenario": "papr"}, "no scenario is called 'papr'"),
        ({"flags": stack_flags(duration=-1.0)}, r"the options: simulation\.duration = -1\.0"),
    ],
)
def test_wrong_name_or_flag_is_named(arguments, said):
    with pytest.raises(ConfigurationError, match=said):
        resolve_config(**arguments)


def test_preset_that_is_set_is_the_preset():
    set_there = resolve_config("paper", assignments=["preset=paper"])
    assert set_there == resolve_config("paper", preset="paper")
    assert set_there.table == "highway_paper"
    # Other assignments lie over it wherever they stand.
    for order in (1, -1):
        config = resolve_config("paper", assignments=["planner.expansions=7", "preset=paper"][::order])
        assert (config.preset, config.planner.expansions, config.planner.value_clip) == ("paper", 7, 5.0)


@pytest.mark.parametrize("preset", ["bst", "3"])
def test_preset_that_does_not_exist_is_refused_where_it_is_set(preset):
    with pytest.raises(ConfigurationError, match=f"--set preset={preset}: preset = .*'best' or 'paper'"):
        resolve_config("paper", assignments=[f"preset={preset}"])


def test_seed_of_the_scenario_counts_where_no_other_is_given(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("seed = 7\n")
    assert resolve_config(str(path)).seed == 7
    assert resolve_config(str(path), flags=stack_flags(seed=3)).seed == 3
    assert resolve_config(str(path), flags=stack_flags(seed=None)).seed == 7


def test_scenario_object_is_taken_like_its_file(scenario_with_fast_drivers):
    loaded = load_scenario(scenario_with_fast_drivers)
    for preset in ("best", "paper"):
        of_object = resolve_config(loaded, preset=preset)
        assert of_object == resolve_config(scenario_with_fast_drivers, preset=preset)
    assert resolve_config(Scenario(name="x"), preset="paper").scenario.drivers.desired_speed.mean == 23.0


def test_what_is_no_scenario_is_refused_by_its_type_not_its_content():
    with pytest.raises(ConfigurationError, match=r"a Scenario or a dict of its settings, not a list$"):
        resolve_config([{"name": "paper"}])


def test_dicts_say_what_texts_and_files_say(scenario_with_fast_drivers):
    nested = {
        "planner": {"gamma_r": 0.8, "expansions": np.int64(7)},
        "filter.scheme": "sw",
        "filter.keep_escape": False,
    }
    texts = ["planner.gamma_r=0.8", "planner.expansions=7", "filter.scheme=sw", "filter.keep_escape=false"]
    assert resolve_config("paper", assignments=nested) == resolve_config("paper", assignments=texts)
    content = {"name": "fast", "drivers": {"desired_speed": {"mean": 28.0}}, "seed": 7}
    config = resolve_config(content)
    assert (config.scenario.name, config.seed, config.scenario.drivers.desired_speed.mean) == ("fast", 7, 28.0)
    assert resolve_config({}).scenario.name == "unnamed"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({1: 2}, "settings: the key 1 is no text"),
        ({"planner.gamma_r": None}, "settings: planner.gamma_r = None is no number"),
        ({"planner": {"gamma": 1}}, "unknown key 'planner.gamma'"),
        ("planner.gamma_r=1", "neither a list of texts KEY=VALUE nor a dict"),
    ],
)
def test_a_dict_that_is_no_settings_is_refused(settings, said):
    with pytest.raises(ConfigurationError, match=said):
        resolve_config("paper", assignments=settings)


def test_a_tables_path_is_a_whole_one_so_that_a_run_can_be_repeated_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert resolve_config("light", assignments=["table=mine.toml"]).table == str(tmp_path / "mine.toml")
    assert resolve_config("light", flags={"table": "highway_paper"}).table == "highway_paper"


def test_settings_are_judged_together_and_the_first_that_makes_no_sense_is_named():
    slow = ["robot.speed_max=20", "scenario.robot.speed=15"]
    assert resolve_config("light", assignments=slow).robot.speed_max == 20.0
    with pytest.raises(ConfigurationError, match=r"--set robot.speed_max=20: scenario.robot.speed \(24 m/s\) must not"):
        resolve_config("light", assignments=slow[:1])
    with pytest.raises(ConfigurationError, match=r"--set planner.gamma_r=2: planner.gamma_r = 2"):
        resolve_config("light", assignments=["simulation.duration=1", "planner.gamma_r=2", "filter.epsilon=-1"])


def test_behaviours_are_named_in_full_with_their_options(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("class Weave:\n    def act(self, view):\n        return None\n")
    rogues = resolve_config(assignments=["scenario.rogues.behaviour=mine.py:Weave"]).scenario.rogues
    assert rogues.behaviour == f"{tmp_path / 'mine.py'}:Weave"
    given = ["scenario.rogues.behaviour=cut_in", "scenario.rogues.options.gap=2.0"]
    assert resolve_config(assignments=given).scenario.rogues.options == {"gap": 2.0, "rest": 4.0}
    with pytest.raises(ConfigurationError, match=r"scenario.rogues.options.*'gep'"):
        resolve_config(assignments=[*given, "scenario.rogues.options.gep=2.0"])


def test_a_users_simulation_has_no_cars_for_rogues():
    with pytest.raises(ConfigurationError, match="rogues take the scenario's own cars"):
        resolve_config(assignments=["scenario.own.file=mine.sumocfg", "scenario.rogues.share=0.1"])


def test_a_planner_brings_its_period_unless_a_layer_says_another():
    assert resolve_config().simulation.plan_period == 1.0
    mppi = resolve_config(flags=stack_flags(planner="mppi"))
    assert mppi.simulation.plan_period == 0.1
    given = resolve_config(flags=stack_flags(planner="mppi"), assignments=["simulation.plan_period=0.5"])
    assert given.simulation.plan_period == 0.5


def test_a_stream_that_no_way_leads_along_is_refused_before_the_drive():
    scenario = scenario_data("ramps")
    wrong = [*scenario["streams"], {"from_edge": "m0", "to_edge": "on_1", "flow": 100.0}]
    with pytest.raises(
        NetworkError, match=r"scenario.streams, number 6: .*no route leads from edge 'm0' to edge 'on_1'"
    ):
        resolve_config({**scenario, "streams": wrong})


def test_a_misspelt_behaviour_of_one_car_is_named_where_it_stands():
    by_hand = {"cars": [{"lane": 1, "x": 30.0, "speed": 20.0, "rogue": "tailgat"}]}
    with pytest.raises(
        ConfigurationError, match=r"rogue of \[\[scenario.cars\]\] = 'tailgat': no behaviour is called so"
    ):
        resolve_config({**scenario_data("two_lanes"), **by_hand})


def test_a_network_alone_is_no_scenario_and_what_is_one_is_said():
    with pytest.raises(ConfigurationError, match=r"'ring.net.xml' is a network without traffic; give a .sumocfg, or"):
        resolve_config("ring.net.xml")


def test_a_scenario_saved_with_a_byte_order_mark_is_read(tmp_path):
    (tmp_path / "mine.toml").write_bytes(b'\xef\xbb\xbfdescription = "saved by an editor"\n')
    assert resolve_config(str(tmp_path / "mine.toml")).scenario.description == "saved by an editor"
