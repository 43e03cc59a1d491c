"""Making the planner that the settings name."""

from dataclasses import fields

from hj_cosim.planning.contract import Planner, PlannerInputs
from hj_cosim.plugins import PLANNER, construct, find_plugin, options_of
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.drivers import means_of


def make_planner(
    settings: PlannerSettings, robot: RobotSettings, drivers: DriverSettings, road: Road, table: ValueTable
) -> Planner:
    """Return the planner that `settings.kind` names, ours or a user's own, which are made in the same way.

    Args:
        settings: of all planners; `options` are the planner's own.
        robot: its body and limits.
        drivers: what the other drivers' parameters are drawn from, of which planners are told the means.
        road: the lanes.
        table: V.

    Raises:
        ConfigurationError: if there is no such planner, or its options are wrong.
        PluginError: if it cannot be imported or made.
    """
    plugin = find_plugin(PLANNER, settings.kind)
    inputs = PlannerInputs(
        settings=settings,
        options=options_of(PLANNER, plugin, settings.options),
        robot=robot,
        drivers=means_of(drivers),
        road=road,
        table=table,
    )
    return construct(PLANNER, plugin, {field.name: getattr(inputs, field.name) for field in fields(inputs)})
