"""Every knob, typed and checked: what a run, a scenario and a value table are made of.

All models are frozen, refuse unknown keys and non-finite numbers, and are SI units throughout.
"""

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from hj_cosim.errors import ConfigurationError

Scheme = Literal["first_order", "eno2", "weno3", "weno5"]
Boundary = Literal["linear", "away_from_zero", "periodic"]
# What one action of the planner's tree is predicted in, at most.
MOST_PREDICTION_STEPS = 1000
# Samples times cars of an episode, which is kept in memory until it is written: some 4 GB.
MOST_RECORDED = 100_000_000

Backend = Literal["daqp", "osqp", "quadprog", "piqp", "clarabel"]


class Settings(BaseModel):
    """A group of knobs: frozen, no unknown keys, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class RobotSettings(Settings):
    """The robot's body and limits (paper, case study; SPEC section 4)."""

    length: float = Field(5.0, ge=0.1, le=100, description="m")
    width: float = Field(2.0, ge=0.1, le=20, description="m")
    wheelbase: float = Field(5.0, ge=0.1, le=100, description="m, the paper's L")
    omega_max: float = Field(0.3, ge=0.001, le=10, description="rad/s, limit on |omega_r|")
    acceleration_min: float = Field(-6.0, ge=-100, le=-0.01, description="m/s²")
    acceleration_max: float = Field(4.0, ge=0.01, le=100, description="m/s²")
    speed_max: float = Field(40.0, ge=0.1, le=1000, description="m/s")


class TrackingSettings(Settings):
    """Gains of the closed-loop tracking controller (paper, eq. case study closed-loop controller)."""

    k_theta: float = Field(5.0, gt=0)
    k_1: float = Field(2.0, gt=0)
    k_2: float = Field(1.67, gt=0)
    heading_max: float = Field(0.4, gt=0, lt=1.57, description="rad, towards the lane; the value table reaches 0.4")


class PlannerSettings(Settings):
    """Optimistic planning and its reward (paper, section Planner Dynamics and Reward Function)."""

    kind: str = Field(
        "hjop",
        description="hjop, op, idle, a name that a package registers, FILE.py:Class or package.module:Class",
        examples=["hjop", "op", "idle"],
    )
    gamma_r: float = Field(0.9, ge=0, le=1, description="weight of the driving reward in HJOP; OP has 1")
    value_clip: float = Field(8.0, gt=0, description="m, the HJI reward is clipped to ± this")
    expansions: int = Field(300, ge=1, le=1_000_000, description="node expansions per plan, some 4 to 6 ms of them")
    discount: float = Field(0.9, gt=0, lt=1, description="γ of the tree search")
    speed_weight: float = Field(0.4, ge=0, description="γ_1")
    lane_weight: float = Field(1.0, ge=0, description="γ_2")
    crash_weight: float = Field(1.0, ge=0, description="γ_3")
    speed_low: float = Field(15.0, ge=0, description="m/s, where the speed reward is 0")
    speed_high: float = Field(30.0, gt=0, description="m/s, where the speed reward is γ_1")
    speed_step: float = Field(1.0, gt=0, description="m/s, what one action adds to the planned speed")
    speed_window: float = Field(4.0, gt=0, description="m/s, the planned speed stays this near the robot's")
    speed_floor: float = Field(
        0.0, ge=0, description="m/s, nothing slower is planned; 15, the paper's lower limit, does not follow a jam"
    )
    action_time: float = Field(1.0, gt=0, description="s, the duration of one action in the tree")
    sensing_range: float = Field(120.0, gt=0, description="m, cars within it enter the tree")
    prediction_step: float = Field(0.25, gt=0, description="s, about the step of the predicted car following")
    lane_change_time: float = Field(2.0, gt=0, description="s, in which the tracked robot gets one lane across")
    others_lane_change_time: float = Field(3.0, gt=0, description="s, in which the other cars do")
    speed_response: float = Field(0.6, gt=0, description="s, time constant of the tracked speed, 1/K_2")
    options: dict[str, Any] = Field({}, description="settings that a planner of one's own brings")

    @model_validator(mode="after")
    def _speeds_are_ordered(self) -> "PlannerSettings":
        if self.speed_high <= self.speed_low:
            raise ValueError(f"speed_high ({self.speed_high}) must exceed speed_low ({self.speed_low})")
        if self.speed_floor > self.speed_low:
            raise ValueError(f"speed_floor ({self.speed_floor}) must not exceed speed_low ({self.speed_low})")
        if self.action_time > MOST_PREDICTION_STEPS * self.prediction_step:
            raise ValueError(
                f"prediction_step ({self.prediction_step}) must be at least action_time ({self.action_time}) /"
                f" {MOST_PREDICTION_STEPS}"
            )
        return self


