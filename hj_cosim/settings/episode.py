"""Everything that an episode depends on, and the presets."""

import math
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings.base import Seconds, Settings
from hj_cosim.settings.filter import FilterSettings
from hj_cosim.settings.planner import PlannerSettings
from hj_cosim.settings.recording import RecordingSettings
from hj_cosim.settings.robot import RobotSettings, TrackingSettings
from hj_cosim.settings.scenario import Scenario

# Samples times cars of an episode, what does not fit into memory in its file: some 20 GB.
MOST_RECORDED = 1_000_000_000

STEP_TOLERANCE = 1e-6  # how far a traffic step may be from a whole number of steps, as a share


class SimulationSettings(Settings):
    """Clocks of an episode."""

    duration: Seconds = Field(30.0, gt=0, le=3600, description="recorded time")
    step: Seconds = Field(0.02, ge=0.001, le=0.1, description="of the robot: its control, its motion, what is recorded")
    traffic_step: Seconds = Field(
        0.1,
        ge=0.001,
        le=0.5,
        description="of SUMO, a multiple of simulation.step; cars move continuously within it",
    )
    plan_period: Seconds = Field(1.0, gt=0, le=3600, description="between plans; mppi has 0.1 unless given")
    settle_time: Seconds = Field(3.0, ge=0, le=3600, description="the traffic settles before the robot takes over")
    on_collision: Literal["stop", "continue"] = Field(
        "stop", description="whether the drive ends where the robot's body overlaps a car's"
    )

    @model_validator(mode="before")
    @classmethod
    def _traffic_step_fits_the_step(cls, data: Any) -> Any:
        """Take the usual traffic step, or the next smaller multiple of a step that is given alone."""
        if not isinstance(data, Mapping) or "traffic_step" in data or not _is_number(data.get("step")):
            return data
        usual, step = cls.model_fields["traffic_step"].default, data["step"]
        whole = max(math.floor(usual / step * (1.0 + STEP_TOLERANCE)), 1) if step > 0 else 1
        return {**data, "traffic_step": whole * step}

    @model_validator(mode="after")
    def _traffic_step_is_a_multiple(self) -> "SimulationSettings":
        steps = self.traffic_step / self.step
        if round(steps) < 1 or abs(steps - round(steps)) > STEP_TOLERANCE * steps:
            raise ValueError(
                f"simulation.traffic_step ({self.traffic_step:g} s) must be a multiple of simulation.step"
                f" ({self.step:g} s); for example {max(round(steps), 1) * self.step:g}"
            )
        return self


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


class EpisodeConfig(Settings):
    """Everything that an episode depends on; its run folder's config.toml."""

    seed: int = Field(0, ge=0, lt=2**63, description="of the traffic; the scenario's unless given")
    preset: Literal["best", "paper"] = Field("best", description="what measures best, or what the paper has")
    table: str = Field("highway", description="a name in value_tables/ or a path to a specification")
    robot: RobotSettings = Field(RobotSettings(), description="its body and limits")
    tracking: TrackingSettings = Field(TrackingSettings(), description="the tracking controller")
    planner: PlannerSettings = Field(PlannerSettings(), description="the planner")
    filter: FilterSettings = Field(FilterSettings(), description="the safety filter")
    simulation: SimulationSettings = Field(SimulationSettings(), description="the clocks")
    recording: RecordingSettings = Field(RecordingSettings(), description="what of the cars is written down")
    scenario: Scenario = Field(description="road, traffic and drivers")

    @model_validator(mode="after")
    def _fits_into_memory(self) -> "EpisodeConfig":
        traffic, simulation = self.scenario.traffic, self.simulation
        cars = traffic.count + traffic.count_behind + len(self.scenario.cars)
        if (cars + 1) * simulation.duration > MOST_RECORDED * simulation.step:
            raise ValueError(
                f"simulation.duration ({simulation.duration} s) of {cars} cars in steps of simulation.step"
                f" ({simulation.step} s) is more than is recorded, {MOST_RECORDED} samples of a car; take less"
            )
        return self

    @model_validator(mode="after")
    def _vehicle_is_in_a_simulation(self) -> "EpisodeConfig":
        own = self.scenario.own
        if not own.is_given and (own.ego or own.begin is not None):
            raise ValueError("scenario.own.ego and scenario.own.begin (--ego, --begin) are about a user's own .sumocfg")
        if not own.is_given and own.traffic != "theirs":
            raise ValueError(
                f"scenario.own.traffic = {own.traffic!r} (--traffic) is about a user's own .sumocfg; the cars of a"
                " scenario are driven by IDM and MOBIL already, so leave it out"
            )
        return self

    @model_validator(mode="after")
    def _robot_can_be_as_fast_as_it_starts(self) -> "EpisodeConfig":
        start, most = self.scenario.robot.speed, self.robot.speed_max
        if start > most:
            raise ValueError(
                f"scenario.robot.speed ({start:g} m/s) must not exceed robot.speed_max ({most:g} m/s);"
                " start slower, or raise the robot's limit"
            )
        return self

    @model_validator(mode="before")
    @classmethod
    def _seed_is_the_scenarios(cls, data: Any) -> Any:
        scenario = data.get("scenario") if isinstance(data, Mapping) else None
        if isinstance(scenario, Mapping) and "seed" in scenario and "seed" not in data:
            return {**data, "seed": scenario["seed"]}
        return data

    @model_validator(mode="before")
    @classmethod
    def _cars_are_recorded_as_usual(cls, data: Any) -> Any:
        """Record those near the robot of a user's own simulation, and all of a scenario's, unless it is said."""
        if not isinstance(data, Mapping):
            return data
        scenario, recording = data.get("scenario"), data.get("recording", {})
        if not isinstance(recording, Mapping) or "cars" in recording:
            return data
        own = scenario.get("own", {}) if isinstance(scenario, Mapping) else getattr(scenario, "own", {})
        file = own.get("file") if isinstance(own, Mapping) else getattr(own, "file", "")
        return {**data, "recording": {**recording, "cars": "near" if file else "all"}}


PRESETS: Mapping[str, Mapping[str, Any]] = {
    "best": {
        "robot": {"lateral_acceleration_max": 4.0},
        "tracking": {"lateral_acceleration_max": 2.4, "jerk_max": 8.0, "heading_max": 0.25},
        "planner": {"polite_braking": 3.0, "heading_max": 0.25},
        "filter": {
            "epsilon": 0.5,
            "approach": 4.0,
            "smooth_gradient": True,
            "keep_on_road": True,
            "keep_escape": True,
            "evade": True,
            "solver": "enumeration",
        },
    },
    "paper": {
        "table": "highway_paper",
        "planner": {"expansions": 40, "value_clip": 5.0, "speed_floor": 15.0},
        "scenario": {"drivers": {"desired_speed": {"mean": 23.0, "deviation": 1.5}}},
    },
}


def robot_and_filter(preset: str) -> tuple[RobotSettings, FilterSettings]:
    """Return the robot and the filter of a preset, for who judges a filter without a drive.

    Raises:
        ConfigurationError: if there is no such preset.
    """
    if preset not in PRESETS:
        raise ConfigurationError(f"no preset is called {preset!r}; choose one of {', '.join(PRESETS)}")
    chosen = PRESETS[preset]
    robot = RobotSettings.model_validate(chosen.get("robot", {}))
    return robot, FilterSettings.model_validate(chosen.get("filter", {}))
