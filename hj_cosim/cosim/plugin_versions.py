"""Which version of a user's own planner, filter and behaviours an episode is driven with."""

from hj_cosim.plugins import FILTER, PLANNER, content_of
from hj_cosim.settings import EpisodeConfig
from hj_cosim.traffic.rogues.catalogue import BEHAVIOUR


def plugin_versions(config: EpisodeConfig) -> dict[str, str]:
    """Return a hash of the file that each plug-in of a configuration is written in, by "planner REFERENCE" and so on.

    Of ours there is none, for the program's own version says it. What a file imports from others is not looked at.

    Raises:
        ConfigurationError, PluginError: if a plug-in is no longer there, or cannot be imported.
    """
    scenario = config.scenario
    behaviours = [scenario.rogues.behaviour, *(car.rogue for car in scenario.cars if car.rogue is not None)]
    named = [(PLANNER, config.planner.kind), (FILTER, config.filter.kind), *((BEHAVIOUR, one) for one in behaviours)]
    found = {f"{kind.noun} {reference}": content_of(kind, reference) for kind, reference in named}
    return {name: content for name, content in found.items() if content is not None}