class RssParameters(Settings):
    """Parameters of the RSS distances (Shalev-Shwartz et al. 2017)."""

    response_time: float = Field(0.3, ge=0, description="s, ρ")
    acceleration: float = Field(3.0, ge=0, description="m/s², a_accel during the response time")
    brake_min: float = Field(6.0, gt=0, description="m/s², b_min, what the rear car brakes at least")
    brake_max: float = Field(6.0, gt=0, description="m/s², b_max, what the front car brakes at most")
    lateral_acceleration: float = Field(0.2, ge=0, description="m/s²")
    lateral_brake: float = Field(0.8, gt=0, description="m/s²")
    lateral_margin: float = Field(0.1, ge=0, description="m, μ")


class FilterSettings(Settings):
    """The safety filter between the tracking controller and the robot."""

    kind: str = Field(
        "spc",
        description="spc, rss, none, a name that a package registers, FILE.py:Class or package.module:Class",
        examples=["spc", "rss", "none"],
    )
    scheme: Literal["mi", "sw"] = "mi"
    epsilon: float = Field(2.0, ge=0, description="m, a car with V <= ε is in K")
    recovery: float = Field(
        0.0, ge=0, le=50, description="1/s, κ: below ε V has to rise by κ (ε − V), κ ε at most; the paper has 0"
    )
    slack_weight: float = Field(10.0, gt=0, description="λ_3; the paper has 1")
    keep_escape: bool = Field(
        False,
        description="SPC's control gives way to an escaping manoeuvre where it would leave none; not in the paper",
    )
    solver: Backend = Field("daqp", description="quadprog may never end where many cars are at one place")
    rss: RssParameters = RssParameters(response_time=0.5, brake_min=4.0, brake_max=8.0)
    options: dict[str, Any] = Field({}, description="settings that a filter of one's own brings")


class SimulationSettings(Settings):
    """Clocks of an episode."""

    duration: float = Field(30.0, gt=0, le=3600, description="s, recorded time")
    step: float = Field(0.02, ge=0.001, le=0.1, description="s, control and traffic step")
    plan_period: float = Field(1.0, gt=0, le=3600, description="s between plans")
    settle_time: float = Field(3.0, ge=0, le=3600, description="s that the traffic settles before the robot takes over")
    on_collision: Literal["stop", "continue"] = "stop"


class NormalDistribution(Settings):
    """A normal distribution truncated at ± `truncation` standard deviations."""

    mean: float = Field(gt=0)
    deviation: float = Field(ge=0)
    truncation: float = Field(2.5, ge=0.1, description="what lies beyond is drawn again")

    @model_validator(mode="after")
    def _stays_positive(self) -> "NormalDistribution":
        if self.mean - self.truncation * self.deviation <= 0:
            raise ValueError(
                f"mean {self.mean} with deviation {self.deviation} reaches zero within {self.truncation} deviations;"
                " take a smaller deviation"
            )
        return self


