"""What the benchmarks are to reach, a row each; `make bench` ends with the table that is made of what they report."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

FILE = Path(".benchmarks") / "goals.md"


@dataclass(frozen=True)
class Goal:
    """A row: what is measured, and what it is to be at least, or at most."""

    what: str
    wanted: float
    unit: str = ""
    at_least: bool = False
    beside: str = ""  # the peer or the floor that is measured in the same run


@dataclass(frozen=True)
class Measured:
    """What a benchmark found."""

    has: float
    beside: float | None = None  # the peer's or the floor's, in the row's unit


# By the names that benchmarks report them under.
GOALS: Mapping[str, Goal] = {
    "solver weno5": Goal("solve 41x25x13x13x13, WENO5", 40.0, "x", True, "hj_reachability, = 1"),
    "solver first_order": Goal("the same, first order", 60.0, "x", True, "hj_reachability, = 1"),
    "duties and tyres": Goal("the same with duties and tyres", 1.1, "x", beside="a Hamiltonian of fixed limits, = 1"),
    "solver memory": Goal("solver's memory", 16.0, "bytes/cell", beside="hj_reachability"),
    "look-ups": Goal("value and gradient at 100 states", 12.0, "µs", beside="SciPy, the value alone"),
    "filter median": Goal("a filter step, 100 cars, median", 60.0, "µs", beside="qpsolvers with daqp alone"),
    "filter tail": Goal("a filter step, 100 cars, 99 %", 150.0, "µs", beside="qpsolvers with daqp alone"),
    "filter sizes median": Goal("the same with 3 size classes, median", 60.0, "µs", beside="as above"),
    "filter sizes tail": Goal("the same with 3 size classes, 99 %", 150.0, "µs", beside="as above"),
    "filter bend median": Goal("the same on a bend, median", 60.0, "µs", beside="as above"),
    "filter bend tail": Goal("the same on a bend, 99 %", 150.0, "µs", beside="as above"),
    "planner 11": Goal("planner, 11 cars in the tree", 200_000.0, "expansions/s", True, "rl-agents, elsewhere"),
    "planner 100": Goal("planner, 100 cars in the tree", 40_000.0, "expansions/s", True, "rl-agents, elsewhere"),
    "episode": Goal("an episode of `paper`, 30 s, 100 cars", 0.45, "s", beside="SUMO's steps of it"),
    "idle": Goal("idle planner, no filter, against bare SUMO steps", 0.6, "x", beside="bare SUMO, = 1"),
    "table of the paper": Goal("the paper's table, 200 episodes, 2 workers", 70.0, "s"),
    "share of 1000": Goal("1,000 vehicles: our share of SUMO's own steps", 0.5, "x", beside="SUMO's steps, = 1"),
    "share of 5000": Goal("5,000 vehicles: our share of SUMO's own steps", 0.2, "x", beside="SUMO's steps, = 1"),
    "curved road": Goal("a curved road against a straight one", 1.2, "x", beside="the straight one, = 1"),
    "make run": Goal("`make run` on a fresh machine", 75.0, "s"),
    "scenarios": Goal("`hj-cosim scenarios`", 0.6, "s", beside="Python with NumPy and pydantic"),
    "figure": Goal("`hj-cosim figure timeline`", 1.5, "s", beside="Python with Matplotlib"),
    "run": Goal("`hj-cosim run`, warm, with its figures", 3.0, "s", beside="Python with Numba, SUMO, Matplotlib"),
}


def verdict(goal: Goal, has: float) -> str:
    """Return whether a goal is met, or by which factor it is not."""
    factor = goal.wanted / has if goal.at_least else has / goal.wanted
    return "met" if factor <= 1.0 else f"short by {factor:.2g}x"


def table(found: Mapping[str, Measured], left_out: Mapping[str, str]) -> str:
    """Return a row for every goal, in Markdown.

    Args:
        found: what was measured, by the goals' names.
        left_out: why what was not measured was not.
    """
    rows = [("what", "has", "wanted", "met", "beside it, in the same run")]
    for name, goal in GOALS.items():
        wanted = f"{'>=' if goal.at_least else '<='} {_number(goal.wanted)} {goal.unit}".rstrip()
        if name not in found:
            rows.append((goal.what, "–", wanted, left_out.get(name, "not measured in this run"), goal.beside))
            continue
        has, beside = found[name].has, found[name].beside
        peer = goal.beside if beside is None else f"{goal.beside}: {_number(beside)} {goal.unit}".rstrip()
        rows.append((goal.what, f"{_number(has)} {goal.unit}".rstrip(), wanted, verdict(goal, has), peer))
    return "\n".join(_lines(rows)) + "\n"


def _lines(rows: list[tuple[str, ...]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for place, row in enumerate(rows):
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield f"| {' | '.join(cells)} |"
        if place == 0:
            yield f"|{'|'.join('-' * (width + 2) for width in widths)}|"


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}"


def busy() -> str:
    """Return how busy the machine is: times on the wall are longer on one that does other things."""
    return f"{os.cpu_count()} cores, of which {os.getloadavg()[0]:.1f} were at work over the last minute"
