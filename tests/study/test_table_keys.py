from pathlib import Path

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.study.jobs import table_key


def test_robots_with_other_limits_have_tables_of_their_own_in_a_study(small_specification: Path) -> None:
    def key(*assignments: str) -> str:
        return table_key(resolve_config("light", assignments=[f"table={small_specification}", *assignments]))

    assert key() == key("robot.omega_max=0.3")
    assert key("preset=paper", f"table={small_specification}") == str(small_specification)  # the default robot
    assert len({key(), key("robot.omega_max=0.2"), key("robot.length=6"), key("robot.speed_max=30")}) == 4
