"""A run that is driven again from its config.toml gives the same bytes, or says what is different."""

import json
import tomllib

import pytest
import tomli_w

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.recording.versions import VERSIONS, changed_versions, read_versions
from hj_cosim.run import repetition_of, run_episode


@pytest.fixture(scope="module")
def run(small_specification, small_table, tmp_path_factory):
    folder = tmp_path_factory.mktemp("repetition") / "run"
    settings = ["planner.gamma_r=0.8", "scenario.traffic.count=20"]
    options = {"preset": "paper", "seed": 3, "duration": 0.4, "table": str(small_specification)}
    return run_episode("dense", **options, settings=settings, out=folder, figures=False)


@pytest.fixture
def altered(run, tmp_path):
    """Return a function that writes the run's config.toml with other values, and returns its path."""

    def write(change):
        data = tomllib.loads((run.folder / "config.toml").read_text())
        change(data)
        (tmp_path / "config.toml").write_text(tomli_w.dumps(data))
        return tmp_path / "config.toml"

    return write


def test_a_repetition_has_the_same_bytes_and_says_so(call, run, tmp_path):
    status, out, _ = call("run", run.folder / "config.toml", "--no-figures", "--out", tmp_path / "again", "--json")
    told = json.loads(out)["repetition"]
    assert (status, told["different"], told["versions"]) == (0, [], {})
    assert set(told["same"]) >= {"config.toml", "trajectories.parquet", "robot.parquet", "summary.json"}
    assert (tmp_path / "again" / "robot.parquet").read_bytes() == (run.folder / "robot.parquet").read_bytes()


def test_a_repetition_with_another_seed_says_which_files_differ(run, tmp_path):
    path = run.folder / "config.toml"
    again = run_episode(path, seed=4, out=tmp_path / "again", figures=False)
    told = repetition_of(path, again)
    assert again.config.seed == 4
    assert again.config.planner.gamma_r == 0.8
    assert {"config.toml", "robot.parquet"} <= set(told.different)
    assert not told.is_exact
    assert repetition_of("dense", again) is None


def test_a_configuration_is_taken_as_it_is(run):
    assert resolve_config(run.folder / "config.toml") == run.config
    assert resolve_config(run.folder / "config.toml", preset="paper") == run.config
    with pytest.raises(ConfigurationError, match=r"has preset = 'paper'.*leave --preset out"):
        resolve_config(run.folder / "config.toml", preset="best")


def test_versions_that_changed_are_named(run, tmp_path):
    kept = read_versions(run.folder)
    assert {"hj-cosim", "libsumo", "value table"} <= kept.keys()
    assert changed_versions(kept, kept) == {}
    assert changed_versions(kept, {**kept, "libsumo": "9"}) == {"libsumo": (kept["libsumo"], "9")}
    assert changed_versions({"a": "1"}, {"b": "1"}) == {"a": ("1", "unknown"), "b": ("unknown", "1")}
    (tmp_path / VERSIONS).write_text("[]")
    with pytest.raises(RunFolderError, match="is no list of versions"):
        read_versions(tmp_path)


@pytest.mark.parametrize("noun", ["planner", "filter"])
def test_a_class_is_not_run_because_a_folder_says_so(altered, noun):
    path = altered(lambda data: data[noun].update(kind="elsewhere.py:Evil"))
    with pytest.raises(ConfigurationError, match=rf"is not run .*name it yourself: --{noun} elsewhere.py:Evil"):
        resolve_config(path)
    assert resolve_config(path, flags={noun: {"kind": "none" if noun == "filter" else "idle"}}).seed == 3


def test_a_game_in_a_file_is_not_run_because_a_folder_says_so(altered, tmp_path):
    (tmp_path / "mine.toml").write_text('dynamics = "mine.py"\n')
    path = altered(lambda data: data.update(table=str(tmp_path / "mine.toml")))
    with pytest.raises(ConfigurationError, match=r"has the Python file mine.py as its game.*--table"):
        resolve_config(path)
    assert resolve_config(path, flags={"table": "highway"}).table == "highway"


def test_a_broken_configuration_is_named_by_its_key(altered):
    path = altered(lambda data: data["scenario"]["traffic"].update(count=-1))
    with pytest.raises(ConfigurationError, match=r"config.toml: scenario.traffic.count = -1"):
        resolve_config(path)


def test_a_rogue_s_class_is_not_run_because_a_folder_says_so(altered):
    path = altered(lambda data: data["scenario"].update(rogues={"behaviour": "elsewhere.py:Evil"}))
    with pytest.raises(ConfigurationError, match=r"the rogue 'elsewhere.py:Evil' is Python, which is not run"):
        resolve_config(path)
