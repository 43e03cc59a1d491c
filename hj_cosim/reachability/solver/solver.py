"""The Hamilton-Jacobi-Isaacs solver: avoid tubes, V_t + min(0, H) = 0 with V(0, ·) given (paper, section HJI).

Lax-Friedrichs Hamiltonian with the game's own bounds, upwind differences, TVD Runge-Kutta (Shu & Osher 1988). The
bounds depend on the state alone, so the time step is the same throughout but for the last.
"""

import math
import os
import platform
import resource
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import numba
import numpy as np

from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.reachability.games.contract import DISSIPATION, HAMILTONIAN, TARGET, Game, pointer
from hj_cosim.reachability.games.trial import require_sound
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver import kernel
from hj_cosim.reachability.solver.layout import lay_out
from hj_cosim.reachability.solver.schemes import DERIVATIVES, SCHEMES
from hj_cosim.settings import TableSpecification

# Called with the steps done and the steps there are.
Progress = Callable[[int, int], None]

# Pieces per thread and stage: a thread that the machine holds up leaves pieces to the others.
_PIECES = 4


@dataclass(frozen=True)
class SolveReport:
    """How a table was solved."""

    shape: tuple[int, ...]
    scheme: str
    runge_kutta: int
    horizon: float  # s
    steps: int
    time_step: float  # s
    seconds: float
    cell_updates_per_second: float  # grid nodes × steps × stages / seconds
    peak_memory_mib: float  # of the whole process, the interpreter included
    residual: float  # largest |dV/dt| in the last step, in the value's unit per second: 0 when converged
    unsafe_share: float  # of the nodes with V <= 0
    versions: dict[str, str]


def state_limits(game: Game, grid: Grid, limited: bool) -> np.ndarray:
    """Return the least and greatest state that inputs may lead to, (2, n) float32; ±inf without a limit."""
    limits = np.empty((2, game.dimension), np.float32)
    limits[0], limits[1] = -np.inf, np.inf
    if limited:
        mask = np.array(game.limited)
        limits[0, mask] = np.array(grid.lower, np.float32)[mask]
        limits[1, mask] = np.array(grid.upper, np.float32)[mask]
    return limits


class Problem:
    """A game on a grid, laid out in memory for the kernel, with its functions as C functions."""

    def __init__(self, game: Game, grid: Grid, specification: TableSpecification, source: str) -> None:
        scheme = SCHEMES[specification.scheme]
        self.runge_kutta = specification.runge_kutta or scheme.runge_kutta
        self.layout = layout = lay_out(game, grid, scheme.radius)
        self.parameters = game.parameter_values(specification.parameters, source)
        limits = state_limits(game, grid, specification.state_limits)
        if specification.dynamics.endswith(".py"):
            require_sound(game, grid, self.parameters, limits, source)
        self.target = pointer(game.target, TARGET)
        dissipation = pointer(game.dissipation, DISSIPATION)
        # What the kernels take, in their order.
        self.nodes = (layout.nodes, np.array(layout.order), layout.coordinates, layout.slab_lines)
        self.stage = (
            layout.inverse_spacing,
            layout.stencils,
            layout.mirror_shifts,
            layout.line_boundary,
            pointer(scheme.derivatives, DERIVATIVES),
            pointer(game.hamiltonian, HAMILTONIAN),
            dissipation,
            self.parameters,
            limits,
        )
        speed = kernel.largest_speed(*self.nodes, layout.inverse_spacing, dissipation, self.parameters)
        if not 0.0 < speed < math.inf:
            raise ConfigurationError(
                f"{source}: the game's dissipation comes to {speed:g} on this grid; it bounds |∂H/∂p|, how fast V"
                " travels, and must be finite and above 0 somewhere"
            )
        self.time_step = specification.cfl / speed


@contextmanager
def _slab_workers(problem: Problem) -> Iterator[Callable[..., None]]:
    """Yield a function that runs a kernel over all slabs, shared between as many threads as there are cores."""
    workers = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    slabs = problem.layout.slabs
    pieces = max(1, min(_PIECES * workers, slabs)) if workers > 1 else 1
    edges = np.linspace(0, slabs, pieces + 1).astype(np.int64)
    with ThreadPoolExecutor(workers) as pool:

        def over_slabs(function: Callable[..., None], *arguments: object) -> None:
            parts = [pool.submit(function, first, end, *problem.nodes, *arguments) for first, end in pairwise(edges)]
            for part in parts:
                part.result()

        yield over_slabs


def solve(
    specification: TableSpecification, game: Game, source: str, progress: Progress | None = None
) -> tuple[np.ndarray, SolveReport]:
    """Solve for V(−horizon, ·).

    Args:
        specification: what to solve.
        game: the one that it names.
        source: what an error message calls the specification.
        progress: called with the steps done and the steps in all, after each.

    Returns:
        values: float32, axes in the order of the state; the specification's margin is not subtracted.
        report: how it went.

    Raises:
        TableError: if the values stop being finite.
        ConfigurationError: if parameters are not the game's, or a game of one's own is not what the solver can take.
    """
    began = time.perf_counter()
    grid = Grid.from_settings(specification.grid, game.boundary)
    problem = Problem(game, grid, specification, source)
    layout = problem.layout
    values, first, second = layout.buffer(), layout.buffer(), layout.buffer()
    with _slab_workers(problem) as over_slabs:
        over_slabs(kernel.target_slabs, problem.target, problem.parameters, values)
        floor = np.float32(layout.stored(values).min() if specification.clamp else -np.inf)
        step = problem.time_step
        steps = math.ceil(specification.horizon / step - 1e-9)
        before = values
        for number in range(steps):
            if number == steps - 1:
                step = specification.horizon - number * step
                before = values.copy()
            _runge_kutta_step(over_slabs, problem, values, first, second, np.float32(step), floor)
            if problem.runge_kutta == 1:
                values, first = first, values
            if progress is not None:
                progress(number + 1, steps)
    residual = float(np.max(np.abs(values - before))) / step
    if not math.isfinite(residual) or not np.isfinite(values).all():
        raise TableError(f"{source}: the solution is not finite; check the dynamics, or lower cfl")
    del first, second, before
    whole = layout.whole(values)
    seconds = time.perf_counter() - began
    return whole, SolveReport(
        shape=grid.shape,
        scheme=specification.scheme,
        runge_kutta=problem.runge_kutta,
        horizon=specification.horizon,
        steps=steps,
        time_step=problem.time_step,
        seconds=seconds,
        cell_updates_per_second=grid.cells * steps * problem.runge_kutta / seconds,
        peak_memory_mib=_peak_memory_mib(),
        residual=residual,
        unsafe_share=float(np.mean(whole <= 0.0)),
        versions={"python": platform.python_version(), "numpy": np.__version__, "numba": numba.__version__},
    )


def _runge_kutta_step(
    over_slabs: Callable[..., None],
    problem: Problem,
    values: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
    step: np.float32,
    floor: np.float32,
) -> None:
    """Advance `values` in place by one step; of order 1 the result is in `first`."""

    def stage(source: np.ndarray, target: np.ndarray, share: float) -> None:
        over_slabs(kernel.advance_slabs, *problem.stage, source, values, target, np.float32(share), step, floor)

    stage(values, first, 0.0)
    if problem.runge_kutta == 2:
        stage(first, values, 0.5)
    if problem.runge_kutta == 3:
        stage(first, second, 0.75)
        stage(second, values, 1.0 / 3.0)


def _peak_memory_mib() -> float:
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20
