"""A drive for the page that shows it as it happens: stretches of it, each as the replay page has a whole run."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.value_plot import VALUE_LIMIT
from hj_cosim.analysis.html import page, resource
from hj_cosim.analysis.replay_data import LOOKED_AT_EVERY, NEAR, bend, colours, encoded
from hj_cosim.control.contract import FilterDecision
from hj_cosim.metrics.threats import threat_track
from hj_cosim.planning.contract import Plan
from hj_cosim.recording.record import NO_VEHICLE, RobotTrack, TrafficTrack
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.settings import EpisodeConfig
from hj_cosim.traffic.contract import World, WorldWithRogues
from hj_cosim.watching.server import WatchServer

PER_SECOND = 10  # samples that are shown
STRETCH = 5  # of them are sent together
LOOKS = 100  # at a road that bends, to know how high its picture has to be

Seen = tuple[Observation, CarValues, Plan, Control, FilterDecision]


def drive_page(title: str) -> str:
    """Return the HTML of the page; it plays what it is sent."""
    parts = [
        '<p class="note" id="watching" role="status">waiting for the drive to begin</p>',
        f'<div id="player" hidden>{resource("replay.html")}</div>',
        '<script type="application/json" id="run"></script>',
        f'<script type="text/plain" id="replay-script">{resource("replay.js")}</script>',
        f"<script>{resource('watch_drive.js')}</script>",
    ]
    return page(title, parts, is_live=True)


class LiveDrive:
    """Tells a server what a drive does; the loop calls it once a sample, after the recorder."""

    def __init__(self, server: WatchServer) -> None:
        self._server = server
        self._seen: list[Seen] = []
        self._named, self._has_begun = 0, False
        self._send: Callable[[], None] = lambda: None

    def beside(self, config: EpisodeConfig, world: World, record: Callable[..., None]) -> Callable[..., None]:
        """Return what is to be called in place of a recorder's `record`: it does that, and remembers the sample.

        Args:
            config: of the drive.
            world: at its beginning.
            record: the recorder's.
        """
        every = max(round(1.0 / (PER_SECOND * config.simulation.step)), 1)
        count = 0
        self._send = lambda: self._publish(config, world, every)

        def record_and_show(
            observation: Observation,
            values: CarValues,
            plan: Plan,
            desired: Control,
            decision: FilterDecision,
            *others: Any,
        ) -> None:
            nonlocal count
            record(observation, values, plan, desired, decision, *others)
            if count % every == 0:
                self._seen.append((observation, values, plan, desired, decision))
                if len(self._seen) >= STRETCH:
                    self._send()
            count += 1

        return record_and_show

    def end(self, message: str) -> None:
        """Send what has not been sent, and what is to be read when the drive is over."""
        self._send()
        self._server.publish("end", json.dumps(message))

    def _publish(self, config: EpisodeConfig, world: World, every: int) -> None:
        if not self._seen:
            return
        stretch = _stretch(self._seen, config)
        names = list(world.vehicle_names)
        rogues = world.rogues if isinstance(world, WorldWithRogues) else {}
        stretch |= {"names": names[self._named :], "rogues": [name in rogues for name in names[self._named :]]}
        if not self._has_begun:
            stretch |= _scene(config, world, every)
            if not world.road.is_straight:
                stretch["bend"] = bend(world.road, _reachable(config, world, float(self._seen[0][0].robot[0])))
        self._server.publish("stretch", json.dumps(stretch, allow_nan=False))
        self._named, self._has_begun = len(names), True
        self._seen = []


def _scene(config: EpisodeConfig, world: World, every: int) -> dict[str, Any]:
    """Return what stays the same, as `replay_data` has it, and how many samples are to come."""
    step = every * config.simulation.step
    return {
        "rogueColour": style.ROGUE,
        "suspectColour": style.SUSPECT,
        "ring": style.RING,
        "lanes": world.road.lane_count,
        "laneWidth": world.road.lane_width,
        "robotLength": config.robot.length,
        "robotWidth": config.robot.width,
        "samplesPerSecond": 1.0 / step,
        "lateralRate": config.tracking.k_1,
        "speedRate": config.tracking.k_2,
        "valueLimit": VALUE_LIMIT,
        "colours": colours(),
        "expected": round(config.simulation.duration / step),
    }


def _reachable(config: EpisodeConfig, world: World, start: float) -> np.ndarray:
    """Return s (T,), m, of a robot that drives as fast as it is let from a start on: no drive goes farther."""
    road = world.road
    end = start + config.simulation.duration * config.robot.speed_max
    return np.linspace(start, end if road.lap else min(end, road.length), LOOKS * LOOKED_AT_EVERY)


def _stretch(seen: list[Seen], config: EpisodeConfig) -> dict[str, Any]:
    """Return a few samples, as `replay_data` has all of a run."""
    robot, limits = RobotTrack.empty(len(seen)), config.robot
    cars = np.unique(np.concatenate([observation.vehicle for observation, *_ in seen]))
    traffic = TrafficTrack.empty(("",) * len(cars), np.zeros(len(cars)), np.zeros(len(cars)), len(seen))
    value, belief = np.full((len(seen), len(cars)), np.inf), np.zeros((len(seen), len(cars)))
    for k, (observation, values, plan, desired, decision) in enumerate(seen):
        robot.x[k], robot.y[k], robot.heading[k], robot.speed[k] = observation.robot
        robot.omega[k], robot.acceleration[k] = decision.control.omega, decision.control.acceleration
        robot.plan_speed[k], robot.plan_lane[k] = plan.target.speed, plan.target.lane
        robot.value[k] = values.least if values.is_known else np.inf
        robot.value_vehicle[k] = observation.vehicle[values.nearest] if values.nearest >= 0 else NO_VEHICLE
        robot.constraints[k] = decision.constraints
        robot.intervening[k] = decision.intervening(desired, limits)
        column = np.searchsorted(cars, observation.vehicle)
        traffic.length[column], traffic.width[column] = observation.length, observation.width
        traffic.present[k, column] = True
        for name in ("x", "y", "heading", "speed", "acceleration"):
            getattr(traffic, name)[k, column] = getattr(observation, name)
        value[k, column] = values.value
        if decision.belief is not None:
            belief[k, column] = decision.belief
    threats = threat_track(robot, traffic, limits.length, limits.width)
    relative = traffic.x - robot.x[:, None]
    near = traffic.present & (np.abs(relative) <= NEAR)
    _, car = np.nonzero(near)
    times = np.array([observation.time for observation, *_ in seen])
    names = ("x", "y", "heading", "speed", "omega", "acceleration", "plan_speed", "plan_lane", "value")
    columns = {name: getattr(robot, name) for name in (*names, "value_vehicle", "constraints")}
    flags = {"intervening": robot.intervening, "collision": threats.collision}
    columns |= {"time": times, "ttc": threats.ttc, "min_gap": threats.min_gap}
    return {
        "robot": {name: encoded(column, "f8") for name, column in columns.items()}
        | {name: encoded(flag, "u1") for name, flag in flags.items()},
        "cars": {
            "start": encoded(np.concatenate([[0], np.cumsum(np.count_nonzero(near, axis=1))]), "u4"),
            "vehicle": encoded(cars[car], "u4"),
            "dx": encoded(relative[near], "f4"),
            "y": encoded(traffic.y[near], "f4"),
            "heading": encoded(traffic.heading[near], "f4"),
            "speed": encoded(traffic.speed[near], "f4"),
            "value": encoded(value[near], "f4"),
            "length": encoded(traffic.length[car], "f4"),
            "width": encoded(traffic.width[car], "f4"),
            **({"belief": encoded(belief[near], "f4")} if config.filter.priority == "belief" else {}),
        },
    }
