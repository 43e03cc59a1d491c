"""What a first drive needs compiled, compiled in a second process while the value table is solved.

The process drives the planner and the filter for a moment through the traffic of `paper`, with a table that says
nothing, so that Numba keeps the kernels that the drive will need. It writes nothing else, and is not asked for an
answer: whatever it has not compiled is compiled when it is needed, as without it.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np

from hj_cosim.cosim.episode import run_in_sumo
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.solver.solver import SolveReport
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import EpisodeConfig, TableSpecification
from hj_cosim.traffic.sources.scenarios import load_scenario

REHEARSED = 1.1  # s, in which the planner is asked twice
LONGEST = 120.0  # s; one that takes longer is not waited for
FLAT_SHAPE = 4  # nodes along every axis of the table that says nothing
# A user's own class is not called before its time.
OUR_PLANNERS, OUR_FILTERS = ("hjop", "op", "mppi", "idle"), ("spc", "rss", "none")


def can_be_rehearsed(config: EpisodeConfig) -> bool:
    """Return whether planner, filter and game are ours."""
    return (
        config.planner.kind in OUR_PLANNERS
        and config.filter.kind in OUR_FILTERS
        and kept_table(config.table, config.robot).specification.dynamics == "highway"
    )


@contextmanager
def rehearsed(config: EpisodeConfig) -> Iterator[None]:
    """Have a drive's kernels compiled while the block solves its table; wait for the last of them."""
    process = subprocess.Popen(
        [sys.executable, "-m", "hj_cosim.rehearsal"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)},
        start_new_session=True,  # Ctrl-C reaches us alone, who end it
    )
    assert process.stdin is not None
    try:
        with suppress(BrokenPipeError):  # it may have ended already, which is no matter of the drive's
            process.stdin.write(config.model_dump_json().encode() + b"\n")
            process.stdin.flush()
        yield
        # What it is about to compile would only be compiled here a second time.
        with suppress(subprocess.TimeoutExpired):
            process.wait(LONGEST)
    finally:
        process.kill()
        process.wait()
        with suppress(BrokenPipeError):
            process.stdin.close()


def rehearse(config: EpisodeConfig) -> None:
    """Drive for a moment with a configuration's planner and filter; what comes out is thrown away."""
    simulation = config.simulation.model_copy(update={"duration": REHEARSED, "on_collision": "continue"})
    short = config.model_copy(update={"simulation": simulation, "scenario": load_scenario("paper")})
    run_in_sumo(short, flat_table(kept_table(config.table, config.robot).specification))


def flat_table(specification: TableSpecification) -> ValueTable:
    """Return a table that has not been solved: V is 0 within a grid of few nodes, so that the filter always acts."""
    shape = (FLAT_SHAPE,) * len(specification.grid.shape)
    grid = specification.grid.model_copy(update={"shape": shape})
    report = SolveReport(shape, specification.scheme, 0, 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, {})
    coarse = specification.model_copy(update={"grid": grid})
    return ValueTable(coarse, find_game(coarse.dynamics), np.zeros(shape, np.float32), report)


def main() -> None:
    """Rehearse the configuration that standard input states; end when that ends, as it does with who started us."""
    config = EpisodeConfig.model_validate_json(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_input, daemon=True).start()
    rehearse(config)
    os._exit(0)  # the thread waits for input still


def _end_with_input() -> None:
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    main()
