"""What all rooms' tests share: a value table small enough to be solved anew for every test run."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from hj_cosim.reachability.value_table import ValueTable, load_table

sys.path.insert(0, str(Path(__file__).resolve().parent))  # where kills.py is, for processes forked from ours too

SMALL_SPECIFICATION = """
description = "The highway game on a coarse grid, first order: for tests"
dynamics = "highway"
horizon = 3.0
scheme = "first_order"

[grid]
lower = [-100.0, -8.0, -0.4, 0.0, 0.0]
upper = [100.0, 8.0, 0.4, 40.0, 40.0]
shape = [41, 17, 9, 9, 9]
"""


@pytest.fixture(scope="session")
def small_specification(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of a coarse highway specification; its table is kept beside it once it has been solved."""
    path = tmp_path_factory.mktemp("tables") / "highway_small.toml"
    path.write_text(SMALL_SPECIFICATION)
    return path


@pytest.fixture(scope="session")
def small_table(small_specification: Path) -> ValueTable:
    """Return the coarse highway table, solved."""
    return load_table(str(small_specification))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start with what takes longest in one piece, so that no worker waits for it at the end."""
    items.sort(key=lambda item: item.path.name != "test_wheel.py" and item.path.parent.name != "study")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say so when the browser test was left out; tests/analysis/conftest.py leaves it out."""
    if shutil.which("chromium") is None and "HJ_COSIM_REQUIRE_BROWSER" not in os.environ:
        terminalreporter.write_line("left out: tests/analysis/test_report_in_browser.py, for there is no chromium")
