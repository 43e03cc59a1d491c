"""The errors that users see: one sentence each, shown without a traceback, exit status 2."""


class HjCosimError(Exception):
    """Something a user can put right; the message names the place, the value and the remedy."""


class ConfigurationError(HjCosimError):
    """A key, a value or a name in a configuration, a scenario or a table specification is wrong."""


class NetworkError(HjCosimError):
    """A SUMO network is missing, malformed, or its edges are no road that can be driven on."""


class ScenarioError(HjCosimError):
    """A scenario cannot be built: its cars do not fit, or its road is too short."""


class TableError(HjCosimError):
    """A value table is missing, broken, altered, or does not match its specification."""


class StateError(HjCosimError, ValueError):
    """States that a table is asked about have the wrong shape, or the wrong units."""


class RunFolderError(HjCosimError):
    """A run's or a study's folder is missing, incomplete, or already holds something."""


class SimulationError(HjCosimError):
    """SUMO or a solver failed in the middle of an episode."""


class DriveEnded(HjCosimError):
    """The robot cannot drive on, though nothing failed: an episode that is on its way keeps what it drove.

    Attributes:
        reason: a few words, as summary.json has them under `ended`.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class OutputError(HjCosimError):
    """A figure, an export or a report of an unknown kind was asked for, or of a run that does not hold its data."""


class WorkerError(HjCosimError):
    """The processes or the cluster that drive a study's episodes cannot be started or reached."""


class MetricError(HjCosimError):
    """A metric is written that is not declared, or asked for under a name that none has."""


class PluginError(HjCosimError):
    """A planner or a filter cannot be imported or made, or failed in the middle of an episode."""
