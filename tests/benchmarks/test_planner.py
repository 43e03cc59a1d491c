"""How fast the planner expands, what a larger budget is worth, and how well it predicts SUMO's traffic."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from rolled_out import predict

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import run_in_sumo
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sumo.world import SumoWorld

matplotlib.use("Agg")
from matplotlib import pyplot as plt

# rl-agents 0.1 with highway-env, the same algorithm in Python: expansions/s with so many cars in the tree, two cores of
# an AMD EPYC. It has no installable release, so it cannot run beside.
RL_AGENTS = {11: 14.5, 100: 0.45}
GOALS = {11: "planner 11", 100: "planner 100"}  # of HJOP

BUDGETS = (10, 40, 100, 300, 1000, 3000, 10_000)
SCENES = 40
EPISODES = 5
REGRET_PLOT = Path(".benchmarks") / "planner_regret.png"

# The planner is one thread: its CPU time is the wall time of a machine that does nothing else.
clock = time.process_time


@pytest.fixture(scope="module")
def table() -> ValueTable:
    return load_table("highway")


def scene(seed: int, cars: int, reach: float, spacing: float = 14.0) -> Observation:
    """Return a robot in lane 1 or 2 among cars up to `reach` ahead and behind, spread evenly at random."""
    random = np.random.default_rng(seed)
    robot_lane = int(random.integers(1, 3))
    placed = [(robot_lane, 0.0)]
    while len(placed) <= cars:
        lane, x = int(random.integers(4)), float(random.uniform(-reach, reach))
        if all(lane != other or abs(x - place) >= spacing for other, place in placed):
            placed.append((lane, x))
    lanes, x = np.array([lane for lane, _ in placed[1:]]), np.array([place for _, place in placed[1:]])
    return Observation(
        time=0.0, robot=np.array([1000.0, 4.0 * robot_lane, 0.0, 24.0]), robot_acceleration=0.0,
        vehicle=np.arange(cars), x=1000.0 + x, y=4.0 * lanes, heading=np.zeros(cars),
        speed=random.uniform(20.0, 25.0, cars), acceleration=np.zeros(cars), lane=lanes, target_lane=lanes,
        length=np.full(cars, 5.0), width=np.full(cars, 2.0),
    )  # fmt: skip


def planner_for(table: ValueTable, **settings) -> OptimisticPlanner:
    return make_planner(PlannerSettings(**settings), RobotSettings(), DriverSettings(), StraightRoad(4), table)


@pytest.mark.parametrize(("cars", "reach"), [(11, 110.0), (100, 500.0)])
@pytest.mark.parametrize("kind", ["op", "hjop"])
def test_expansions_per_second(benchmark, row, table, kind, cars, reach):
    planner = planner_for(table, kind=kind, expansions=1000, sensing_range=2.0 * reach)
    scenes = [scene(seed, cars, reach) for seed in range(12)]
    rates = []
    for each in scenes:
        planner.plan(each, Target(1, 24.0))
        start = clock()
        expansions = planner.plan(each, Target(1, 24.0)).statistics.expansions
        seconds = clock() - start
        if expansions == 1000:  # a scene in which every path ends in a crash is searched through before
            rates.append(expansions / seconds)
    benchmark.pedantic(planner.plan, args=(scenes[0], Target(1, 24.0)), rounds=10)
    rate = float(np.median(rates))
    print(
        f"\n{kind:5} {cars:4d} cars: {rate:9,.0f} expansions/s of CPU;"
        f" rl-agents (another machine) {RL_AGENTS[cars]}, ratio {rate / RL_AGENTS[cars]:,.0f}"
    )
    if kind == "hjop":
        row(GOALS[cars], rate, RL_AGENTS[cars])


@dataclass(frozen=True)
class BudgetScore:
    """What one budget achieved."""

    regret: float  # mean value lost by the first action, as a search of the largest budget judges it
    same: float  # share of scenes with the largest budget's action
    depth: float  # median of the deepest node
    milliseconds: float  # median CPU time of a decision


def scores(table: ValueTable, kind: str) -> dict[int, BudgetScore]:
    scenes = [scene(seed, 12, 110.0) for seed in range(SCENES)]
    judge = planner_for(table, kind=kind, expansions=BUDGETS[-1])
    judged = [judge.plan(each, Target(1, 24.0)) for each in scenes]
    result = {}
    for budget in BUDGETS:
        planner = planner_for(table, kind=kind, expansions=budget)
        planner.plan(scenes[0], Target(1, 24.0))
        regrets, same, depths, times = [], [], [], []
        for each, best in zip(scenes, judged, strict=True):
            start = clock()
            plan = planner.plan(each, Target(1, 24.0))
            times.append(clock() - start)
            regrets.append(best.statistics.best_value - best.statistics.action_values[plan.action])
            same.append(plan.action == best.action)
            depths.append(plan.statistics.depth)
        result[budget] = BudgetScore(
            float(np.mean(regrets)), float(np.mean(same)), float(np.median(depths)), 1e3 * float(np.median(times))
        )
    return result


def test_regret_falls_with_the_budget(table):
    figure, axes = plt.subplots(layout="constrained")
    for kind in ("op", "hjop"):
        print(f"\n{kind}, {SCENES} random dense scenes, 12 cars: value lost by the first action (of at most 10)")
        print(f"{'expansions':>10} {'regret':>8} {'same':>6} {'depth':>6} {'ms':>8}")
        result = scores(table, kind)
        for budget, score in result.items():
            print(f"{budget:10d} {score.regret:8.4f} {score.same:6.2f} {score.depth:6.0f} {score.milliseconds:8.2f}")
        axes.loglog(BUDGETS, [max(score.regret, 1e-5) for score in result.values()], marker="o", label=kind.upper())
        assert result[1000].regret <= result[10].regret
    axes.set(xlabel="node expansions", ylabel="regret of the first action")
    axes.legend()
    REGRET_PLOT.parent.mkdir(exist_ok=True)
    figure.savefig(REGRET_PLOT)
    plt.close(figure)
    print(f"regret plotted in {REGRET_PLOT}")


def test_what_a_budget_is_worth_on_the_road(table):
    print(f"\nHJOP without a filter in `paper`, 30 s, {EPISODES} seeds")
    print(f"{'expansions':>10} {'speed':>6} {'ttc>=3':>7} {'ttc p10':>8} {'crashes':>8} {'reward':>7} {'wall s':>7}")
    for budget in BUDGETS:
        summaries, rewards = [], []
        for seed in range(EPISODES):
            flags = {
                "seed": seed, "planner": {"expansions": budget}, "filter": {"kind": "none"},
                "simulation": {"on_collision": "continue"},
            }  # fmt: skip
            episode = run_in_sumo(resolve_config("paper", flags=flags), table)
            summaries.append({**episode.summary, **episode.timing})
            robot, worst = episode.record.robot, np.clip(np.nan_to_num(episode.record.robot.value, posinf=8.0), -8, 8)
            driving = 0.4 * (robot.speed - 15.0) / 15.0 + np.clip(np.round(robot.y / 4.0), 0, 3) / 3.0
            rewards.append(np.mean(0.9 * driving + 0.1 * worst))
        mean = {key: np.mean([each[key] for each in summaries]) for key in ("mean_speed", "ttc_ge_3", "wall_seconds")}
        # A sum over the episodes for the rare, a mean for the rest; an infinite TTC counts as 60 s.
        ttc = np.mean([min(each["ttc_p10"], 60.0) for each in summaries])
        crashes = sum(each["collisions"] for each in summaries)
        print(
            f"{budget:10d} {mean['mean_speed']:6.2f} {mean['ttc_ge_3']:7.3f} {ttc:8.1f} {crashes:8d}"
            f" {np.mean(rewards):7.3f} {mean['wall_seconds']:7.2f}"
        )


def prediction_errors(name: str, seed: int, seconds: int = 15) -> Iterator[tuple[int, float, float]]:
    """Yield (seconds ahead, predicted minus realised position, the same for constant speeds), m, for every car."""
    scenario = load_scenario(name)
    table = load_table("highway")
    with SumoWorld(scenario, RobotSettings(), seed) as world:
        world.settle(3.0)
        planner = make_planner(
            PlannerSettings(kind="op", expansions=1), RobotSettings(), scenario.drivers, world.road, table
        )
        seen, predicted = [], {}
        for step in range(50 * (seconds + 3) + 1):
            now = world.observe()
            if step % 50 == 0:
                seen.append((now.vehicle.copy(), now.x.copy()))
                target = Target(world.road.lane_at(now.robot[1], now.robot[0]), float(now.robot[3]))
                predicted[step // 50] = predict(planner, now, target, [0, 0, 0])
            x, y, _, speed = now.robot
            world.step(np.array([x + 0.02 * speed, y, 0.0, speed]), 0.0)
    for second in range(seconds):
        path = predicted[second]
        for ahead in (1, 2, 3):
            vehicle, x = seen[second + ahead]
            _, here, there = np.intersect1d(path.vehicle, vehicle, return_indices=True)
            constant = path.x[0, here] + ahead * path.speed[0, here]
            for wrong, without in zip(path.x[ahead, here] - x[there], constant - x[there], strict=True):
                yield ahead, wrong, without


@pytest.mark.parametrize("name", ["light", "paper", "dense", "jam"])
def test_prediction_against_sumo(name):
    errors = np.array([row for seed in range(3) for row in prediction_errors(name, seed)])
    print(f"\n{name}: position error of the cars within 120 m, mean and 95 % of |error|, m; beside constant speeds")
    for ahead in (1, 2, 3):
        rows = np.abs(errors[errors[:, 0] == ahead, 1:])
        mean, most = rows.mean(axis=0), np.quantile(rows, 0.95, axis=0)
        print(f"  {ahead} s: {mean[0]:5.2f} {most[0]:5.2f}   constant {mean[1]:5.2f} {most[1]:5.2f}   n {len(rows)}")
