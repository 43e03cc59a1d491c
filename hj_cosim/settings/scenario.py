"""A scenario: what a user swaps."""

from typing import Annotated

from pydantic import Field, model_validator

from hj_cosim.settings.base import (
    CarsPerHour,
    CarsPerKilometreAndLane,
    Metres,
    MetresPerSecond,
    MetresPerSecondSquared,
    Number,
    Settings,
    Unit,
)
from hj_cosim.settings.own_simulation import OwnSimulationSettings
from hj_cosim.settings.rogues import RogueSettings

# m, of a car where nothing says otherwise (`vehicles.car` has them for all other rooms).
CAR_LENGTH, CAR_WIDTH = 5.0, 2.0


class NormalDistribution(Settings):
    """A normal distribution truncated at ± `truncation` standard deviations."""

    mean: float = Field(gt=0, description="the mean")
    deviation: float = Field(ge=0, description="the standard deviation")
    truncation: Number = Field(2.5, ge=0.1, description="in deviations; what lies beyond is drawn again")

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

    desired_speed: Annotated[NormalDistribution, Unit("m/s")] = Field(
        NormalDistribution(mean=24.0, deviation=1.5), description="IDM's v_0, on a free road"
    )
    max_acceleration: Annotated[NormalDistribution, Unit("m/s²")] = Field(
        NormalDistribution(mean=3.0, deviation=0.3), description="IDM's a"
    )
    comfortable_deceleration: Annotated[NormalDistribution, Unit("m/s²")] = Field(
        NormalDistribution(mean=5.0, deviation=0.5), description="IDM's b"
    )
    time_headway: Annotated[NormalDistribution, Unit("s")] = Field(
        NormalDistribution(mean=1.5, deviation=0.15), description="IDM's T, behind the leader"
    )
    minimum_gap: Annotated[NormalDistribution, Unit("m")] = Field(
        NormalDistribution(mean=5.0, deviation=0.5), description="IDM's s_0, bumper to bumper at a standstill"
    )
    exponent: Number = Field(4.0, gt=0, description="IDM's δ")
    politeness: Number = Field(0.0, ge=0, le=1, description="MOBIL's p, 0 is selfish")
    gain_threshold: MetresPerSecondSquared = Field(0.2, ge=0, description="MOBIL's, what a lane change has to gain")
    safe_braking: MetresPerSecondSquared = Field(
        2.0, gt=0, description="MOBIL's, what a lane change may ask of the new follower"
    )


DEFAULT_DRIVERS = DriverSettings()


class KindDrivers(Settings):
    """What the drivers of a kind of vehicle are drawn from, where it is not what `drivers` says."""

    desired_speed: Annotated[NormalDistribution | None, Unit("m/s")] = Field(None, description="IDM's v_0")
    max_acceleration: Annotated[NormalDistribution | None, Unit("m/s²")] = Field(None, description="IDM's a")
    comfortable_deceleration: Annotated[NormalDistribution | None, Unit("m/s²")] = Field(None, description="IDM's b")
    time_headway: Annotated[NormalDistribution | None, Unit("s")] = Field(None, description="IDM's T")
    minimum_gap: Annotated[NormalDistribution | None, Unit("m")] = Field(None, description="IDM's s_0")
    exponent: Number | None = Field(None, gt=0, description="IDM's δ")
    politeness: Number | None = Field(None, ge=0, le=1, description="MOBIL's p")
    gain_threshold: MetresPerSecondSquared | None = Field(None, ge=0, description="MOBIL's")
    safe_braking: MetresPerSecondSquared | None = Field(None, gt=0, description="MOBIL's")


class VehicleSettings(Settings):
    """A kind of vehicle among the drawn ones, such as trucks; the rest are cars of 5 x 2 m."""

    share: Number = Field(gt=0, le=1, description="of the drawn vehicles, and of those of streams")
    length: Metres = Field(ge=1, le=18, description="of the body; 18 m is the longest that there are value tables for")
    width: Metres = Field(ge=0.4, le=2.6, description="of the body")
    drivers: KindDrivers = Field(KindDrivers(), description="in place of what the scenario's drivers are drawn from")


class NetworkSettings(Settings):
    """Which edges of which SUMO network are driven on: a straight one, a chain of them, or from one to another."""

    file: str = Field(
        "four_lanes.net.xml",
        description="a .net.xml or .net.xml.gz beside the scenario, in sumo_net/, or an absolute path",
    )
    edge: str = Field("highway", description="a straight edge's id in the network, unless there is a route")
    route: tuple[str, ...] | None = Field(
        None, min_length=1, description="a chain of edges, straight or not, in place of edge"
    )
    from_edge: str | None = Field(None, description="where the shortest route begins, in place of route")
    to_edge: str | None = Field(None, description="where it ends")
    laps: int = Field(1, ge=1, le=1000, description="how often the route is driven; more than once if it is closed")

    @model_validator(mode="after")
    def _is_consistent(self) -> "NetworkSettings":
        if (self.from_edge is None) != (self.to_edge is None):
            raise ValueError("from_edge and to_edge go together; give both or none")
        if self.route is not None and self.from_edge is not None:
            raise ValueError("route and from_edge say the same thing twice; keep one of them")
        if self.laps > 1 and self.route is None:
            raise ValueError(f"laps = {self.laps} needs a route")
        return self


