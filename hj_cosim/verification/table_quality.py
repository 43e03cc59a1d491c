"""How good a value table is: convergence, refinement, and whether played-out games keep its promises."""

import math
from dataclasses import dataclass

import numpy as np

from hj_cosim.errors import TableError
from hj_cosim.reachability.solver.solver import Progress
from hj_cosim.reachability.table.store import solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import GridSettings, TableSpecification
from hj_cosim.verification.table_games import play, states_near_zero

_NEAR = 5.0  # |V| within which differences matter
_WENO5_COST = 10.0  # at most, in units of a cheaper scheme's time


@dataclass(frozen=True)
class Refinement:
    """A table against a finer one, at random states of the grid."""

    what: str  # what is finer
    shape: tuple[int, ...]
    seconds: float
    change_median: float  # of |V − V_finer| where |V| < 5
    change_p99: float
    called_safe_wrongly: float  # share of all states with V > 0 that the finer table calls unsafe
    called_unsafe_wrongly: float
    margin_needed: float  # what the margin must grow by for `called_safe_wrongly` to be at most 0.1 %


@dataclass(frozen=True)
class TableQuality:
    """What `table check` finds; values in the unit of V."""

    residual: float  # largest |dV/dt| in the last step
    unsafe_share: float  # of the nodes
    no_escape_share: float | None  # of random states, those with V > 0 where no manoeuvre escapes; None of other games
    unsafe_on_faces: dict[str, float]  # share of unsafe nodes on the faces beyond which a look-up says "safe"
    refinements: tuple[Refinement, ...]
    rollouts: int
    broken_share: float  # of rollouts whose least V(0, ·) fell more than `tolerance` below the table's promise
    tolerance: float
    shortfall_p99: float
    shortfall_worst: float
    entered_share: float  # of rollouts from V > 0 that entered the target set


def check_table(
    table: ValueTable,
    *,
    rollouts: int = 10_000,
    states: int = 100_000,
    seconds: float = 300.0,
    tolerance: float = 0.1,
    seed: int = 0,
    progress: Progress | None = None,
) -> TableQuality:
    """Measure a table's quality.

    Args:
        table: the table.
        rollouts: games from states with |V| <= 1, of the table's horizon.
        states: random states at which tables are compared.
        seconds: what the finer tables may take to solve, by the time that this one took. All axes are refined by 1.5
            at once if that fits, else one at a time, as many as fit.
        tolerance: by how much a rollout may fall short and count as kept.
        seed: of the random states.
        progress: called with the steps done and the steps in all, for each finer table anew.

    Raises:
        TableError: if V is nowhere near 0, or a finer table's solution is not finite.
    """
    generator = np.random.default_rng(seed)
    samples = table.draw_states(states, generator)
    starts = states_near_zero(table, rollouts, 1.0, generator)
    if len(starts) == 0:
        raise TableError(
            f"no state of the table has |V| <= 1: V is from {table.values.min():.3g} to {table.values.max():.3g}, so"
            " that nothing begins at the edge of its avoid tube; look at the game's target and grid"
        )
    refinements = tuple(
        _compare(table, what, solve_table(specification, progress), samples)
        for what, specification in finer_specifications(table, seconds)
    )
    games = play(table, starts, duration=table.specification.horizon)
    shortfall, promised_safe = games.shortfall, games.promised > 0.0
    return TableQuality(
        residual=table.report.residual,
        unsafe_share=float(np.mean(table.values <= 0.0)),
        no_escape_share=_no_escape_share(table, samples) if table.game.manoeuvres else None,
        unsafe_on_faces=_unsafe_on_faces(table),
        refinements=refinements,
        rollouts=len(shortfall),
        broken_share=float(np.mean(shortfall > tolerance)),
        tolerance=tolerance,
        shortfall_p99=float(np.percentile(shortfall, 99)),
        shortfall_worst=float(shortfall.max()),
        entered_share=float(np.mean(games.realised[promised_safe] <= 0.0)) if promised_safe.any() else 0.0,
    )


def finer_specifications(table: ValueTable, seconds: float) -> list[tuple[str, TableSpecification]]:
    """Return what the table is worth comparing with, in at most `seconds` of solving."""
    specification, grid = table.specification, table.grid
    whole = grid.refined(1.5).shape
    chosen = []
    if specification.scheme != "weno5" and _WENO5_COST * table.report.seconds <= seconds:
        chosen.append(
            ("weno5", specification.model_copy(update={"scheme": "weno5", "runge_kutta": None, "margin": 0.0}))
        )
        seconds -= _WENO5_COST * table.report.seconds
    if _cost(table, whole) <= seconds:
        return [*chosen, ("all axes", _with_shape(specification, whole))]
    for axis, name in enumerate(table.game.state):
        shape = tuple(whole[k] if k == axis else nodes for k, nodes in enumerate(grid.shape))
        if _cost(table, shape) <= seconds:
            chosen.append((name, _with_shape(specification, shape)))
            seconds -= _cost(table, shape)
    return chosen


def _cost(table: ValueTable, shape: tuple[int, ...]) -> float:
    """Return about how long a finer table takes, s: its nodes, and its steps at the most."""
    ratios = [new / old for new, old in zip(shape, table.grid.shape, strict=True)]
    return table.report.seconds * math.prod(ratios) * max(ratios)


def _with_shape(specification: TableSpecification, shape: tuple[int, ...]) -> TableSpecification:
    grid = GridSettings.model_validate(specification.grid.model_dump() | {"shape": shape})
    return specification.model_copy(update={"grid": grid, "margin": 0.0})


def _compare(table: ValueTable, what: str, finer: ValueTable, samples: np.ndarray) -> Refinement:
    ours, theirs = table.value(samples), finer.value(samples)
    # Where hardly any state is near the avoid tube's edge, all of them are compared.
    near = np.abs(ours) < _NEAR
    change = np.abs(ours - theirs)[near if near.any() else ...]
    wrongly_safe = (ours > 0.0) & (theirs <= 0.0)
    allowed = int(0.001 * len(samples))
    excess = np.sort(ours[wrongly_safe])[::-1]
    return Refinement(
        what=what,
        shape=finer.grid.shape,
        seconds=finer.report.seconds,
        change_median=float(np.median(change)),
        change_p99=float(np.percentile(change, 99)),
        called_safe_wrongly=float(np.mean(wrongly_safe)),
        called_unsafe_wrongly=float(np.mean((ours <= 0.0) & (theirs > 0.0))),
        margin_needed=float(excess[allowed]) if len(excess) > allowed else 0.0,
    )


def _no_escape_share(table: ValueTable, samples: np.ndarray) -> float:
    called_safe = samples[table.value(samples) > 0.0]
    return float(np.sum(table.guaranteed(called_safe) <= 0.0)) / len(samples)


def _unsafe_on_faces(table: ValueTable) -> dict[str, float]:
    shares = {}
    for axis, (name, outside) in enumerate(zip(table.game.state, table.game.outside, strict=True)):
        if outside == "safe":
            shares[f"{name} low"] = float(np.mean(table.values.take(0, axis) <= 0.0))
            shares[f"{name} high"] = float(np.mean(table.values.take(-1, axis) <= 0.0))
    return shares
