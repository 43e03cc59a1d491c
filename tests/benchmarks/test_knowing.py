"""What it would be worth to know from the beginning who means harm: priority by a belief that is the truth.

No belief can be better, so what this does not prevent none does. pytest tests/benchmarks/test_knowing.py -s -p no:xdist
"""

import numpy as np
import pytest

from hj_cosim import run_episode
from hj_cosim.control.belief import believing_filter
from hj_cosim.scene.observation import Observation
from hj_cosim.traffic.rogues.catalogue import choose_rogues
from hj_cosim.traffic.sources.scenarios import load_scenario

SEEDS = range(200, 210)
SHARE = 0.2


class Knowing:
    """In a Watcher's place: it suspects those who mean harm, before they have done anything, and nobody else."""

    rogues: tuple[int, ...] = ()  # the numbers of their cars
    asked = 0

    def __init__(self, robot_length: float, lane_width: float, drivers: object) -> None:
        pass

    def see(self, observation: Observation) -> None:
        Knowing.asked += 1

    def belief(self, vehicle: np.ndarray) -> np.ndarray:
        return self.suspected(vehicle).astype(float)

    def suspected(self, vehicle: np.ndarray) -> np.ndarray:
        return np.isin(vehicle, Knowing.rogues)


@pytest.mark.parametrize("behaviour", ["worst", "cut_in", "tailgate"])
def test_knowing_who_means_harm_beside_not_knowing(behaviour, monkeypatch, capsys) -> None:
    monkeypatch.setattr(believing_filter, "Watcher", Knowing)
    rogues = {"share": SHARE, "behaviour": behaviour}
    scenario = load_scenario("rogues")
    scenario = scenario.model_copy(update={"rogues": scenario.rogues.model_copy(update=rogues)})
    drawn = scenario.traffic.count + scenario.traffic.count_behind
    collisions: dict[str, list[float]] = {"equal": [], "belief": []}
    speeds: dict[str, list[float]] = {"equal": [], "belief": []}
    for seed in SEEDS:
        Knowing.rogues = tuple(rogue.car for rogue in choose_rogues(scenario, drawn, seed))
        for priority in collisions:
            settings = {"filter.priority": priority, "simulation.on_collision": "continue"}
            driven = run_episode(scenario, seed=seed, settings=settings)
            names = driven.record.traffic.names
            assert {names[car] for car in Knowing.rogues} == set(driven.record.rogues)
            collisions[priority].append(driven.summary["collisions"])
            speeds[priority].append(driven.summary["mean_speed"])
    assert Knowing.asked > 0
    with capsys.disabled():
        found = "; ".join(
            f"{priority}: {np.mean(collisions[priority]):.2f} collisions a drive, {np.mean(speeds[priority]):.1f} m/s"
            for priority in collisions
        )
        print(f"\n{behaviour}, {SHARE:.0%} of the cars, {len(SEEDS)} drives: {found}")
