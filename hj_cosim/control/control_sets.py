"""The controls that a filter may choose from, as data: what the paper's control-set figure draws."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hj_cosim.control.problem.safety_problem import SafetyRows, SafetySolver
from hj_cosim.control.safety_filter import make_filter
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.settings import FilterSettings, RobotSettings, SimulationSettings

KINDS: tuple[Literal["spc", "rss"], ...] = ("spc", "rss")


@dataclass(frozen=True)
class ControlSet:
    """One filter's half-planes and choices at one instant; ω in rad/s, a in m/s²."""

    kind: str  # spc or rss
    box: np.ndarray  # (4,) lower and upper ω, lower and upper a
    rows: SafetyRows  # the half-planes p ω + q a >= −c
    polygon: np.ndarray  # (P, 2) corners (ω, a) of the intersection with the box, counter-clockwise; (0, 2) if empty
    desired: Control
    minimally_interventional: Control  # what MI chooses
    switching: Control  # what SW chooses


def intersection_polygon(rows: SafetyRows, box: np.ndarray) -> np.ndarray:
    """Return the box cut by all half-planes, (P, 2) corners (ω, a), counter-clockwise; (0, 2) where nothing is left.

    Args:
        rows: the half-planes.
        box: (4,) lower and upper ω, lower and upper a.
    """
    polygon = np.array([[box[0], box[2]], [box[1], box[2]], [box[1], box[3]], [box[0], box[3]]])
    for p, q, c in zip(rows.p, rows.q, rows.c, strict=True):
        polygon = _clip(polygon, float(p), float(q), float(c))
    return polygon


def _clip(polygon: np.ndarray, p: float, q: float, c: float) -> np.ndarray:
    """Return a convex polygon cut by p ω + q a + c >= 0 (Sutherland and Hodgman 1974)."""
    margin = polygon @ np.array([p, q]) + c
    kept: list[np.ndarray] = []
    for here in range(len(polygon)):
        there = (here + 1) % len(polygon)
        if margin[here] >= 0.0:
            kept.append(polygon[here])
        if (margin[here] >= 0.0) != (margin[there] >= 0.0):
            share = margin[here] / (margin[here] - margin[there])
            kept.append(polygon[here] + share * (polygon[there] - polygon[here]))
    return np.array(kept).reshape(-1, 2)


def control_sets(
    observations: Sequence[Observation],
    desired: Control,
    settings: FilterSettings,
    robot: RobotSettings,
    table: ValueTable,
    previous_omega: float,
) -> Mapping[str, ControlSet]:
    """Return the control sets of SPC and RSS at the last of some consecutive observations.

    RSS remembers how a pair became dangerous, so it needs the instants before: give it the observations since the
    pair was last safe, or the one alone, and it takes every dangerous pair for one that has always been so.

    Args:
        observations: one or more, in order; the sets are those of the last.
        desired: what the tracking controller asks for at the last.
        settings: ε, λ_3 and the RSS parameters; kind and scheme do not matter.
        robot: limits and body.
        table: the value function.
        previous_omega: ω of the step before the last, which SW holds, rad/s.

    Returns:
        "spc" and "rss".
    """
    return {kind: _control_set(kind, observations, desired, settings, robot, table, previous_omega) for kind in KINDS}


def _control_set(
    kind: Literal["spc", "rss"],
    observations: Sequence[Observation],
    desired: Control,
    settings: FilterSettings,
    robot: RobotSettings,
    table: ValueTable,
    previous_omega: float,
) -> ControlSet:
    interventional = settings.model_copy(update={"kind": kind, "scheme": "mi"})
    step = observations[-1].time - observations[-2].time if len(observations) > 1 else SimulationSettings().step
    safety_filter = make_filter(interventional, robot, table, step)
    result = [safety_filter.filter(observation, desired) for observation in observations][-1]
    switching = result.desired
    if result.intervening:
        solver = SafetySolver(settings.model_copy(update={"scheme": "sw"}), robot, Counter())
        solution = solver.solve(result.rows, previous_omega, result.desired.acceleration, result.available)
        switching = Control(solution.omega, solution.acceleration)
    return ControlSet(
        kind=kind,
        box=result.available,
        rows=result.rows,
        polygon=intersection_polygon(result.rows, result.available),
        desired=result.desired,
        minimally_interventional=result.control,
        switching=switching,
    )