class TrafficSettings(Settings):
    """How many cars are drawn, and how dense, when the episode begins."""

    count: int = Field(100, ge=0, le=5000, description="cars ahead of the robot")
    count_behind: int = Field(0, ge=0, le=5000, description="cars behind it")
    density: CarsPerKilometreAndLane | None = Field(None, gt=0, description="in place of spacing_factor")
    spacing_factor: Number = Field(1.0, gt=0, description="multiplies the mean spacing 1.5 v exp(-5 lanes/30)")
    spacing_jitter: Number = Field(0.1, ge=0, lt=1, description="± share of the spacing")
    speed_low: MetresPerSecond = Field(23.0, ge=0, description="at the start, at most what IDM holds at its gap")
    speed_high: MetresPerSecond = Field(25.0, gt=0, description="at the start")
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
    x: Metres = Field(description="its centre ahead of the robot's; negative behind it")
    speed: MetresPerSecond = Field(ge=0, description="at the start")
    desired_speed: MetresPerSecond | None = Field(None, gt=0, description="drawn like any driver's when left out")
    length: Metres = Field(CAR_LENGTH, ge=1, le=18, description="of its body")
    width: Metres = Field(CAR_WIDTH, ge=0.4, le=2.6, description="of its body")
    rogue: str | None = Field(None, min_length=1, description="a behaviour as in rogues.behaviour; none when left out")


class StreamSettings(Settings):
    """Cars that SUMO lets in during the drive, on a route of several edges."""

    from_edge: str = Field(description="where they come from")
    to_edge: str = Field(description="where they go to, by the shortest way")
    flow: CarsPerHour = Field(gt=0, le=20_000, description="how many, at random times")


class RobotStart(Settings):
    """Where the robot stands when the episode begins."""

    lane: int = Field(1, ge=0, description="0 is the right-most")
    speed: MetresPerSecond = Field(24.0, ge=0, description="at most what IDM holds at its gap")
    edge: str = Field("", description="of a user's own simulation: where it is put in, in place of a vehicle")


class Scenario(Settings):
    """What a user swaps: road, traffic, drivers, the robot's start."""

    name: str = Field(description="the file's, unless it says otherwise")
    description: str = Field("", description="one line, for the list of scenarios")
    seed: int = Field(0, ge=0, lt=2**63, description="of an episode that is given no other")
    network: NetworkSettings = Field(NetworkSettings(), description="the road")
    traffic: TrafficSettings = Field(TrafficSettings(), description="the cars that are drawn")
    drivers: DriverSettings = Field(DriverSettings(), description="their drivers")
    vehicles: tuple[VehicleSettings, ...] = Field((), description="kinds of vehicles beside cars, such as trucks")
    robot: RobotStart = Field(RobotStart(), description="where the robot starts")
    own: OwnSimulationSettings = Field(OwnSimulationSettings(), description="a user's own simulation to drive in")
    cars: tuple[CarStart, ...] = Field((), description="cars at given places, beside the drawn ones")
    streams: tuple[StreamSettings, ...] = Field((), description="cars that come later, where the road is a route")
    rogues: RogueSettings = Field(RogueSettings(), description="drivers who mean harm")

    @model_validator(mode="after")
    def _has_cars_for_rogues(self) -> "Scenario":
        if self.own.is_given and self.rogues.share > 0.0:
            raise ValueError(
                f"rogues.share = {self.rogues.share:g}, but rogues take the scenario's own cars, of which a user's"
                " simulation (own.file) has none; leave one of the two out"
            )
        return self

    @model_validator(mode="after")
    def _edge_is_theirs(self) -> "Scenario":
        if self.robot.edge and not self.own.is_given:
            raise ValueError("robot.edge is an edge of a user's own simulation (own.file); ours have network.edge")
        if self.robot.edge and self.own.ego:
            raise ValueError("robot.edge and own.ego both say where the robot begins; keep one of them")
        return self

    @model_validator(mode="after")
    def _shares_leave_room(self) -> "Scenario":
        total = sum(kind.share for kind in self.vehicles)
        if total > 1.0 + 1e-9:
            raise ValueError(f"the shares of vehicles add up to {total:g}; 1 is all there are, cars included")
        if self.vehicles and self.own.is_given:
            raise ValueError(
                "vehicles are kinds of a scenario's own traffic, and a user's simulation (own.file) has its own vehicle"
                " types; leave one of the two out"
            )
        return self

    @model_validator(mode="after")
    def _streams_have_a_route(self) -> "Scenario":
        if self.streams and self.network.route is None and self.network.from_edge is None:
            raise ValueError("streams need network.route, or from_edge and to_edge")
        return self

    @property
    def bodies(self) -> set[tuple[float, float]]:
        """Length and width (m) of all that may be met, cars of the usual size aside."""
        kinds, placed = (
            ((each.length, each.width) for each in self.vehicles),
            ((car.length, car.width) for car in self.cars),
        )
        return {*kinds, *placed}

    @property
    def is_hand_made(self) -> bool:
        """Whether nothing is drawn: such a scene begins exactly as it is written, without settling first."""
        return self.traffic.count == 0 and self.traffic.count_behind == 0
