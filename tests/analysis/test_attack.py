import numpy as np
import pandas as pd
import pytest

from hj_cosim.analysis.figures.attack import BEHAVIOUR, ROWS, SHARE, attack
from hj_cosim.analysis.figures.style import Drawing

SHARES = (0.0, 0.1, 0.2)
ONE_STACK = (("hjop", "spc", "mi"),)
TWO_STACKS = (*ONE_STACK, ("op", "none", "-"))
COLLISIONS = {"light": 2.0, "jam": 20.0}  # of HJOP in ten drives; of OP half as many again


def _table(stacks, behaviours=("mixed",), **factors):
    """Return a study's table: the product of shares, behaviours, stacks and other factors' values."""
    rows = [{}]
    for name, values in (*factors.items(), (BEHAVIOUR, behaviours), (SHARE, SHARES)):
        rows = [{**row, name: value} for row in rows for value in values]
    return pd.DataFrame(
        {**row, "planner": planner, "filter": safety_filter, "scheme": scheme, "episodes": 10}
        | {
            f"{metric}{ending}": COLLISIONS[row.get("scenario", "light")] * (1.0 if planner == "hjop" else 1.5)
            for metric, _ in ROWS
            for ending in ("", "_lo", "_hi")
        }
        for row in rows
        for planner, safety_filter, scheme in stacks
    )


def _title(drawing: Drawing) -> str:
    return " ".join(drawing.figure.get_suptitle().split())


def _names(drawing: Drawing) -> list[str]:
    return [text.get_text() for text in drawing.figure.legends[0].get_texts()]


def test_the_attack_has_a_line_for_each_stack_in_each_scenario_and_knob():
    drawing = attack(_table(TWO_STACKS, scenario=["light", "jam"], **{"planner.gamma_r": [0.8, 0.9]}))
    assert len(_names(drawing)) == len(set(_names(drawing))) == 8
    assert _names(drawing)[0] == "light, 0.8: HJOP + SPC + MI"
    for axes in drawing.figure.axes:
        lines = [bars.lines[0] for bars in axes.containers]
        assert all(line.get_xdata().tolist() == [0.0, 10.0, 20.0] for line in lines)
        assert len({line.get_color() for line in lines}) == 4
        assert all(len(set(line.get_ydata())) == 1 for line in lines)  # nothing of another scenario in it


def test_the_data_of_the_attack_say_what_varies_besides():
    table = _table(ONE_STACK, scenario=["light", "jam"], **{"planner.gamma_r": [0.8, 0.9]})
    data = attack(table).data
    assert data.scenario.tolist() == table.scenario.tolist()
    assert data["planner.gamma_r"].tolist() == table["planner.gamma_r"].tolist()
    assert "scenario" not in attack(_table(ONE_STACK, scenario=["light"])).data


def test_the_title_of_the_attack_compares_stacks_within_the_scenario_of_most_collisions():
    assert _title(attack(_table(TWO_STACKS, scenario=["light", "jam"]))) == (
        "Among 20 % of drivers who mean harm, where collisions are most (jam), HJOP + SPC + MI has 2 collisions a"
        " drive, OP + None 3"
    )
    both = attack(_table(ONE_STACK, scenario=["light", "jam"], **{"planner.gamma_r": [0.8, 0.9]}))
    assert "(jam, planner.gamma_r = 0.8), HJOP + SPC + MI has 2 collisions a drive" in _title(both)


def test_the_title_of_the_attack_names_no_worst_scenario_where_nobody_collides():
    table = _table(ONE_STACK, scenario=["light", "jam"])
    table["collisions"] = 0
    assert _title(attack(table)) == "Among 20 % of drivers who mean harm HJOP + SPC + MI has 0 collisions a drive"


def test_the_title_of_the_attack_is_about_drives_that_there_are():
    table = _table(TWO_STACKS, scenario=["light", "jam"])
    is_gone = (table.scenario == "light") & (table.planner == "hjop")
    table.loc[is_gone, "episodes"] = 0
    table.loc[is_gone, table.columns[table.columns.get_loc("episodes") + 1 :]] = np.nan
    assert "(jam), HJOP + SPC + MI has 2 collisions a drive, OP + None 3" in _title(attack(table))
    table["collisions"] = np.nan
    assert _title(attack(table)) == "Nobody has driven among drivers who mean harm"


@pytest.mark.parametrize("behaviours", [("mixed",), ("cut_in", "worst")])
def test_the_attack_of_one_scenario_names_its_lines_by_their_stacks(behaviours):
    drawing = attack(_table(TWO_STACKS, behaviours, scenario=["light"]))
    assert _names(drawing) == ["HJOP + SPC + MI", "OP + None"]
    assert _title(drawing) == (
        "Among 20 % of drivers who mean harm HJOP + SPC + MI has 0.2 collisions a drive, OP + None 0.3"
    )
