"""Train a small policy in SUMO's traffic with and without the safety filter, and count crashes in both (extra gym)."""

import gymnasium
import numpy as np

from hj_cosim.training import ENVIRONMENT
from hj_cosim.training.filtered import SafetyFilterWrapper

CARS = 6


def policy_action(weights: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """Return turn rate and acceleration, each in [−1, 1], of a linear policy."""
    robot, cars = scene[0], scene[1:]
    lane_offset = robot[2] - 4.0 * np.round(robot[2] / 4.0)
    ahead = cars[(cars[:, 0] > 0.0) & (cars[:, 1] > 0.0) & (np.abs(cars[:, 2]) < 2.0)]
    nearness = np.exp(-ahead[:, 1].min() / 20.0) if len(ahead) else 0.0
    features = np.array([1.0, lane_offset / 2.0, 10.0 * robot[3], (robot[4] - 20.0) / 10.0, nearness])
    return np.tanh(weights.reshape(2, -1) @ features).astype(np.float32)


def drive(env: gymnasium.Env, weights: np.ndarray, seed: int) -> tuple[float, bool]:
    """Return the rewards of an episode, summed, and whether it crashed."""
    scene, _ = env.reset(seed=seed)
    total, over, info = 0.0, False, {"collision": False}
    while not over:
        scene, reward, terminated, truncated, info = env.step(policy_action(weights, scene))
        total, over = total + reward, terminated or truncated
    return total, bool(info["collision"])


def train(env: gymnasium.Env, generations: int, population: int, seed: int = 0) -> tuple[float, int, int]:
    """Train by the cross-entropy method; return the last generation's mean reward, crashes, and episodes in all."""
    draw = np.random.default_rng(seed)
    mean, spread = np.zeros(10), np.ones(10)
    mean[[1, 2]] = -1.0  # to begin with, steer back to the lane's centre and along the road
    crashes, rewards = 0, np.zeros(population)
    for generation in range(generations):
        drawn = mean + spread * draw.normal(size=(population, 10))
        for member, weights in enumerate(drawn):
            rewards[member], crashed = drive(env, weights, seed=1000 * generation + member)
            crashes += crashed
        best = drawn[np.argsort(-rewards)[: max(population // 4, 2)]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05
    return float(rewards.mean()), crashes, generations * population


def main(generations: int = 6, population: int = 12, duration: float = 10.0, table: str = "highway") -> None:
    """Train twice from the same seeds, and print what came of it."""
    for filtered in (False, True):
        env = gymnasium.make(ENVIRONMENT, scenario="light", cars=CARS, duration=duration, settings={"table": table})
        env = SafetyFilterWrapper(env) if filtered else env
        reward, crashes, episodes = train(env, generations, population)
        env.close()
        said = "with the filter" if filtered else "without a filter"
        print(f"{said}: {crashes} of {episodes} episodes crashed, mean reward at the end {reward:.1f}")


if __name__ == "__main__":
    main()
