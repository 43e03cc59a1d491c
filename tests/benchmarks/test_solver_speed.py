"""The HJI solver beside hj_reachability on the same work in the same run, its memory, and what a look-up costs.

Of WENO5 both solve the first tenth of the three seconds, for the peer takes minutes for the rest: every step of a solve
costs the same. What a solve begins with, 0.03 s, is then a tenth of ours; of first order, where it would be half, both
solve all three. CPU seconds stand beside wall seconds, because on a machine that is busy otherwise only they compare.
"""

import json
import math
import os
import subprocess
import sys
import time
import timeit
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from scipy.interpolate import RegularGridInterpolator

from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.contract import Game, state_function
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver.solver import solve
from hj_cosim.reachability.table.lookup import values_and_gradients
from hj_cosim.reachability.table.store import load_table, solve_table
from hj_cosim.settings import Scheme, TableSpecification

TESTS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TESTS / "reachability"))

import peer_cases  # noqa: E402

SHAPE = (41, 25, 13, 13, 13)
HORIZONS: dict[Scheme, float] = {"first_order": 3.0, "weno5": 0.3}  # s, of 3
ROUNDS = 7  # of which the median counts
AS_GOOD_AS_THE_SAME = 1e-2  # m, of float32's rounding over all steps


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


@state_function
def hamiltonian_of_fixed_limits(x, p, c, limits, out):  # type: ignore[no-untyped-def]
    """That of two cars who may do at every state what their limits say (paper, eq. case study Hamiltonian)."""
    forward, leftward = x[3, 0] * math.cos(x[2, 0]), x[3, 0] * math.sin(x[2, 0])  # a slab's nodes share θ and v_r
    zero, cos, sin = np.float32(0.0), np.float32(math.cos(c[3])), np.float32(math.sin(c[3]))
    robot_share, other_share = np.float32(2.0) * c[15] * x[3, 0], np.float32(2.0) * c[15]
    for i in range(out.shape[0]):
        p_x, p_y, v_o = p[0, i], p[1, i], x[4, i]
        length = np.sqrt(p_x * p_x + p_y * p_y)
        other = length if (p_x > zero) & (abs(p_y) <= sin * length) else cos * p_x + sin * abs(p_y)
        by_robot, by_other = p[3, i] + robot_share * p_x, p[4, i] - other_share * v_o * p_x
        robot = c[2] * by_robot if by_robot > zero else c[1] * by_robot
        other_speed = c[4] * by_other if by_other > zero else c[5] * by_other
        out[i] = forward * p_x + leftward * p_y - v_o * other + c[0] * abs(p[2, i]) + robot + other_speed


def test_what_duties_and_tyres_cost(row) -> None:
    """Limits that depend on the state, against a Hamiltonian that knows of none; by turns, CPU seconds a step."""
    shear = {"braking_shear": 1.0 / 12.0}
    plain = large("weno5").model_copy(update={"parameters": shear})
    limited = plain.model_copy(update={"parameters": {**shear, "responsible": 1.0, "lateral_acceleration_max": 4.0}})
    fixed = replace(find_game("highway"), hamiltonian=hamiltonian_of_fixed_limits)

    def solved(specification: TableSpecification, game: Game) -> tuple[np.ndarray, float]:
        """Return the values, and CPU seconds a step."""
        started = time.process_time()
        values, report = solve(specification, game, "the benchmark")
        return values, (time.process_time() - started) / report.steps

    # The one is the other where no duties are done and the tyres hold anything; and it is compiled.
    found = [solved(plain, game)[0] for game in (fixed, find_game("highway"))]
    assert np.abs(found[0] - found[1]).max() < AS_GOOD_AS_THE_SAME
    solved(limited, find_game("highway"))
    ratios = [solved(limited, find_game("highway"))[1] / solved(plain, fixed)[1] for _ in range(ROUNDS)]
    print(f"\nduties and tyres: {np.median(ratios):.2f} x, {min(ratios):.2f} to {max(ratios):.2f}")
    row("duties and tyres", float(np.median(ratios)))


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
