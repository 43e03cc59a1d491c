"""The safety filter as a Gymnasium wrapper: whatever a policy wants, it is asked every 0.02 s."""

from typing import Any

import gymnasium
import numpy as np

from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import SafetyFilter
from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.road import Road
from hj_cosim.settings import EpisodeConfig
from hj_cosim.training.environment import HighwayEnv


class SafetyFilterWrapper(gymnasium.Wrapper[np.ndarray, Any, np.ndarray, Any]):
    """Filters the controls of any policy in `hj_cosim/Highway-v0`, as a run does: the env's own `filter` settings.

    `info["changed"]` is the share of an action's steps in which the filter applied something else than was wanted.
    """

    def __init__(
        self, env: gymnasium.Env[np.ndarray, Any], filter: str | None = None, table: ValueTable | None = None
    ) -> None:
        """Put the filter in.

        Args:
            env: a HighwayEnv, or wrappers around one.
            filter: spc, rss, or one of one's own, as `run_episode` takes it by name; the env's setting unless given.
            table: V; that of the env's settings unless given, which is solved first if it has not been.

        Raises:
            ConfigurationError: if `env` is none of ours.
            TableError: if the table cannot be had.
        """
        super().__init__(env)
        inner = env.unwrapped
        if not isinstance(inner, HighwayEnv):
            raise ConfigurationError(f"SafetyFilterWrapper filters hj_cosim/Highway-v0, not a {type(inner).__name__}")
        kind = inner.config.filter.kind if filter is None else filter

        def make(config: EpisodeConfig, road: Road, of_robot: ValueTable) -> SafetyFilter:
            settings = config.filter.model_copy(update={"kind": kind})
            step, drivers = config.simulation.step, config.scenario.drivers
            return make_filter(settings, config.robot, road, of_robot, step, drivers)

        inner.filter_with(make, table or inner.load_tables())
