"""The backends of qpsolvers, made accurate on the safety problem. Imported where one is chosen: that costs 0.3 s."""

import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import numpy as np
import qpsolvers
from scipy.sparse import csc_matrix

from hj_cosim.control.problem.enumeration import ENUMERATION
from hj_cosim.errors import ConfigurationError

# What makes each backend of qpsolvers accurate on this problem: P is singular in t, and the tie weight is small.
_BACKEND_OPTIONS: dict[str, dict[str, float | int | bool]] = {
    "daqp": {"primal_tol": 1e-9, "dual_tol": 1e-12},
    "quadprog": {},
    "piqp": {"eps_abs": 1e-10, "eps_rel": 1e-11},
    "clarabel": {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11},
    "osqp": {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20_000, "polishing": True},
}
# Who answers where the chosen backend fails, in this order. Not quadprog: where twenty rows are nearly one and the same
# it goes round in circles for ever, and nothing ends it.
_FALLBACKS = ("daqp", "piqp", "clarabel", "osqp")
_SPARSE_BACKENDS = ("osqp", "clarabel")
# Only quadprog needs a positive definite P; on t, in units of λ_3.
_QUADPROG_REGULARISATION = 1e-8


def answering_in_turn(chosen: str) -> tuple[str, ...]:
    """Return who is asked for a solution, and then who where that one fails.

    Raises:
        ConfigurationError: if the chosen backend is not installed.
    """
    available = [*qpsolvers.available_solvers, ENUMERATION]
    if chosen not in available:
        raise ConfigurationError(
            f"filter.solver = {chosen!r} is not installed; install hj-cosim[solvers] or choose one of "
            + ", ".join(name for name in (*_BACKEND_OPTIONS, ENUMERATION) if name in available)
        )
    return (chosen, *(name for name in _FALLBACKS if name in available and name != chosen))


class Backends:
    """Answers scaled problems over (ω, a, t), whose quadratic cost is always the same.

    Args:
        tie: the cost of a² relative to that of ω².
        slack_weight: λ_3.
    """

    def __init__(self, tie: float, slack_weight: float) -> None:
        self._cost = np.diag([2.0, 2.0 * tie, 0.0])
        self._sparse_cost = csc_matrix(self._cost)
        self._regular_cost = np.diag([2.0, 2.0 * tie, _QUADPROG_REGULARISATION * slack_weight])

    def answer(
        self,
        backend: str,
        linear: np.ndarray,
        inequality: np.ndarray,
        offset: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> np.ndarray | None:
        """Return a backend's scaled (ω, a, t), or None where it fails.

        Args:
            backend: its name.
            linear: (3,) cost.
            inequality, offset: (K, 3) and (K,) of inequality @ (ω, a, t) <= offset.
            lower, upper: (3,) bounds.
        """
        cost = self._cost
        if backend == "quadprog":
            cost = self._regular_cost
        elif backend in _SPARSE_BACKENDS:
            cost, inequality = self._sparse_cost, csc_matrix(inequality)
        problem = qpsolvers.Problem(cost, linear, inequality, offset, lb=lower, ub=upper)
        try:
            with _own_failure_unsaid(backend):
                solution = qpsolvers.solve_problem(problem, backend, **_BACKEND_OPTIONS[backend])
        except (qpsolvers.exceptions.QPError, ValueError, ArithmeticError):
            return None
        return solution.x if solution.found else None


def _own_failure_unsaid(backend: str) -> AbstractContextManager[None]:
    """Return a context in which OSQP does not warn that it failed: that is counted, and the next backend answers."""
    if backend != "osqp":
        return nullcontext()
    return _without_osqps_failure()


@contextmanager
def _without_osqps_failure() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="OSQP exited with status", category=UserWarning)
        yield
