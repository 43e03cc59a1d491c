"""Every setting, typed and checked: what a run, a scenario and a value table are made of.

All models are frozen, refuse unknown keys and non-finite numbers, and are SI units throughout.
"""

from hj_cosim.settings.base import Settings, explanation, unit_of
from hj_cosim.settings.catalogue import SettingEntry, list_settings
from hj_cosim.settings.episode import MOST_RECORDED, PRESETS, EpisodeConfig, SimulationSettings, robot_and_filter
from hj_cosim.settings.filter import Backend, FilterSettings, RssParameters
from hj_cosim.settings.layers import (
    DEEPEST_TOML,
    LARGEST_TOML,
    LONGEST_TOML_LINE,
    assignment_texts,
    flattened,
    overlay,
    parse_assignment,
    parse_toml,
    read_toml,
    shown,
    toml_value,
    validate,
)
from hj_cosim.settings.own_simulation import OwnSimulationSettings
from hj_cosim.settings.planner import MOST_PREDICTION_STEPS, PlannerSettings
from hj_cosim.settings.recording import RecordingSettings
from hj_cosim.settings.robot import RobotSettings, TrackingSettings
from hj_cosim.settings.rogues import MIXED, RogueLimits, RogueSettings
from hj_cosim.settings.scenario import (
    DEFAULT_DRIVERS,
    CarStart,
    DriverSettings,
    KindDrivers,
    NetworkSettings,
    NormalDistribution,
    RobotStart,
    Scenario,
    StreamSettings,
    TrafficSettings,
    VehicleSettings,
)
from hj_cosim.settings.table import Boundary, GridSettings, Scheme, TableSpecification

__all__ = [
    "DEEPEST_TOML",
    "DEFAULT_DRIVERS",
    "LARGEST_TOML",
    "LONGEST_TOML_LINE",
    "MIXED",
    "MOST_PREDICTION_STEPS",
    "MOST_RECORDED",
    "PRESETS",
    "Backend",
    "Boundary",
    "CarStart",
    "DriverSettings",
    "EpisodeConfig",
    "FilterSettings",
    "GridSettings",
    "KindDrivers",
    "NetworkSettings",
    "NormalDistribution",
    "OwnSimulationSettings",
    "PlannerSettings",
    "RecordingSettings",
    "RobotSettings",
    "RobotStart",
    "RogueLimits",
    "RogueSettings",
    "RssParameters",
    "Scenario",
    "Scheme",
    "SettingEntry",
    "Settings",
    "SimulationSettings",
    "StreamSettings",
    "TableSpecification",
    "TrackingSettings",
    "TrafficSettings",
    "VehicleSettings",
    "assignment_texts",
    "explanation",
    "flattened",
    "list_settings",
    "overlay",
    "parse_assignment",
    "parse_toml",
    "read_toml",
    "robot_and_filter",
    "shown",
    "toml_value",
    "unit_of",
    "validate",
]
