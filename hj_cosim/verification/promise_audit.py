"""Checks at every step of an episode whether the filter kept its promise, so that a broken one cannot hide."""

from typing import Any

from hj_cosim.control.contract import FilterDecision
from hj_cosim.control.problem.nearest_control import RowsDecision
from hj_cosim.reachability.table.stack import TableStack
from hj_cosim.scene.observation import Observation
from hj_cosim.verification.promise import promise_kept

# m/s that a V in K may fall: the gradient changes within a step and from cell to cell of the table.
TOLERANCE = 0.5


class PromiseAudit:
    """Counts the steps over which SPC promised that no V in K falls, and those over which none fell.

    Args:
        tables: V.
        epsilon: ε, m: K are the cars with V at most this.
        promises: whether the filter promises anything about V at all: SPC does, RSS and none do not.
        tolerance: m/s.
    """

    def __init__(self, tables: TableStack, *, epsilon: float, promises: bool, tolerance: float = TOLERANCE) -> None:
        self._tables = tables
        self._epsilon = epsilon
        self._promises = promises
        self._tolerance = tolerance
        self._promised = 0
        self._kept = 0

    def judge(self, decision: FilterDecision, before: Observation, after: Observation) -> None:
        """Take one step into account.

        Args:
            decision: the filter's, for the observation `before`.
            before, after: the instants at which the control was chosen and at which it had been applied.
        """
        if not self._promises or not isinstance(decision, RowsDecision):  # it braked, for want of a judgement
            return
        limits = {"epsilon": self._epsilon, "tolerance": self._tolerance}
        kept = promise_kept(self._tables, decision, before, after, **limits)
        if kept is not None:
            self._promised += 1
            self._kept += kept

    def summary(self) -> dict[str, Any]:
        """Return what goes into summary.json; where nothing was promised, nothing was broken."""
        percent = 100.0 * self._kept / self._promised if self._promised else 100.0
        return {"promise_kept_percent": percent, "promise_samples": self._promised}