class DriverSettings(Settings):
    """What background drivers' IDM and MOBIL parameters are drawn from; the planner knows the means only.

    The desired speed is calibrated on SUMO, seeds 100 to 319, the same for all stacks: at the paper's density IDM
    keeps some 2 m/s below what drivers desire. HJOP + SPC + MI drove 22.0 m/s at a mean of 23 and 24.2 m/s at 25 in
    the preset `best`; in the preset `paper` a mean of 23 gave 21.9 m/s (the paper: 22.0), 22 gave 20.6 m/s.
    """

    desired_speed: NormalDistribution = Field(NormalDistribution(mean=24.0, deviation=1.5), description="m/s")
    max_acceleration: NormalDistribution = Field(NormalDistribution(mean=3.0, deviation=0.3), description="m/s²")
    comfortable_deceleration: NormalDistribution = Field(
        NormalDistribution(mean=5.0, deviation=0.5), description="m/s²"
    )
    time_headway: NormalDistribution = Field(NormalDistribution(mean=1.5, deviation=0.15), description="s")
    minimum_gap: NormalDistribution = Field(
        NormalDistribution(mean=5.0, deviation=0.5), description="m, bumper to bumper"
    )
    exponent: float = Field(4.0, gt=0, description="IDM's δ")
    politeness: float = Field(0.0, ge=0, le=1, description="MOBIL's, 0 is selfish")
    gain_threshold: float = Field(0.2, ge=0, description="m/s², what a lane change has to gain")
    safe_braking: float = Field(2.0, gt=0, description="m/s², what it may ask of the new follower")


class NetworkSettings(Settings):
    """Which straight edge of which SUMO network is driven on."""

    file: str = Field(
        "four_lanes.net.xml",
        description="a .net.xml or .net.xml.gz beside the scenario, in sumo_net/, or an absolute path",
    )
    edge: str = "highway"


class TrafficSettings(Settings):
    """How many cars are drawn, and how dense, when the episode begins."""

    count: int = Field(100, ge=0, le=5000, description="cars ahead of the robot")
    count_behind: int = Field(0, ge=0, le=5000, description="cars behind it")
    density: float | None = Field(None, gt=0, description="cars per km and lane, in place of spacing_factor")
    spacing_factor: float = Field(1.0, gt=0, description="multiplies the mean spacing 1.5 v exp(-5 lanes/30)")
    spacing_jitter: float = Field(0.1, ge=0, lt=1, description="± share of the spacing")
    speed_low: float = Field(23.0, ge=0, description="m/s at the start, at most what IDM holds at its gap")
    speed_high: float = Field(25.0, gt=0, description="m/s at the start")
    check_collisions: bool = Field(True, description="SUMO looks for overlapping cars; slow beyond some 300 cars")

    @model_validator(mode="after")
    def _is_consistent(self) -> "TrafficSettings":
        if self.speed_high < self.speed_low:
            raise ValueError(f"speed_high ({self.speed_high}) must be at least speed_low ({self.speed_low})")
        if self.density is not None and self.spacing_factor != 1.0:
            raise ValueError("density and spacing_factor say the same thing twice; keep one of them")
        return self


class CarStart(Settings):
    """One car of a hand-made scene."""

    lane: int = Field(ge=0, description="0 is the right-most")
    x: float = Field(description="m, its centre ahead of the robot's; negative behind it")
    speed: float = Field(ge=0, description="m/s, at the start")
    desired_speed: float | None = Field(None, gt=0, description="m/s; drawn like any driver's when left out")


class RobotStart(Settings):
    """Where the robot stands when the episode begins."""

    lane: int = Field(1, ge=0, description="0 is the right-most")
    speed: float = Field(24.0, ge=0, description="m/s, at most what IDM holds at its gap")


class Scenario(Settings):
    """What a user swaps: road, traffic, drivers, the robot's start."""

    name: str
    description: str = ""
    seed: int = Field(0, ge=0, lt=2**63, description="of an episode that is given no other")
    network: NetworkSettings = NetworkSettings()
    traffic: TrafficSettings = TrafficSettings()
    drivers: DriverSettings = DriverSettings()
    robot: RobotStart = RobotStart()
    cars: tuple[CarStart, ...] = Field((), description="cars at given places, beside the drawn ones")

    @property
    def is_hand_made(self) -> bool:
        """Whether nothing is drawn: such a scene begins exactly as it is written, without settling first."""
        return self.traffic.count == 0 and self.traffic.count_behind == 0


