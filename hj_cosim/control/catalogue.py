"""Making the safety filter that the settings name."""

from dataclasses import fields

from hj_cosim.control.belief.believing_filter import BelievingFilter
from hj_cosim.control.contract import FilterInputs, SafetyFilter
from hj_cosim.control.spc.filter import SafetyPreservingFilter
from hj_cosim.errors import ConfigurationError
from hj_cosim.plugins import FILTER, construct, find_plugin, options_of
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.road import Road
from hj_cosim.settings import DEFAULT_DRIVERS, DriverSettings, FilterSettings, RobotSettings
from hj_cosim.vehicles.drivers import means_of


def make_filter(
    settings: FilterSettings,
    robot: RobotSettings,
    road: Road,
    table: ValueTable,
    step: float,
    drivers: DriverSettings = DEFAULT_DRIVERS,
) -> SafetyFilter:
    """Return the filter that `settings.kind` names, ours or a user's own, which are made in the same way.

    It is not guarded yet: `control.guard.GuardedFilter` does that, as the loop does.

    Args:
        settings: of all filters; `options` are the filter's own.
        robot: limits and body.
        road: the lanes.
        table: V.
        step: s, the time for which a control is held.
        drivers: what the other drivers' parameters are drawn from, of which filters are told the means.

    Raises:
        ConfigurationError: if there is no such filter, its options are wrong, or its solver is not installed.
        PluginError: if it cannot be imported or made.
    """
    plugin = find_plugin(FILTER, settings.kind)
    if settings.priority == "belief":
        if plugin is not SafetyPreservingFilter:
            raise ConfigurationError(
                f"filter.priority = 'belief' is of filter spc; {settings.kind} has no rows to weigh: leave it equal"
            )
        plugin = BelievingFilter
    inputs = FilterInputs(
        settings=settings,
        options=options_of(FILTER, plugin, settings.options),
        robot=robot,
        road=road,
        table=table,
        step=step,
        drivers=means_of(drivers),
    )
    return construct(FILTER, plugin, {field.name: getattr(inputs, field.name) for field in fields(inputs)})
