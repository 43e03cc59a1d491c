"""Whether the belief that a driver means harm is calibrated on drives that it was not fitted on, and what a look takes.

pytest tests/benchmarks/test_belief.py -s -p no:xdist
"""

import time

import numpy as np

from hj_cosim import run_episode
from hj_cosim.control.belief.watcher import PERIOD, SUSPECTED_FROM, Watcher
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import DriverSettings, FilterSettings
from hj_cosim.verification.belief_calibration import reliability

SEEDS = range(1000, 1012)  # fitted below 100
STEP = 0.02  # s
MOST = 10.0  # µs a step of the filter
CARS, LOOKS = 100, 300


def test_a_look_at_a_hundred_cars_takes_less_than_ten_microseconds_a_step(capsys):
    random = np.random.default_rng(0)
    lane, still = random.integers(0, 4, CARS), np.zeros(CARS)
    x, heading = np.sort(random.uniform(0.0, 1000.0, CARS)), np.where(random.random(CARS) < 0.05, 0.05, 0.0)
    watcher, taken = Watcher(5.0, 4.0, DriverSettings()), []
    for look in range(LOOKS):
        observation = Observation(
            look * PERIOD, np.array([500.0, 4.0, 0.0, 22.0]), 0.0, np.arange(CARS), x, 4.0 * lane, heading,
            random.uniform(18.0, 25.0, CARS), still, lane, lane, np.full(CARS, 5.0), np.full(CARS, 2.0),
        )  # fmt: skip
        started = time.perf_counter()
        watcher.see(observation)
        taken.append(time.perf_counter() - started)
    per_step = float(np.median(taken)) * 1e6 * STEP / PERIOD
    with capsys.disabled():
        print(f"\n{per_step:.1f} µs a step of 0.02 s, {per_step * PERIOD / STEP:.0f} µs a look")
    assert per_step < MOST


def test_of_those_it_suspects_as_many_are_rogues_as_it_says(capsys):
    assert FilterSettings().priority == "equal"
    cases = {"paper, none": ("paper", 0.0), "rogues, 5 %": ("rogues", 0.05), "rogues, 20 %": ("rogues", 0.2)}
    everything = []
    for name, (scenario, share) in cases.items():
        records = [run_episode(scenario, seed=seed, settings={"scenario.rogues.share": share}).record for seed in SEEDS]
        everything += records
        _show(capsys, name, reliability(records))
    pooled = reliability(everything)
    _show(capsys, "all", pooled)
    suspected = [each for each in pooled if each.low >= SUSPECTED_FROM]
    assert all(each.are >= each.said - 0.1 for each in suspected)


def _show(capsys, name, bins):
    with capsys.disabled():
        print(f"\n{name}")
        for each in bins:
            print(f"  {each.low:.2f} to {each.high:.2f}: {each.count:7d}, said {each.said:.3f}, are {each.are:.3f}")