class GridSettings(Settings):
    """A regular grid: one entry an axis, in the order of the state."""

    lower: tuple[float, ...] = Field(description="the first node")
    upper: tuple[float, ...] = Field(description="the last node; of a periodic axis, where it repeats")
    shape: tuple[int, ...] = Field(description="nodes an axis, 7 or more, 200 million in all at most")
    boundary: tuple[Boundary, ...] | None = Field(None, description="what lies beyond; the dynamics' own unless given")

    @model_validator(mode="after")
    def _is_a_grid(self) -> "GridSettings":
        counts = {len(self.lower), len(self.upper), len(self.shape), len(self.boundary or self.shape)}
        if len(counts) > 1:
            raise ValueError("lower, upper, shape and boundary must have one entry per axis each")
        for axis, (low, high, nodes) in enumerate(zip(self.lower, self.upper, self.shape, strict=True)):
            if low >= high:
                raise ValueError(f"lower ({low}) must be below upper ({high}) on axis {axis}")
            if nodes < 7:
                raise ValueError(f"shape ({nodes}) must be 7 or more on axis {axis}, as wide as the widest stencil")
        if math.prod(self.shape) > 200_000_000:
            raise ValueError(f"shape has {math.prod(self.shape)} nodes; 200 million is the most")
        return self


class TableSpecification(Settings):
    """What a value table is solved from; a TOML file in value_tables/."""

    description: str = ""
    dynamics: str = Field(description="highway, air3d, double_integrator, or a Python file beside the specification")
    grid: GridSettings
    horizon: float = Field(3.0, gt=0, le=60, description="s, how far the game looks ahead")
    scheme: Scheme = Field("weno5", description="spatial derivatives")
    runge_kutta: Literal[1, 2, 3] | None = Field(None, description="order in time; the scheme's own unless given")
    cfl: float = Field(0.75, gt=0, le=1, description="time step in units of the largest stable one")
    clamp: bool = Field(True, description="keep values within [min V0, V0], as the exact solution does")
    state_limits: bool = Field(True, description="an input that would leave the grid is not available")
    margin: float = Field(0.0, ge=0, description="subtracted from the solved values, to err on the safe side")
    capped_by_manoeuvres: bool = Field(
        False, description="highway game: no value is above what the best of some manoeuvres guarantees"
    )
    parameters: dict[str, float] = Field(default_factory=dict, description="of the dynamics, over their defaults")


