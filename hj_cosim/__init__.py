"""A robot car that plans and controls with one Hamilton-Jacobi value function, co-simulated with SUMO traffic.

The names below are the library's face; each is imported when it is first used, so that `import hj_cosim` and
`hj-cosim --help` cost nothing. Nothing at all is imported here, for the command line answers Ctrl-C from its first own
line on.
"""

TYPE_CHECKING = False  # what type checkers take for true
if TYPE_CHECKING:
    from typing import Any

    from hj_cosim.reachability.table.store import load_table, solve_table
    from hj_cosim.recording.run_folder import read_run
    from hj_cosim.run import run_episode
    from hj_cosim.study.study import read_study, run_study
    from hj_cosim.traffic.sources.scenarios import load_scenario

__all__ = ["load_scenario", "load_table", "read_run", "read_study", "run_episode", "run_study", "solve_table"]
__version__ = "0.1.0"

_HOMES = {
    "load_scenario": "hj_cosim.traffic.sources.scenarios",
    "load_table": "hj_cosim.reachability.table.store",
    "read_run": "hj_cosim.recording.run_folder",
    "read_study": "hj_cosim.study.study",
    "run_episode": "hj_cosim.run",
    "run_study": "hj_cosim.study.study",
    "solve_table": "hj_cosim.reachability.table.store",
}


def __getattr__(name: str) -> "Any":
    if name not in _HOMES:
        raise AttributeError(f"module 'hj_cosim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> "list[str]":
    """Return what there is, of which nothing has to have been used, for whoever asks by the tabulator key."""
    return sorted([*(name for name in globals() if name.startswith("__")), *__all__])
