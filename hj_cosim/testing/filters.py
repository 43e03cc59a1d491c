"""The suite for safety filters."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import FilterDecision, SafetyFilter
from hj_cosim.control.guard import NOT_JUDGED, GuardedFilter
from hj_cosim.plugins import FILTER, given
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings
from hj_cosim.testing.expectations import answered, left_as_it_was, require
from hj_cosim.testing.scenes import ROAD, scenes, target_table

STEP = 0.02  # s
LIMIT_TOLERANCE = 1e-9
_UNLIMITED = RobotSettings(omega_max=10.0, acceleration_min=-100.0, acceleration_max=100.0)


def check_filter(safety_filter: str | type, settings: FilterSettings | None = None) -> None:
    """Check that a filter keeps its contract, in scenes from an empty road to one full of cars.

    It is made as a run makes it; its controls are finite and within the robot's limits, the same whenever the same is
    asked of a new one, and do not depend on being prepared; what it is handed it leaves as it was. Where a car is
    nowhere, a run brakes without asking it, and it goes on afterwards.

    Args:
        safety_filter: a class, or a reference such as "mine.py:Cautious".
        settings: the group `filter` to make it with, `options` among it; `kind` does not matter.

    Raises:
        ContractError: one sentence on the first thing that is wrong.
        HjCosimError: if it cannot be made.
    """
    reference = safety_filter if isinstance(safety_filter, str) else given(FILTER, safety_filter)
    chosen = (settings or FilterSettings()).model_copy(update={"kind": reference})
    decisions = _decisions(_made(chosen), reference, prepared=True)
    again = _decisions(_made(chosen), reference, prepared=False)
    for first, second in zip(decisions, again, strict=True):
        same = (first.control, first.constraints, first.slack) == (second.control, second.constraints, second.slack)
        require(same, f"{reference}: the same scenes were filtered differently; a run has to be repeatable")
    _check_that_it_goes_on_after_what_cannot_be(_made(chosen), reference)


def _made(settings: FilterSettings) -> SafetyFilter:
    return make_filter(settings, RobotSettings(), ROAD, target_table(), STEP)


def _decisions(safety_filter: SafetyFilter, reference: str, prepared: bool) -> list[FilterDecision]:
    """Return what a filter decides in all scenes, one after the other, for every corner of the limits and between."""
    robot = RobotSettings()
    guarded = GuardedFilter(safety_filter, _UNLIMITED)  # which shows what the filter answers by itself
    desired = [Control(0.0, 0.0)] + [
        Control(omega, acceleration)
        for omega in (-robot.omega_max, robot.omega_max)
        for acceleration in (robot.acceleration_min, robot.acceleration_max)
    ]
    decisions: list[FilterDecision] = []
    for number, scene in enumerate(scenes()):
        values, wanted = car_values(target_table(), scene), desired[number % len(desired)]
        where = f"asked with {len(scene.x)} cars around, the robot at {scene.robot[3]:g} m/s"
        if prepared and number == 0:
            with left_as_it_was("prepare", scene, values):
                answered(partial(guarded.prepare, scene, values), where)
        with left_as_it_was("filter", scene, values):
            decision = answered(partial(guarded.filter, scene, values, wanted), where)
        require(
            NOT_JUDGED not in guarded.counts,
            f"{reference}: its control is not finite, {where}; only what cannot be judged may be answered so",
        )
        _require_within(decision.control, robot, f"{reference}: {where}")
        decisions.append(decision)
    return decisions


def _require_within(control: Control, robot: RobotSettings, where: str) -> None:
    within = (
        abs(control.omega) <= robot.omega_max + LIMIT_TOLERANCE
        and robot.acceleration_min - LIMIT_TOLERANCE <= control.acceleration <= robot.acceleration_max + LIMIT_TOLERANCE
    )
    require(within, f"{where}: ω = {control.omega:g} rad/s, a = {control.acceleration:g} m/s² is beyond the limits")


def _check_that_it_goes_on_after_what_cannot_be(safety_filter: SafetyFilter, reference: str) -> None:
    """Check that a filter answers on after a step in which a car was nowhere."""
    guarded = GuardedFilter(safety_filter, RobotSettings())
    *_, scene = (each for each in scenes() if len(each.x))
    nowhere = replace(scene, x=np.full(len(scene.x), math.nan))
    for seen in (nowhere, scene):
        values = car_values(target_table(), seen)
        answered(partial(guarded.filter, seen, values, Control(0.0, 0.0)), "after a car was nowhere")
    require(guarded.counts[NOT_JUDGED] == 1, f"{reference}: it cannot judge any more after a car was nowhere once")
