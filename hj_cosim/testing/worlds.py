"""The suite for worlds."""

from collections.abc import Callable
from dataclasses import fields

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.possible import is_possible
from hj_cosim.testing.expectations import answered, left_as_it_was, require
from hj_cosim.traffic.contract import World

STEPS = 50
INTEGERS = ("vehicle", "lane", "target_lane")
PLACE_TOLERANCE = 0.01  # m, rad and m/s; a simulation may keep the robot in numbers of its own


def check_world(make: Callable[[], World], step: float = 0.02) -> None:
    """Check that a world keeps its contract over a second: what it shows is whole, and repeatable.

    The robot is driven straight ahead at its speed. Cars' arrays have one length, their numbers differ and have names,
    everything is finite, the clock advances by a step, the robot is where it was told to be, an observation that was
    handed out stays as it was, and two worlds made alike show the same.

    Args:
        make: makes the world, the same each time.
        step: s, of the world.

    Raises:
        ContractError: one sentence on the first thing that is wrong.
    """
    first, second = _driven(make, step), _driven(make, step)
    for one, other in zip(first, second, strict=True):
        for field in fields(one):
            same = np.array_equal(getattr(one, field.name), getattr(other, field.name))
            require(same, f"two worlds made alike differ in {field.name} at {one.time:.2f} s; it has to be repeatable")


def _driven(make: Callable[[], World], step: float) -> list[Observation]:
    """Return what a world shows over STEPS steps, each checked."""
    with make() as world:
        seen = [answered(world.observe, "at the beginning")]
        _check_observation(seen[0], world)
        for _ in range(STEPS):
            last = seen[-1]
            x, y, heading, speed = last.robot
            state = np.array([x + speed * np.cos(heading) * step, y + speed * np.sin(heading) * step, heading, speed])
            with left_as_it_was("step", last):
                world.step(state.copy(), 0.0)
                now = answered(world.observe, f"after {last.time + step:.2f} s")
            _check_observation(now, world)
            clock = abs(now.time - last.time - step) < 1e-6
            require(clock, f"the clock went from {last.time} to {now.time} s in a step of {step} s")
            there = np.abs(now.robot - state).max() <= PLACE_TOLERANCE
            require(there, f"the robot was put at {state.tolist()} and is seen at {now.robot.tolist()}")
            seen.append(now)
    return seen


def _check_observation(seen: Observation, world: World) -> None:
    """Check that an observation is whole."""
    at = f"at {seen.time:.2f} s"
    require(np.shape(seen.robot) == (4,), f"robot has the shape {np.shape(seen.robot)} {at}; (4,) is right")
    count = len(seen.vehicle)
    for name in ("x", "y", "heading", "speed", "acceleration", "lane", "target_lane", "length", "width"):
        shape = np.shape(getattr(seen, name))
        require(shape == (count,), f"{name} has the shape {shape} {at}, and vehicle ({count},)")
    for name in INTEGERS:
        kind = getattr(seen, name).dtype
        require(np.issubdtype(kind, np.integer), f"{name} is of {kind} {at}; whole numbers are right")
    possible = is_possible(seen.robot, seen.x, seen.y, seen.heading, seen.speed, seen.acceleration)
    require(possible, f"the robot's or a car's state is not finite {at}")
    require(len(set(seen.vehicle.tolist())) == count, f"two cars have one number {at}")
    named = count == 0 or (seen.vehicle.min() >= 0 and seen.vehicle.max() < len(world.vehicle_names))
    require(bool(named), f"a car's number {at} has no name in vehicle_names")
    require(len(set(world.vehicle_names)) == len(world.vehicle_names), f"two cars have one name {at}")
    rows = len(world.drivers)
    require(
        rows == len(world.vehicle_names), f"drivers has {rows} rows {at}, and {len(world.vehicle_names)} cars a name"
    )
    bodies = bool((seen.length > 0.0).all() and (seen.width > 0.0).all())
    require(bodies, f"a car has no length or no width {at}")
