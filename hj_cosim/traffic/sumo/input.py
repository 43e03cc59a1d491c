"""What SUMO is started with: the route file of the cars at their places, and the command line."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from hj_cosim.traffic.sources.placement import InitialTraffic
from hj_cosim.traffic.sources.streams import Stream
from hj_cosim.vehicles.idm import (
    COMFORTABLE_DECELERATION,
    DESIRED_SPEED,
    EXPONENT,
    MAX_ACCELERATION,
    MINIMUM_GAP,
    TIME_HEADWAY,
)

ROUTE = "road"  # what the route is called that all of them take
LANE_CHANGE_SECONDS = 3.0
# SUMO takes the least of a car's own top speed and the lane's limit times a factor. On one edge the own one shall
# count, on a route, where limits change, the limit too; the robot's speed is ours.
IGNORE_SPEED_LIMIT, MIND_SPEED_LIMIT = 100.0, 1.0
STREAMS_BEGIN, STREAMS_END = 1, 1_000_000  # s; after the first step, in which those who stand at places come


def command_line(network: Path, routes: Path, log: Path, step: float, seed: int, check_collisions: bool) -> list[str]:
    """Return SUMO's command line.

    Args:
        network: the .net.xml.
        routes: the route file.
        log: where SUMO writes every warning and error.
        step: s.
        seed: of SUMO's own random numbers.
        check_collisions: whether SUMO warns of cars that overlap. With continuous lane changes it compares every
            car of a lane with every other, which at 400 cars is more than half of its step.
    """
    options = {
        "net-file": network,
        "route-files": routes,
        "step-length": step,
        "seed": seed % 2**31,  # SUMO's is a 32-bit integer
        "eager-insert": True,  # everyone in the first step
        "lanechange.duration": LANE_CHANGE_SECONDS,  # continuous changes instead of jumps
        "time-to-teleport": -1,
        "collision.action": "warn" if check_collisions else "none",
        "collision.mingap-factor": 0,  # overlaps, not small gaps
        "no-step-log": True,
        "error-log": log,
        # Warnings do go to error-log; this only keeps SUMO from writing them to stderr as well.
        "no-warnings": True,
    }
    words = ["sumo"]
    for name, value in options.items():
        words += [f"--{name}", str(value).lower() if isinstance(value, bool) else str(value)]
    return words


class RobotVehicle(NamedTuple):
    """The robot as SUMO is to know it."""

    name: str
    length: float  # m
    width: float  # m
    lane: int  # that it starts in
    driver: np.ndarray  # (6,) what SUMO's safety check of lane changes takes it to be


# What SUMO is told of a place: the edge's place in the route, the lane's index and the position in it (m).
Departure = Callable[[int, float], tuple[int, int, float]]


def write_routes(
    path: Path,
    edges: str,
    traffic: InitialTraffic,
    names: Sequence[str],
    robot: RobotVehicle,
    departure: Departure = lambda lane, front: (0, lane, front),
    streams: Sequence[Stream] = (),
    *,
    minds_limits: bool = False,
) -> None:
    """Write the route file that puts every car, and the robot, at its place.

    Args:
        path: where to.
        edges: the road's, in order.
        traffic: where the cars and the robot are.
        names: the cars' (J,).
        robot: what it is.
        streams: who comes later.
        departure: from the road's lane and s (m) of a front bumper to SUMO's; of a road that is one edge if left out.
        minds_limits: whether the cars mind the lanes' speed limits.
    """
    factor = MIND_SPEED_LIMIT if minds_limits else IGNORE_SPEED_LIMIT
    lines = ["<routes>", f'<route id="{ROUTE}" edges={quoteattr(edges)}/>']
    bodies = list(zip(traffic.length.tolist(), traffic.width.tolist(), strict=True))
    for name, driver, body in zip(names, traffic.drivers, bodies, strict=True):
        lines.append(vehicle_type(name, driver, driver[DESIRED_SPEED], body, factor))
    # The robot's speed is not SUMO's to limit.
    lines.append(vehicle_type(robot.name, robot.driver, 1000.0, (robot.length, robot.width)))
    for name, x, lane, speed, body in zip(names, traffic.x, traffic.lane, traffic.speed, bodies, strict=True):
        lines.append(_vehicle(name, departure(lane, x + 0.5 * body[0]), speed))
    lines.append(_vehicle(robot.name, departure(robot.lane, traffic.robot[0] + 0.5 * robot.length), traffic.robot[3]))
    for stream in streams:
        lines += _stream(stream)
    lines.append("</routes>")
    path.write_text("\n".join(lines), encoding="utf-8")


def _stream(stream: Stream) -> list[str]:
    """Return the elements of a stream: its drivers, and the cars that they drive."""
    types = [
        "    " + vehicle_type(f"{stream.name}_driver_{number}", driver, driver[DESIRED_SPEED], body, MIND_SPEED_LIMIT)
        for number, (driver, body) in enumerate(zip(stream.drivers, stream.bodies.tolist(), strict=True))
    ]
    return [
        f'<vTypeDistribution id="{stream.name}_drivers">',
        *types,
        "</vTypeDistribution>",
        f'<flow id="{stream.name}" type="{stream.name}_drivers" from={quoteattr(stream.from_edge)}'
        f' to={quoteattr(stream.to_edge)} begin="{STREAMS_BEGIN}" end="{STREAMS_END}"'
        f' period="exp({stream.per_hour / 3600.0:.17g})" departLane="best" departSpeed="max"/>',
    ]


def vehicle_type(
    name: str,
    driver: np.ndarray,
    top_speed: float,
    body: Sequence[float],
    speed_factor: float = IGNORE_SPEED_LIMIT,
) -> str:
    """Return the <vType> of one IDM driver: (6,) parameters, top speed m/s, body m, share of limits that it drives."""
    length, width = body
    return (
        f'<vType id="{name}" vClass="passenger" carFollowModel="IDM" length="{length!r}" width="{width!r}"'
        f' accel="{driver[MAX_ACCELERATION]:.17g}" decel="{driver[COMFORTABLE_DECELERATION]:.17g}"'
        f' tau="{driver[TIME_HEADWAY]:.17g}" minGap="{driver[MINIMUM_GAP]:.17g}" delta="{driver[EXPONENT]:.17g}"'
        f' maxSpeed="{top_speed:.17g}" speedFactor="{speed_factor}" speedDev="0"'
        # Without these a car on the right brakes for a slower one on its left.
        ' lcOvertakeRight="1" lcKeepRight="0"/>'
    )


def _vehicle(name: str, departure: tuple[int, int, float], speed: float) -> str:
    """Return the <vehicle> that starts with its front bumper at a place (see Departure), at `speed` (m/s)."""
    edge, lane, front = departure
    on_the_way = f' departEdge="{edge}"' if edge else ""
    # insertionChecks works here only: not on the vType, and not through vehicle.add.
    return (
        f'<vehicle id="{name}" type="{name}" route="{ROUTE}" depart="0"{on_the_way} departPos="{front:.17g}"'
        f' departLane="{lane}" departSpeed="{speed:.17g}" insertionChecks="none"/>'
    )
