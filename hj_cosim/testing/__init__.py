"""Tests for those who write a planner, a filter or a world of their own.

In a test of one's own, for example with pytest:

    from hj_cosim.testing import check_planner
    from mine import KeepRight

    def test_keep_right():
        check_planner(KeepRight)

Each raises ContractError, an AssertionError, with one sentence about the first thing that is wrong.
"""

from hj_cosim.testing.expectations import ContractError
from hj_cosim.testing.filters import check_filter
from hj_cosim.testing.planners import check_planner
from hj_cosim.testing.worlds import check_world

__all__ = ["ContractError", "check_filter", "check_planner", "check_world"]
