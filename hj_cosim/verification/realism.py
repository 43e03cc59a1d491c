"""The background traffic of a scenario beside what is published of real motorways, with a verdict a line."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from hj_cosim.errors import ConfigurationError, ScenarioError
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import EpisodeConfig
from hj_cosim.traffic.contract import World
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.verification.traffic_measures import TrafficMeasures, measure_traffic

SAMPLE = 0.1  # s between two looks at the traffic

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Band:
    """What is published of a quantity: from one number to another, where each may be open."""

    low: float
    high: float
    source: str

    @property
    def text(self) -> str:
        """Return it for people."""
        if self.low == -math.inf:
            return f"up to {self.high:g}"
        return f"{self.low:g} to {self.high:g}"

    def verdict(self, value: float) -> str:
        """Return where a value lies."""
        if math.isnan(value):
            return "nothing to measure"
        return "below" if value < self.low else "above" if value > self.high else "within"


@dataclass(frozen=True)
class Finding:
    """A quantity of the traffic, and what is published of it."""

    quantity: str
    value: float
    unit: str
    band: Band | None

    @property
    def verdict(self) -> str:
        """Return where it lies in the band, or that there is none."""
        return "no band" if self.band is None else self.band.verdict(self.value)


# Single numbers that are published stand for a tenth of themselves around them.
CAPACITY = Band(-math.inf, 2100.0, "capacity 1,800 to 2,100 over 38 bottlenecks (Shojaat & Geistefeldt 2019)")
FREE_SPEED = Band(29.3, 35.8, "mean of 117 km/h on German motorways, 1987, ± 10 %; in free flow")
LANE_CHANGES = Band(0.12, 0.5, "highD (Krajewski et al. 2018): 5,600 on 45,000 km; Knoop et al. 2012: 0.5")
HEADWAY = Band(0.9, 1.8, "Germany: 1.8 s recommended, below 0.9 s fined")
# Vehicles/h and lane, half of the least capacity, and vehicles/km and lane, that flow at 20 m/s: with more than either
# drivers are held up, and their speed says nothing of what they want.
FREE_FLOW, FREE_DENSITY = 900.0, 12.5


def findings(measures: TrafficMeasures) -> list[Finding]:
    """Return every measure beside its band."""
    free = FREE_SPEED if measures.flow < FREE_FLOW and measures.density < FREE_DENSITY else None
    return [
        Finding("flow", measures.flow, "veh/h/lane", CAPACITY),
        Finding("density", measures.density, "veh/km/lane", None),
        Finding("speed", measures.speed, "m/s", free),
        Finding("lane changes", measures.lane_changes, "1/veh-km", LANE_CHANGES),
        Finding("time headway, median", measures.headway_median, "s", HEADWAY),
        Finding("time headways below 0.9 s", measures.short_headway_percent, "%", None),
        Finding("TTC, 1st percentile", measures.ttc_p1, "s", None),
        Finding("TTC below 3 s", measures.critical_ttc_percent, "%", None),
    ]


def traffic_realism(
    config: EpisodeConfig,
    episodes: int,
    open_world: Callable[[EpisodeConfig], World],
    progress: Progress | None = None,
) -> tuple[TrafficMeasures, list[Finding]]:
    """Return how real the background traffic of a configuration is.

    The robot is a mean driver that keeps its lane, and counts nowhere; rogues drive as anybody.

    Args:
        config: scenario, drivers, clocks; on the seeds `config.seed`, `config.seed` + 1, ...
        episodes: how many to drive.
        open_world: makes the world of a configuration.
        progress: called with the episodes driven and the episodes in all.

    Raises:
        ConfigurationError: if the drives are too short to be looked at.
        ScenarioError: if all its cars are placed by hand, which is a scene and no traffic.
        NetworkError, SimulationError: as the world raises them.
    """
    if config.scenario.is_hand_made:
        raise ScenarioError(
            f"scenario {config.scenario.name} places all its cars by hand, a scene and no traffic; choose another"
        )
    if config.simulation.duration < SAMPLE:
        raise ConfigurationError(
            f"simulation.duration = {config.simulation.duration:g} s is too short to see any traffic: it is looked at"
            f" every {SAMPLE:g} s"
        )
    honest = config.scenario.rogues.model_copy(update={"share": 0.0})
    scenario = config.scenario.model_copy(update={"rogues": honest})
    config = config.model_copy(update={"scenario": scenario})
    driven = []
    for number in range(episodes):
        driven.append(_drive(config.model_copy(update={"seed": config.seed + number}), open_world))
        if progress is not None:
            progress(number + 1, episodes)
    measures = measure_traffic([observations for _, observations in driven], SAMPLE, driven[0][0])
    return measures, findings(measures)


def _drive(config: EpisodeConfig, open_world: Callable[[EpisodeConfig], World]) -> tuple[Road, list[Observation]]:
    """Return the road and the traffic every SAMPLE seconds, after it has settled."""
    step = config.simulation.step
    every = max(round(SAMPLE / step), 1)
    driver = robot_driver(config.scenario.drivers, config.scenario.robot.speed)
    seen = []
    with open_world(config) as world:
        world.settle(config.simulation.settle_time)
        for number in range(round(config.simulation.duration / step)):
            now = world.observe()
            if number % every == 0:
                seen.append(now)
            world.step(*follow_lane(now, driver, world.road, config.robot.length, step))
        return world.road, seen
