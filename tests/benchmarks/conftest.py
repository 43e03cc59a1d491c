"""The benchmarks report what they measured; the last thing to be printed is all of it beside what is wanted."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
import goals

_FOUND: pytest.StashKey[dict[str, goals.Measured]] = pytest.StashKey()
_LEFT_OUT: pytest.StashKey[dict[str, str]] = pytest.StashKey()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_FOUND], config.stash[_LEFT_OUT] = {}, {}


@pytest.fixture
def row(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Return a function that takes a goal's name, what was measured, and what stands beside it."""

    def report(name: str, has: float, beside: float | None = None) -> None:
        assert name in goals.GOALS, f"goals.GOALS has no row {name!r}"
        request.config.stash[_FOUND][name] = goals.Measured(float(has), None if beside is None else float(beside))

    return report


@pytest.fixture
def require_peer(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    """Return a function that fails a benchmark, and says why in its row, unless a peer is installed: extra `bench`."""

    def require(module: str, name: str) -> None:
        try:
            __import__(module)
        except ImportError:
            request.config.stash[_LEFT_OUT][name] = f"{module} is not installed"
            pytest.fail(f"{module} is not installed; `make bench` installs it")

    return require


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> Iterator[None]:
    yield  # what other plugins print comes before
    if not config.stash[_FOUND]:
        return
    text = goals.table(config.stash[_FOUND], config.stash[_LEFT_OUT])
    goals.FILE.parent.mkdir(exist_ok=True)
    goals.FILE.write_text(text, encoding="utf-8")
    terminalreporter.write_sep("=", "what there is, and what is wanted")
    terminalreporter.write_line(text)
    terminalreporter.write_line(f"{goals.busy()}; the table is in {goals.FILE}")
