"""Tests for those who write a planner, a filter, a world or a game of their own.

In a test of one's own, for example with pytest:

    from hj_cosim.testing import check_planner
    from mine import KeepRight

    def test_keep_right():
        check_planner(KeepRight)

Each raises ContractError, an AssertionError, with one sentence about the first thing that is wrong with what a plug-in
does. What cannot be found, imported or made, or has not the method, is another HjCosimError, as in a run.
"""

from hj_cosim.testing.expectations import ContractError
from hj_cosim.testing.filters import check_filter
from hj_cosim.testing.games import check_game
from hj_cosim.testing.planners import check_planner
from hj_cosim.testing.worlds import check_world

__all__ = ["ContractError", "check_filter", "check_game", "check_planner", "check_world"]
