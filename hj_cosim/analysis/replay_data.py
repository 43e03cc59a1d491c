"""What the page's replay plays: the robot's columns and the cars near it, as arrays in a JSON document."""

import base64
import math
from typing import Any

import numpy as np

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.value_plot import VALUE_LIMIT, value_colours
from hj_cosim.analysis.values import car_values
from hj_cosim.analysis.view import height_of, stretches
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.record import RunRecord
from hj_cosim.scene.road import Road
from hj_cosim.settings import TrackingSettings

NEAR = 120.0  # m, cars within this are shown
BYTES_PER_CAR = 32  # of a sample: eight numbers of four bytes
LARGEST = 3_500_000  # bytes of cars, so that the page stays below 8 MB with its figures, in base64
COLOURS = 121
BEHIND, AHEAD = 50.0, 100.0  # m of the road in the page's view
SHOWN_BEHIND, SHOWN_AHEAD = 150.0, 150.0  # m, of a bend, beside the drive: cars beyond the view are there, too
EVERY = 4.0  # m of s between two places of a bend's line: half a centimetre off at a radius of 400 m
LOOKED_AT_EVERY = 50  # samples, between two looks at how high the picture of a bend is
_ROBOT_COLUMNS = [
    "x",
    "y",
    "heading",
    "speed",
    "omega",
    "acceleration",
    "plan_speed",
    "plan_lane",
    "value",
    "value_vehicle",
    "constraints",
    "intervening",
]


def replay_data(
    record: RunRecord, table: ValueTable, tracking: TrackingSettings, largest: int = LARGEST
) -> dict[str, Any]:
    """Return a run for page/replay.js; of a long or crowded one only every second, third... sample.

    Args:
        record: the run.
        table: V, for the value of each car.
        tracking: the gains with which the robot follows its plan.
        largest: bytes that the cars may take.
    """
    traffic, robot = record.traffic, record.robot
    relative = traffic.x - robot.x[:, None]
    near = traffic.present & (np.abs(relative) <= NEAR)
    every = max(math.ceil(np.count_nonzero(near) * BYTES_PER_CAR / largest), 1)
    kept = np.arange(0, len(record.time), every)
    sample, car = np.nonzero(near[kept])
    where = (kept[sample], car)
    columns = {"time": record.time, **{name: getattr(robot, name) for name in _ROBOT_COLUMNS}}
    columns |= {name: getattr(record.threats, name) for name in ("ttc", "min_gap", "collision")}
    flags = ("intervening", "collision")
    step = float(record.time[every] - record.time[0]) if len(kept) > 1 else 1.0
    rings, believed = dict[str, Any](), dict[str, Any]()
    if record.belief is not None:
        rings = {"suspectColour": style.SUSPECT, "ring": style.RING}
        believed = {"belief": encoded(np.nan_to_num(record.belief[where]), "f4")}
    shown = {
        "names": list(traffic.names),
        "rogues": record.is_rogue.tolist(),
        "rogueColour": style.ROGUE,
        **rings,
        "lanes": record.road.lane_count,
        "laneWidth": record.road.lane_width,
        "robotLength": record.robot_length,
        "robotWidth": record.robot_width,
        "samplesPerSecond": 1.0 / step,
        "lateralRate": tracking.k_1,
        "speedRate": tracking.k_2,
        "valueLimit": VALUE_LIMIT,
        "colours": colours(),
        "robot": {name: encoded(column[kept], "u1" if name in flags else "f8") for name, column in columns.items()},
        "cars": {
            "start": encoded(np.concatenate([[0], np.cumsum(np.count_nonzero(near[kept], axis=1))]), "u4"),
            "vehicle": encoded(car, "u4"),
            "dx": encoded(relative[where], "f4"),
            "y": encoded(traffic.y[where], "f4"),
            "heading": encoded(traffic.heading[where], "f4"),
            "speed": encoded(traffic.speed[where], "f4"),
            "value": encoded(car_values(record, table)[where], "f4"),
            "length": encoded(traffic.length[car], "f4"),
            "width": encoded(traffic.width[car], "f4"),
            **believed,
        },
    }
    return shown if record.road.is_straight else {**shown, "bend": bend(record.road, record.robot.x)}


def bend(road: Road, driven: np.ndarray) -> dict[str, Any]:
    """Return the road as it bends along a drive: its line d = 0 every EVERY m of s, and the lanes of its stretches.

    Args:
        road: that bends.
        driven: s of the robot (T,), m, sample by sample.
    """
    first, last = float(driven.min()) - SHOWN_BEHIND, float(driven.max()) + SHOWN_AHEAD
    along = np.arange(first, last + EVERY, EVERY)
    x, y, heading = road.to_world(along, 0.0 * along, 0.0 * along)
    low, high = height_of(road, driven[::LOOKED_AT_EVERY], BEHIND, AHEAD)
    return {
        "start": first,
        "every": EVERY,
        "x": encoded(x - x[0], "f4"),
        "y": encoded(y - y[0], "f4"),
        "heading": encoded(np.unwrap(heading), "f4"),
        "low": low - 1.0,
        "high": high + 1.0,
        "stretches": [
            [float(s[0]), float(s[-1]), float(lines[0]), len(lines) - 1] for s, lines in stretches(road, first, last)
        ],
    }


def encoded(values: np.ndarray, kind: str) -> dict[str, str]:
    """Return an array as base64 of little-endian numbers of a kind, as replay.js decodes it."""
    data = np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()
    return {"kind": kind, "data": base64.b64encode(data).decode("ascii")}


def colours() -> list[str]:
    """Return the colours of values from −VALUE_LIMIT to VALUE_LIMIT, as the page has them."""
    shades = np.round(255 * value_colours(np.linspace(-VALUE_LIMIT, VALUE_LIMIT, COLOURS))).astype(int)
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue, _ in shades]
