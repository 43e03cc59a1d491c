"""Steps a second of hj_cosim/Highway-v0, beside highway-env's highway-v0 with the same cars at the same places.

highway-env comes with `make bench`, or `pip install highway-env`; its cars are driven in Python, with IDM and MOBIL as
ours in SUMO. A step is a second of driving, of five actions in both.
"""

import time
from statistics import median

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
highway_env = pytest.importorskip("highway_env")

from highway_env.vehicle.behavior import IDMVehicle  # noqa: E402

from hj_cosim.planning.contract import IDLE  # noqa: E402
from hj_cosim.training.environment import HighwayEnv  # noqa: E402
from hj_cosim.training.filtered import SafetyFilterWrapper  # noqa: E402

STEPS, ROUNDS = 8, 3
SEED = 1000
CARS = 8  # that are observed
# highway-env's default is 15 Hz; 50 Hz is the rate of our robot, and of what the filter answers.
FREQUENCIES = (15, 50)


def ours(**options) -> HighwayEnv:
    return HighwayEnv("paper", actions="planner", cars=CARS, duration=60.0, **options)


def theirs(frequency: int, scene: np.ndarray):
    """Return highway-env with cars at x, y, speed (J, 3) relative to the robot's lane 0, m and m/s."""
    config = {
        "lanes_count": 4,
        "vehicles_count": 0,
        "simulation_frequency": frequency,
        "policy_frequency": 1,
        "duration": 60,
        "observation": {"type": "Kinematics", "vehicles_count": CARS + 1},
    }
    env = gymnasium.make("highway-v0", config=config)
    env.reset(seed=SEED)
    road, robot = env.unwrapped.road, env.unwrapped.vehicle
    for x, y, speed in scene:
        lane = road.network.get_lane(("0", "1", int(np.clip(round(3.0 - y / 4.0), 0, 3))))  # theirs count from the left
        road.vehicles.append(IDMVehicle(road, lane.position(robot.position[0] + x, 0.0), speed=speed))
    return env


def steps_a_second(env, action: int) -> float:
    """Return the median over rounds of steps a second of CPU time, which one thread has to itself."""
    rates = []
    for _ in range(ROUNDS):
        begun, taken = time.process_time(), 0
        for _ in range(STEPS):
            _, _, terminated, truncated, _ = env.step(action)
            taken += 1
            if terminated or truncated:
                break
        rates.append(taken / (time.process_time() - begun))
        if terminated or truncated:
            break
    return median(rates)


def test_steps_a_second_beside_highway_env():
    env = ours()
    env.reset(seed=SEED)
    now = env._now
    scene = np.column_stack([now.x - now.robot[0], now.y, now.speed])
    env.step(IDLE)  # compiles
    found = {f"hj_cosim/Highway-v0, robot at 50 Hz, {len(scene)} cars": steps_a_second(env, IDLE)}
    env.close()
    env = SafetyFilterWrapper(ours())
    env.reset(seed=SEED)
    env.step(IDLE)
    found["the same behind the filter"] = steps_a_second(env, IDLE)
    env.close()
    for frequency in FREQUENCIES:
        env = theirs(frequency, scene)
        assert len(env.unwrapped.road.vehicles) == len(scene) + 1
        found[f"highway-env at {frequency} Hz, the same cars"] = steps_a_second(env, 1)  # theirs: idle
        env.close()
    print("\nsteps of 1 s, a second of CPU time:")
    for name, rate in found.items():
        print(f"  {name}: {rate:.2f}")
    own, filtered, slow, fast = found.values()
    assert own > slow  # though it moves the robot, and looks for collisions, more than three times as often
    assert own > 3.0 * fast
    assert filtered > fast
