"""The suite for planners."""

from dataclasses import replace

from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import Plan, Planner
from hj_cosim.planning.guard import GuardedPlanner
from hj_cosim.plugins import PLANNER, given
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.testing.expectations import answered, left_as_it_was, require
from hj_cosim.testing.scenes import ROAD, scenes, target_table


def check_planner(planner: str | type, settings: PlannerSettings | None = None) -> None:
    """Check that a planner keeps its contract, in scenes from an empty road to one full of cars.

    It is made as a run makes it; its plans are for lanes of the road and speeds that exist, the same whenever the same
    is asked of a new one, and do not depend on being prepared; what it is handed it leaves as it was.

    Args:
        planner: a class, or a reference such as "mine.py:KeepRight".
        settings: the group `planner` to make it with, `options` among it; `kind` does not matter.

    Raises:
        ContractError: one sentence on the first thing that is wrong.
        HjCosimError: if it cannot be made.
    """
    reference = planner if isinstance(planner, str) else given(PLANNER, planner)
    chosen = (settings or PlannerSettings()).model_copy(update={"kind": reference})
    plans = _plans(_made(chosen), prepared=True)
    again = _plans(_made(chosen), prepared=False)
    for first, second in zip(plans, again, strict=True):
        same = replace(first, statistics=None) == replace(second, statistics=None)
        require(same, f"{reference}: the same scenes were planned for differently; a run has to be repeatable")


def _made(settings: PlannerSettings) -> Planner:
    return make_planner(settings, RobotSettings(), DriverSettings(), ROAD, target_table())


def _plans(planner: Planner, prepared: bool) -> list[Plan]:
    """Return what a planner plans for all scenes, one after the other."""
    guarded = GuardedPlanner(planner, ROAD)
    plans: list[Plan] = []
    for number, scene in enumerate(scenes()):
        target = Target(ROAD.lane_at(float(scene.robot[1]), float(scene.robot[0])), float(scene.robot[3]))
        plans.append(_plan(guarded, scene, target, prepared and number == 0))
    return plans


def _plan(guarded: GuardedPlanner, scene: Observation, target: Target, prepared: bool) -> Plan:
    where = f"asked with {len(scene.x)} cars around, the robot at {scene.robot[3]:g} m/s"
    if prepared:
        with left_as_it_was("prepare", scene):
            answered(lambda: guarded.prepare(scene), where)
    with left_as_it_was("plan", scene):
        return answered(lambda: guarded.plan(scene, target), where)
