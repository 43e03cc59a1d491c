"""Faults of the machine: each ends in one clear sentence and exit status 2, and nothing half-written is left."""

import errno
import os
import resource
import shutil
from pathlib import Path

import libsumo
import pytest

from hj_cosim import run as run_module
from hj_cosim import run_episode
from hj_cosim.analysis.replay import write_replay
from hj_cosim.files import UNFINISHED
from hj_cosim.locations import scenarios_folder
from hj_cosim.reachability.table import store as value_table
from hj_cosim.reachability.table.store import load_table
from hj_cosim.recording.run_folder import read_run
from hj_cosim.traffic.sumo import world as sumo_world

FEW_CARS = '[traffic]\ncount = 6\ncount_behind = 2\n[network]\nfile = "mine.net.xml"\n'
# Nobody may write here: not even the superuser, whom permissions do not bind.
READ_ONLY = Path("/sys/kernel")


@pytest.fixture
def scenario(tmp_path):
    """Return a scenario of a few cars, with a network of its own."""
    folder = tmp_path / "mine"
    folder.mkdir()
    shutil.copy(scenarios_folder() / "four_lanes.net.xml", folder / "mine.net.xml")
    (folder / "few.toml").write_text(FEW_CARS)
    return folder / "few.toml"


@pytest.fixture
def call(call):
    """Return a function that runs the command line and returns its exit status and what it said, in one line."""

    def run_command(*arguments):
        status, _, said = call(*arguments)
        assert "Traceback" not in said
        return status, " ".join(said.split())

    return run_command


@pytest.fixture
def drive(call, scenario, small_specification, small_table, tmp_path):
    """Return a function that drives the scenario into a folder, with further options."""

    def run(*options, out=tmp_path / "run"):
        knobs = ("--duration", 1, "--table", small_specification, "--no-figures")
        return call("run", scenario, *knobs, "--out", out, *options)

    return run


