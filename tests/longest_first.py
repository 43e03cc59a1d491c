"""The order of the tests: what took longest the last time comes first, so that no worker is idle at the end."""

from collections.abc import Mapping
from pathlib import Path

import pytest

KEPT = "hj_cosim/seconds"  # in pytest's cache: how long each file took
# What takes longest where nothing was measured yet, as in a fresh clone. The first compiles most kernels; until
# then the other worker does what needs few of them, lest both compile the same ones. The wheel is lent them.
AT_FIRST = {
    "tests/study/test_study_in_sumo.py": 60.0,
    "tests/study/test_killed_studies.py": 50.0,
    "tests/study/test_study.py": 40.0,
    "tests/reachability/test_solver.py": 35.0,
    "tests/analysis/test_figure_print.py": 30.0,
    "tests/cli/test_check.py": 25.0,
    "tests/test_wheel.py": 20.0,
}


def by_seconds(items: list[pytest.Item], seconds: Mapping[str, float]) -> None:
    """Sort tests by how long their files take, the longest first; within a file and among the unknown nothing moves."""
    items.sort(key=lambda item: -seconds.get(file_of(item.nodeid), 0.0))


def file_of(nodeid: str) -> str:
    """Return the file that a test is in, relative to the repository."""
    return Path(nodeid.partition("::")[0]).as_posix()


class Durations:
    """Adds up how long files take, and remembers it for the next time; a plugin of the process that starts workers."""

    def __init__(self, config: pytest.Config) -> None:
        self._cache: pytest.Cache | None = getattr(config, "cache", None)  # None with `-p no:cacheprovider`
        self.known: dict[str, float] = AT_FIRST if self._cache is None else self._cache.get(KEPT, AT_FIRST)
        self._found: dict[str, float] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add a test's set-up, call or tear-down."""
        file = file_of(report.nodeid)
        self._found[file] = self._found.get(file, 0.0) + report.duration

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: "object") -> None:
        """Tell a worker what is known: all of them have to put the tests into one order."""
        node.workerinput[KEPT] = self.known  # type: ignore[attr-defined]

    def pytest_sessionfinish(self) -> None:
        """Keep the durations, with those of files that were not run now."""
        if self._cache is not None:
            self._cache.set(KEPT, {**self.known, **self._found})
