"""How much of its guarantee safety-preserving control keeps with the default table, and what the rest is lost to.

One line is the answer to whether the losses come from the time step: the same starts at a quarter of it. The last lines
are what other settings of the filter keep.
"""

import dataclasses

import pytest

from hj_cosim.reachability.table.store import load_table, solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import FilterSettings, GridSettings, TableSpecification
from hj_cosim.verification.guarantee import GuaranteeReport, RolloutSettings, measure_guarantee

MANY = RolloutSettings(rollouts=100_000)
FEWER = dataclasses.replace(MANY, rollouts=10_000)


@pytest.fixture(scope="module")
def table() -> ValueTable:
    return load_table("highway")


def uncapped(table: ValueTable) -> TableSpecification:
    """Return the default table's specification without the cap: the solver's own V."""
    return table.specification.model_copy(update={"capped_by_manoeuvres": False})


def along_p_x(table: ValueTable) -> TableSpecification:
    """Return it on a grid without shear, of about as many nodes."""
    grid = GridSettings(
        lower=(-165.0, *table.grid.lower[1:]), upper=(255.0, *table.grid.upper[1:]), shape=(85, *table.grid.shape[1:])
    )
    return uncapped(table).model_copy(update={"grid": grid, "parameters": {}})


def describe(name: str, report: GuaranteeReport) -> str:
    causes = ", ".join(f"{cause} {count}" for cause, count in report.causes.items())
    return (
        f"{name:34s}{report.rollouts:9d}{report.without_escape:10d}{report.entered_percent:10.3f}{report.collided:10d}{report.collided_unturned:10d}"
        f"{report.fall_median:8.2f}{report.fall_p99:8.2f}{report.unmet_percent:9.1f}   {causes}"
    )


def test_guarantee(benchmark, table):
    cases = {
        "worst other car": MANY,
        "random desires": dataclasses.replace(FEWER, desire="random"),
        "desires that lower V most": dataclasses.replace(FEWER, desire="collide"),
        "robot moves as the bicycle": dataclasses.replace(FEWER, model="bicycle"),
        "two of the worst": dataclasses.replace(FEWER, cars=2),
        "three of the worst": dataclasses.replace(FEWER, cars=3),
        "IDM driver, bicycle": dataclasses.replace(FEWER, others="driver", model="bicycle"),
        "on a bend of 1000 m": dataclasses.replace(FEWER, curvature=1.0 / 1000.0),
        "on a bend of 500 m": dataclasses.replace(FEWER, curvature=1.0 / 500.0),
        "on a bend of 300 m": dataclasses.replace(FEWER, curvature=1.0 / 300.0),
        "on an S of 300 m": dataclasses.replace(FEWER, curvature=1.0 / 300.0, half_wave=200.0),
        "3 s instead of 10": dataclasses.replace(FEWER, duration=3.0),
        "a quarter of the step": dataclasses.replace(FEWER, step=MANY.step / 4),
    }
    filters = {
        "SPC alone": FilterSettings(),
        "SPC alone, switching": FilterSettings(scheme="sw"),
        "SPC alone, recovery 3/s": FilterSettings(recovery=3.0),
        "SPC alone, epsilon 8 m": FilterSettings(epsilon=8.0),
        "SPC alone, both": FilterSettings(epsilon=8.0, recovery=3.0),
    }
    keeping = FilterSettings(keep_escape=True)
    reports = {name: measure_guarantee(table, settings, keeping) for name, settings in cases.items()}
    reports["switching"] = measure_guarantee(table, FEWER, FilterSettings(scheme="sw", keep_escape=True))
    reports |= {name: measure_guarantee(table, MANY, settings) for name, settings in filters.items()}
    for name, specification in {"no cap": uncapped(table), "grid along p_x, no cap": along_p_x(table)}.items():
        other = solve_table(specification)
        reports[f"SPC alone, {name}"] = measure_guarantee(other, FEWER)
        reports[name] = measure_guarantee(other, FEWER, keeping)
    benchmark.pedantic(
        measure_guarantee, args=(table, dataclasses.replace(MANY, rollouts=1000), keeping), rounds=3, iterations=1
    )
    columns = ("number", "no escape", "entered %", "collided", "unturned", "fall m", "p99", "unmet %")
    widths = (9, 10, 10, 10, 10, 8, 8, 9)
    heads = "".join(f"{column:>{width}s}" for column, width in zip(columns, widths, strict=True))
    print(f"\n{'rollouts':34s}{heads}   causes of entries")
    for name, report in reports.items():
        print(describe(name, report))
    assert all(sum(report.causes.values()) == report.entered for report in reports.values())