@pytest.fixture
def full_disk(request):
    """From here on no file may grow beyond so many bytes, as on a disk that fills up; the test gives the number."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (request.param, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def what_is_in(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


@pytest.fixture(scope="module")
def driven(small_specification, small_table, tmp_path_factory):
    """Return the folder of a run, driven before the disk is full, so that every kernel is loaded."""
    folder = tmp_path_factory.mktemp("driven") / "run"
    run_episode("light", duration=1.0, table=str(small_specification), out=folder)
    write_replay(read_run(folder), load_table(str(small_specification)), folder.with_name("replay.gif"))
    return folder


@pytest.mark.parametrize("full_disk", [6000], indirect=True)
@pytest.mark.parametrize(
    ("arguments", "target"),
    [
        (("run", "SCENARIO", "--duration", "1", "--table", "TABLE"), "run"),
        (("table", "solve", "TABLE"), "table.npz"),
        (("export", "RUN", "--format", "csv"), "drive.csv"),
        (("export", "RUN", "--format", "parquet"), "drive.parquet"),
        (("export", "RUN", "--format", "fcd"), "drive.xml"),
        (("figure", "timeline", "--run", "RUN"), "timeline.png"),
        (("figure", "timeline", "--run", "RUN"), "timeline.pdf"),
        (("replay", "RUN"), "drive.gif"),
        (("report", "RUN"), "report.html"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_full_disk_is_named_and_nothing_is_left(driven, scenario, full_disk, call, small_specification, tmp_path,
                                                arguments, target):  # fmt: skip
    place = tmp_path / "here" / target
    place.parent.mkdir()
    names = {"SCENARIO": scenario, "TABLE": small_specification, "RUN": driven}
    status, said = call(*(names.get(argument, argument) for argument in arguments), "--out", place)
    assert status == 2
    assert said.count("error: cannot write ") == 1
    assert "File too large; choose another place or free it" in said
    assert what_is_in(place.parent) == []
    assert not any(UNFINISHED in path for path in what_is_in(tmp_path))


@pytest.mark.parametrize("full_disk", [1000], indirect=True)
def test_disk_too_full_for_sumos_own_input_is_named(driven, scenario, full_disk, drive, tmp_path):
    status, said = drive()
    assert status == 2
    assert "traffic.rou.xml: File too large; choose another place or free it" in said
    assert not (tmp_path / "run").exists()


def test_disk_too_full_for_what_libraries_keep_is_named(drive, monkeypatch):
    def keep_a_kernel(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/cache/kernel.nbi")

    monkeypatch.setattr(run_module, "run_in_sumo", keep_a_kernel)
    status, said = drive()
    assert status == 2
    assert "error: the system refuses /cache/kernel.nbi: No space left on device; free some space" in said


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "SCENARIO", "--table", "TABLE", "--out", READ_ONLY / "run"),
        ("study", "SCENARIO", "--set", "table=TABLE", "--out", READ_ONLY / "study"),
        ("table", "solve", "TABLE", "--out", READ_ONLY / "table.npz"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_read_only_folder_is_named_before_any_work(call, monkeypatch, scenario, small_specification, arguments):
    def work(*_, **__):
        raise AssertionError("the work had begun")

    for module, name in (
        (run_module, "run_in_sumo"),
        (run_module, "load_tables"),
        (value_table, "solve_table"),
        (value_table, "load_table"),
    ):
        monkeypatch.setattr(module, name, work)
    names = {
        "SCENARIO": str(scenario),
        "TABLE": str(small_specification),
        "table=TABLE": f"table={small_specification}",
    }
    status, said = call(*(names.get(str(argument), argument) for argument in arguments))
    assert status == 2
    assert f"error: cannot write {arguments[-1]}: " in said
    assert "choose another place or free it" in said


@pytest.mark.parametrize(
    "arguments",
    [
        ("export", "RUN", "--out", READ_ONLY / "drive.csv"),
        ("figure", "timeline", "--run", "RUN", "--out", READ_ONLY / "a.png"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_read_only_folder_is_named(call, driven, arguments):
    status, said = call(*(driven if argument == "RUN" else argument for argument in arguments))
    assert status == 2
    assert f"error: cannot write {arguments[-1]}: " in said


@pytest.mark.parametrize(
    ("module", "name", "reason"),
    [
        (run_module, "load_tables", "'{}' is not in"),  # after the configuration was checked, before the road is read
        (sumo_world, "write_routes", "SUMO cannot run scenario few on {}: "),  # after that, before SUMO reads it
    ],
)
def test_network_that_vanishes_before_sumo_starts_is_named(
    drive, monkeypatch, scenario, tmp_path, module, name, reason
):
    network, original = scenario.with_name("mine.net.xml"), getattr(module, name)

    def vanish(*arguments, **options):
        network.unlink()
        return original(*arguments, **options)

    content = network.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(module, name, vanish)
        status, said = drive()
    assert status == 2
    assert reason.format(network) in said
    assert not (tmp_path / "run").exists()
    network.write_bytes(content)
    assert drive()[0] == 0


@pytest.mark.parametrize(
    "error", [libsumo.TraCIException, libsumo.FatalTraCIError, KeyboardInterrupt], ids=lambda error: error.__name__
)
def test_sumo_that_stops_on_the_way_is_named_and_the_next_run_works(drive, monkeypatch, tmp_path, error):
    """SUMO keeps what it was asked for in this step: nothing of that may reach the next run in this process."""
    steps, original = iter(range(10_000)), libsumo.simulationStep

    def stop_once(*arguments):
        if next(steps) == 32:  # of which 30 are for settling
            raise error("the lane has gone")
        return original(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(libsumo, "simulationStep", stop_once)
        status, said = drive()
    sentence = "interrupted" if error is KeyboardInterrupt else "error: SUMO failed at 0.10 s: the lane"
    assert (status, sentence in said) == (130 if error is KeyboardInterrupt else 2, True), said
    assert not (tmp_path / "run").exists()
    assert not libsumo.isLoaded()
    assert drive()[0] == 0


def test_sumo_that_loses_the_robot_is_named(drive, monkeypatch):
    """No stand-in: the robot is taken out of the real SUMO."""
    steps, original = iter(range(10_000)), libsumo.simulationStep

    def lose_it(*arguments):
        if next(steps) == 32:
            libsumo.vehicle.remove("robot")
        return original(*arguments)

    monkeypatch.setattr(libsumo, "simulationStep", lose_it)
    status, said = drive()
    assert status == 2
    assert "SUMO failed at 0." in said
    assert "'robot' is not known" in said


def test_sumo_that_cannot_even_end_is_named(drive, monkeypatch, tmp_path):
    def fail(*_):
        raise libsumo.FatalTraCIError("nothing goes any more")

    with monkeypatch.context() as patch:
        patch.setattr(libsumo, "close", fail)
        status, said = drive()
    assert status == 2
    assert "error: SUMO failed at its end: nothing goes any more" in said
    assert what_is_in(tmp_path) == ["mine", "mine/few.toml", "mine/mine.net.xml"]
    libsumo.close()
