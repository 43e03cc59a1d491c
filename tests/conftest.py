"""What all rooms' tests share: a value table small enough to be solved anew for every test run."""

import fcntl
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from hj_cosim.cli.commands import main
from hj_cosim.reachability.table.size_classes import SIZE_CLASSES
from hj_cosim.reachability.table.sized import load_tables
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import robot_and_filter

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # for the modules that tests share, in processes forked from ours too
from longest_first import KEPT, Durations, by_seconds  # noqa: E402

# Property tests take the same examples every time, however long one takes on a busy machine.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def small_specification(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of a coarse highway specification; its table is kept beside it once it has been solved."""
    return Path(shutil.copy(HERE / "fixtures" / "highway_small.toml", tmp_path_factory.mktemp("tables")))


@contextmanager
def _solved_by_one_worker(specification: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Take the tables that another worker of these tests has solved, and leave it those that are solved meanwhile."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        yield
        return
    shared, own = tmp_path_factory.getbasetemp().parent / "solved", specification.parent
    shared.mkdir(exist_ok=True)
    with (shared / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        _copy_tables(shared, own)
        yield
        _copy_tables(own, shared)


def _copy_tables(source: Path, target: Path) -> None:
    for table in source.glob("*.npz"):
        if not (target / table.name).exists():
            shutil.copy(table, target)


@pytest.fixture(scope="session")
def small_table(small_specification: Path, tmp_path_factory: pytest.TempPathFactory) -> ValueTable:
    """Return the coarse highway table, solved."""
    with _solved_by_one_worker(small_specification, tmp_path_factory):
        return load_table(str(small_specification))


@pytest.fixture(scope="session")
def sized_table(small_specification: Path, tmp_path_factory: pytest.TempPathFactory) -> ValueTable:
    """Return that table with those of vans, trucks and long trucks."""
    with _solved_by_one_worker(small_specification, tmp_path_factory):
        return load_tables(str(small_specification), SIZE_CLASSES, robot=robot_and_filter("best")[0])


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs the command line and returns its exit status, output and messages."""

    def run_command(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["hj-cosim", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        said = capsys.readouterr()
        return stopped.value.code or 0, said.out, said.err

    return run_command


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Durations(config), "durations of files")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Start with what takes longest in one piece, so that no worker waits for it at the end."""
    durations = config.pluginmanager.get_plugin("durations of files")
    by_seconds(items, config.workerinput[KEPT] if durations is None else durations.known)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say so when the browser test was left out; tests/analysis/conftest.py leaves it out."""
    if shutil.which("chromium") is None and "HJ_COSIM_REQUIRE_BROWSER" not in os.environ:
        terminalreporter.write_line("left out: tests/analysis/test_*_in_browser.py, for there is no chromium")
