"""Scenes and controls at the limits and far beyond: what a filter must answer with a control within its own limits."""

import math

import numpy as np

from hj_cosim.scene.observation import Control, Observation

NOT_FINITE = (math.nan, math.inf, -math.inf)
# What a robot may meet: at rest, hardly moving, at the bounds of the table, at its own, just beyond.
SPEEDS = (0.0, -0.0, 5e-324, 1e-12, 1e-6, 1e-3, 0.08, 39.99, 40.0, 40.08)
HEADINGS = (0.0, 0.394, 0.4, math.nextafter(0.4, 1.0), -0.4, -0.406, 1.5, -math.pi, 2.0 * math.pi)
# What no world gives, but a broken one may.
ABSURD = (-1.0, -1e-9, 1e3, -1e6, 1e12, 1e154, -1e200, 1e308)
CAR_COUNTS, CAR_SHARES = (0, 1, 4, 20, 500), (0.15, 0.35, 0.35, 0.148, 0.002)


def draw_scene(draw: np.random.Generator) -> Observation:
    """Return a scene: every second ordinary but for extremes, the others with absurd or non-finite numbers in it."""
    count = int(draw.choice(CAR_COUNTS, p=CAR_SHARES))
    robot = np.array([
        draw.uniform(-1e4, 1e4), draw.uniform(-6.0, 18.0),
        draw.choice(HEADINGS) if draw.random() < 0.5 else draw.uniform(-0.5, 0.5),
        draw.choice(SPEEDS) if draw.random() < 0.5 else draw.uniform(0.0, 40.0),
    ])  # fmt: skip
    # As far away as the table reaches, a car's length away, or on top of the robot.
    spread = draw.choice([100.0, 6.0, 0.0])
    lane = draw.integers(0, 4, count)
    columns = {
        "x": robot[0] + spread * draw.uniform(-1.0, 1.0, count),
        "y": robot[1] + min(spread, 10.0) * draw.uniform(-1.0, 1.0, count),
        "heading": draw.uniform(-0.2, 0.2, count),
        "speed": draw.choice([0.0, 1.0], count) * draw.uniform(0.0, 45.0, count),
        "length": np.full(count, 5.0),
        "width": np.full(count, 2.0),
    }
    kind = draw.random()
    if kind < 0.5:
        spoilt = NOT_FINITE if kind < 0.2 else ABSURD
        arrays = [robot, *(column for column in columns.values() if count)]
        array = arrays[draw.integers(len(arrays))]
        array[draw.integers(len(array))] = draw.choice(spoilt)
    return Observation(
        time=0.0, robot=robot, robot_acceleration=0.0, vehicle=draw.permutation(count), acceleration=np.zeros(count),
        lane=lane, target_lane=lane, **columns,
    )  # fmt: skip


def draw_desired(draw: np.random.Generator) -> Control:
    """Return a control that somebody asks for: within the limits, beyond them, absurd, or not finite."""
    omega, acceleration = draw.uniform(-1.0, 1.0), draw.uniform(-20.0, 20.0)
    kind = draw.random()
    if kind < 0.2:
        spoilt = float(draw.choice(NOT_FINITE if kind < 0.1 else ABSURD))
        return Control(spoilt, acceleration) if draw.random() < 0.5 else Control(omega, spoilt)
    return Control(omega, acceleration)