class EpisodeConfig(Settings):
    """Everything that an episode depends on; its run folder's config.toml."""

    seed: int = Field(0, ge=0, lt=2**63)
    preset: Literal["best", "paper"] = "best"
    table: str = Field("highway", description="a name in value_tables/ or a path to a specification")
    robot: RobotSettings = RobotSettings()
    tracking: TrackingSettings = TrackingSettings()
    planner: PlannerSettings = PlannerSettings()
    filter: FilterSettings = FilterSettings()
    simulation: SimulationSettings = SimulationSettings()
    scenario: Scenario

    @model_validator(mode="after")
    def _fits_into_memory(self) -> "EpisodeConfig":
        traffic, simulation = self.scenario.traffic, self.simulation
        cars = traffic.count + traffic.count_behind + len(self.scenario.cars)
        if (cars + 1) * simulation.duration > MOST_RECORDED * simulation.step:
            raise ValueError(
                f"simulation.duration ({simulation.duration} s) of {cars} cars in steps of simulation.step"
                f" ({simulation.step} s) is more than is kept in memory, {MOST_RECORDED} samples of a car; take less"
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


PRESETS: Mapping[str, Mapping[str, Any]] = {
    "best": {"filter": {"keep_escape": True}},
    "paper": {
        "table": "highway_paper",
        "planner": {"expansions": 40, "value_clip": 5.0, "speed_floor": 15.0},
        "scenario": {"drivers": {"desired_speed": {"mean": 23.0, "deviation": 1.5}}},
    },
}

Model = TypeVar("Model", bound=Settings)


LARGEST_TOML = 2_000_000  # bytes; a scene of 5000 cars at given places has a fifth of it
DEEPEST_TOML = 20  # tables and arrays within each other
LONGEST_TOML_LINE = 5000  # characters; the time that tomllib takes for a key grows with the square of its parts
_LONGEST_SHOWN = 100  # characters of a wrong key or value in a message


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        ConfigurationError: if it cannot be read, is not TOML, or is larger or deeper than LARGEST_TOML, DEEPEST_TOML.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_TOML + 1)
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    if len(content) > LARGEST_TOML:
        raise ConfigurationError(f"{path} is too large; {LARGEST_TOML / 1e6:g} MB of TOML is the most")
    try:
        return parse_toml(content.decode("utf-8"))
    except ValueError as error:
        raise ConfigurationError(f"{path} is not TOML: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text.

    Raises:
        ValueError: if it is not TOML, deeper than DEEPEST_TOML, or a line is longer than LONGEST_TOML_LINE.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > LONGEST_TOML_LINE:
            raise ValueError(f"line {number} has {len(line)} characters; {LONGEST_TOML_LINE} is the most")
    too_deep = f"it has more than {DEEPEST_TOML} tables and arrays within each other"
    try:
        data = tomllib.loads(text)
    except RecursionError as error:
        raise ValueError(too_deep) from error
    within: list[Any] = [data]
    for _ in range(DEEPEST_TOML):
        below = [value.values() if isinstance(value, dict) else value for value in within]
        within = [value for values in below for value in values if isinstance(value, dict | list)]
        if not within:
            return data
    raise ValueError(too_deep)


def validate(model: type[Model], data: Mapping[str, Any], source: str, table: str = "") -> Model:
    """Return `data` as `model`.

    Args:
        model: what it should be.
        data: unchecked.
        source: where it comes from, for the message.
        table: the part of the model that the source states; in the message, keys in it are called as they are there.

    Raises:
        ConfigurationError: one sentence that names the source, the key, the value and what would be right.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        within = first["loc"][:1] == (table,)
        key = shown(_key_in_toml(first["loc"][1:] if within else first["loc"]) or "the whole")
        if first["type"] == "extra_forbidden":
            known = ", ".join(_fields_at(model, first["loc"][:-1]))
            raise ConfigurationError(f"{source}: unknown key {key!r}; known keys are {known}") from error
        reason = first["msg"].removeprefix("Value error, ")
        given = "" if first["type"] in ("missing", "value_error") else f" = {shown(repr(first['input']))}"
        raise ConfigurationError(f"{source}: {key}{given}: {reason[:1].lower()}{reason[1:]}") from error


def _key_in_toml(location: tuple[int | str, ...]) -> str:
    """Return a place within a model as one finds it in TOML: `traffic.count`, or `[[cars]] entry 1, lane`."""
    for depth, part in enumerate(location):
        if isinstance(part, int):
            array, rest = ".".join(map(str, location[:depth])), _key_in_toml(location[depth + 1 :])
            return f"[[{array}]] entry {part + 1}, {rest}" if rest else f"{array}, entry {part + 1}"
    return ".".join(map(str, location))


def shown(text: str) -> str:
    """Return a text that fits into a sentence: its beginning, where it is longer."""
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def _fields_at(model: type[Settings], location: tuple[int | str, ...]) -> Iterable[str]:
    """Return the keys of the group of knobs at a place within a model; a list's groups all have the same."""
    for part in location:
        if isinstance(part, str):
            annotation = model.model_fields[part].annotation
            groups = [kind for kind in (annotation, *get_args(annotation)) if _is_group(kind)]
            model = groups[0]
    return model.model_fields


def _is_group(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Settings)


def overlay(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` with the values of `top` laid over it, table by table."""
    merged = dict(base)
    for key, value in top.items():
        below = merged.get(key)
        merged[key] = overlay(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged


def parse_assignment(text: str) -> dict[str, Any]:
    """Return `planner.gamma_r=0.8` as `{"planner": {"gamma_r": 0.8}}`; the value is TOML, or else a string.

    Raises:
        ConfigurationError: if there is no `=` or no key.
    """
    key, separator, value = text.partition("=")
    parts = [part.strip() for part in key.split(".")]
    if not separator or not all(parts):
        raise ConfigurationError(f"--set {shown(text)}: write KEY=VALUE, for example planner.gamma_r=0.8")
    if len(parts) > DEEPEST_TOML:
        raise ConfigurationError(f"--set {shown(text)}: no key has so many parts")
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ConfigurationError(f"--set {text!r} is not UTF-8; write it with letters that are") from error
    try:
        parsed: Any = parse_toml(f"value = {value}")["value"]
    except ValueError:
        parsed = value.strip()
    nested: dict[str, Any] = {parts[-1]: parsed}
    for part in reversed(parts[:-1]):
        nested = {part: nested}
    return nested
