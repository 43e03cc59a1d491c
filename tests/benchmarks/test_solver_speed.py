"""The HJI solver beside hj_reachability on the same work in the same run, its memory, and what a look-up costs.

Of WENO5 both solve the first tenth of the three seconds, for the peer takes minutes for the rest: every step of a solve
costs the same. What a solve begins with, 0.03 s, is then a tenth of ours; of first order, where it would be half, both
solve all three. CPU seconds stand beside wall seconds, because on a machine that is busy otherwise only they compare.
"""

import json
import os
import subprocess
import sys
import time
import timeit
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from scipy.interpolate import RegularGridInterpolator

from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.table.lookup import values_and_gradients
from hj_cosim.reachability.table.store import load_table, solve_table
from hj_cosim.settings import Scheme, TableSpecification

TESTS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TESTS / "reachability"))

import peer_cases  # noqa: E402

SHAPE = (41, 25, 13, 13, 13)
HORIZONS: dict[Scheme, float] = {"first_order": 3.0, "weno5": 0.3}  # s, of 3
MEGABYTE = 2**20


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Return wall and CPU seconds of `work`."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - cpu


def large(scheme: Scheme) -> TableSpecification:
    return peer_cases.highway(scheme, SHAPE).model_copy(update={"horizon": HORIZONS[scheme]})


@njit(fastmath={"contract"}, nogil=True)
def multiply_add(values: np.ndarray, rounds: int) -> None:
    for _ in range(rounds):
        for i in range(values.size):
            values[i] = values[i] * np.float32(0.999) + np.float32(0.001)


@pytest.mark.parametrize(("scheme", "goal"), [("first_order", "solver first_order"), ("weno5", "solver weno5")])
def test_the_solver_beside_its_peer(benchmark, row, require_peer, scheme: Scheme, goal: str) -> None:
    require_peer("hj_reachability", goal)
    from peer import peer_solver

    specification = large(scheme)
    solve_table(specification.model_copy(update={"horizon": 0.01}))  # compiles
    peer = peer_solver(specification)
    peer(0.01)
    peer_wall, peer_cpu = timed(lambda: peer(HORIZONS[scheme]))
    wall, cpu = timed(lambda: solve_table(specification))
    report = benchmark.pedantic(lambda: solve_table(specification).report, rounds=1)
    # A multiply-add over an array that fits the first-level cache, on one core.
    array = np.ones(4096, np.float32)
    multiply_add(array, 1)
    loop = time.process_time()
    multiply_add(array, 100_000)
    floor = array.size * 100_000 / (time.process_time() - loop)
    rate = np.prod(SHAPE) * report.steps * report.runge_kutta
    print(
        f"\n{scheme} on {SHAPE}, {report.steps} steps: wall {wall:.2f} s against the peer's {peer_wall:.2f} s,"
        f" {peer_wall / wall:.0f} x; CPU {cpu:.2f} s against {peer_cpu:.2f} s,"
        f" {peer_cpu / cpu:.0f} x; {rate / wall / 1e6:.0f} M cell updates/s wall,"
        f" {rate / cpu / 1e6:.0f} M per CPU second,"
        f" {100 * rate / cpu / floor:.2f} % of a multiply-add loop's {floor / 1e6:.0f} M/s"
    )
    row(goal, peer_wall / wall)


MEMORY_PROBE = """
import json, sys
from hj_cosim.settings import TableSpecification

def peak():  # kB; of this program alone, while getrusage's goes on from the process that started it
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))

specification = TableSpecification.model_validate_json(sys.argv[1])
grid = specification.grid.model_copy(update={"shape": (9, 9, 7, 7, 7)})
solve(specification.model_copy(update={"grid": grid}))
base = peak()
solve(specification)
print(json.dumps([base, peak()]))
"""
OURS = """
from hj_cosim.reachability.table.store import solve_table as solve
"""
PEERS = """
from peer import peer_solver
def solve(specification):
    peer_solver(specification)(specification.horizon)
"""


def bytes_a_cell(solve: str, specification: TableSpecification) -> float:
    """Return the memory that a solver takes over what the interpreter takes that has solved a small table with it."""
    output = subprocess.run(
        [sys.executable, "-c", solve + MEMORY_PROBE, specification.model_dump_json()],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS / "reachability")])},
    )
    base, peak = json.loads(output.stdout)
    assert peak > base
    return (peak - base) * 1024 / np.prod(SHAPE)


def test_the_solver_takes_little_memory(row, require_peer) -> None:
    require_peer("hj_reachability", "solver memory")
    specification = large("weno5").model_copy(update={"horizon": 0.02})
    ours = bytes_a_cell(OURS, specification)
    peers = bytes_a_cell(PEERS, specification)
    print(f"\nmemory: {ours:.1f} bytes a cell, the peer's {peers:.0f}")
    row("solver memory", ours, peers)


def test_a_hundred_look_ups(benchmark, row) -> None:
    table = load_table("highway")
    grid = Grid.from_settings(table.specification.grid, table.game.boundary)
    states = np.random.default_rng(0).uniform(np.array(grid.lower) * 0.6, np.array(grid.upper) * 0.6, (100, 5))
    arrays = table.arrays
    values_and_gradients(*arrays, states)
    benchmark(values_and_gradients, *arrays, states)
    points = [np.linspace(*ends) for ends in zip(grid.lower, grid.upper, grid.shape, strict=True)]
    interpolate = RegularGridInterpolator(points, np.zeros(grid.shape))
    scipys = min(timeit.repeat(lambda: interpolate(states), number=20, repeat=5)) / 20
    print(f"\n100 look-ups: {benchmark.stats['median'] * 1e6:.1f} µs median, {benchmark.stats['min'] * 1e6:.1f} best")
    row("look-ups", 1e6 * benchmark.stats["median"], 1e6 * scipys)
