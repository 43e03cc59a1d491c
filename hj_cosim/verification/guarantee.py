"""The guarantee of safety-preserving control, measured: rollouts against the worst other car that the table knows.

The robot is filtered by SPC, the other cars play the disturbance that lowers V most, and everything starts just above
ε. In continuous time, with the exact infinite-horizon V, no rollout could end in the target set. What is lost on the
way has five causes, and every rollout that enters the target set is put down to one of them:

- no escape: from the very start no manoeuvre escapes from all cars, though V is above ε;
- interpolation: V as looked up is above 0 where the formula V(0, ·) is not, which the formula's part in a look-up
  leaves to rounding;
- grid edge: a car came into the table from beyond its edge with V <= 0 already;
- unmet rows: no control could hold V, because the table is not the game's solution there (its nodes are too far apart,
  or the horizon is too short), so that the loss ∫ t dt is at least half of the fall;
- time step: V fell although the rows were met, for the control is held for a step while the gradient changes.

tests/benchmarks/test_filter_guarantee.py measures how many there are of each, also of tables without the cap of the
manoeuvres (`reachability.games.highway.manoeuvre_cap`) or without shear; tests/README.md has the figures.
"""

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from hj_cosim.control.problem.safety_problem import SafetyWeights
from hj_cosim.control.spc.escape import Extent, can_escape, manoeuvres_for
from hj_cosim.control.spc.evasion import Evader
from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.highway.manoeuvres import NO_MANOEUVRES
from hj_cosim.reachability.games.highway.other_car import Disturbance
from hj_cosim.reachability.solver.solver import Progress
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import FilterSettings, RobotSettings, TrackingSettings
from hj_cosim.verification.bodies import Bodies, where_bodies_overlap
from hj_cosim.verification.filter_games import (
    COLLIDE,
    CRUISE,
    RANDOM,
    RANDOM_HOLD,
    roll_out_all,
    where_bodies_overlap_in_world,
)
from hj_cosim.verification.game import Game

Desire = Literal["cruise", "random", "collide"]
Model = Literal["game", "bicycle"]
Others = Literal["adversary", "rogue", "driver"]

CAUSES = ("no escape", "interpolation", "grid edge", "unmet rows", "time step")

_DESIRES: Mapping[Desire, int] = {"cruise": CRUISE, "random": RANDOM, "collide": COLLIDE}
_CHUNK = 1000  # rollouts simulated before their trajectories are judged; bounds the memory
_ROUNDS = 4000  # draws for each start before it is given up


@dataclass(frozen=True)
class RolloutSettings:
    """What is rolled out."""

    rollouts: int = 100_000
    duration: float = 10.0  # s
    step: float = 0.02  # s
    desire: Desire = (
        "cruise"  # what the filter is given: lane and speed kept, anything, or the control that lowers V most
    )
    model: Model = "game"  # how the robot moves: as the table assumes, or as the bicycle does
    # Who the other cars are: the worst for V within what the table assumes of them, the worst within their limits
    # alone, whatever their duties, or IDM drivers that keep their lane.
    others: Others = "adversary"
    cars: int = 1  # other cars, each of them a pair with V just above ε
    curvature: float = 0.0  # 1/m, of the road at d = 0; both cars are in the world, the filter in the road frame
    half_wave: float = math.inf  # m, in which clothoids turn the road over to the other side, as an S does
    band: float = 0.5  # m; starts have ε < V <= ε + band
    seed: int = 0


@dataclass(frozen=True)
class GuaranteeReport:
    """What became of the rollouts."""

    settings: RolloutSettings
    epsilon: float  # m
    rollouts: int  # that could be started
    without_escape: int  # of them, those from whose start no manoeuvre escapes from all cars; 0 of an unknown game
    entered: int  # rollouts that entered the target set, V(0, ·) <= 0
    collided: int  # rollouts in which bodies overlapped, the robot's turned by its heading
    collided_unturned: int  # those in which they overlap with both along the road, as the target set takes them
    collided_in_world: int  # those in which they overlap on the road as it bends, not as the road frame has it
    fall_median: float  # m, of V below ε: how far it fell at most in a rollout
    fall_p99: float
    fall_p999: float
    fall_max: float
    unmet_percent: float  # of the steps with cars in K, those whose rows could not be met
    causes: Mapping[str, int]  # of the rollouts that entered

    @property
    def entered_percent(self) -> float:
        """Share of the rollouts that entered the target set, %."""
        return 100.0 * self.entered / max(self.rollouts, 1)


def measure_guarantee(
    table: ValueTable,
    settings: RolloutSettings,
    filter_settings: FilterSettings | None = None,
    robot: RobotSettings | None = None,
    workers: int = 2,
    progress: Progress | None = None,
    start_table: ValueTable | None = None,
) -> GuaranteeReport:
    """Roll out and report how well SPC keeps its promise.

    Args:
        table: the value function, of the highway game.
        settings: what to roll out.
        filter_settings: ε, scheme and λ_3; the defaults unless given. The problem is solved by enumeration.
        robot: its body and limits; the default unless given.
        workers: threads.
        progress: called with the parts played and the parts in all, after each of them.
        start_table: whose V is just above ε at the start; the same unless given.

    Raises:
        ConfigurationError: if that table has no state with V just above ε.
        TableError: if the table is not of the highway game.
    """
    filter_settings = filter_settings or FilterSettings()
    robot = robot or RobotSettings()
    game = game_of(table, settings, filter_settings, robot)
    generator = np.random.default_rng(settings.seed)
    robots, others = _starts(start_table or table, game, settings, generator)
    holds = math.ceil(settings.duration / settings.step / RANDOM_HOLD)
    if table.game.manoeuvres is not None:
        escapes = can_escape(manoeuvres_for(table, robot), robots, others)
    else:
        escapes = np.ones(len(robots), bool)
    random = generator.uniform(game.limits[::2], game.limits[1::2], (len(robots), holds, 2))
    chunks = [slice(first, first + _CHUNK) for first in range(0, len(robots), _CHUNK)]

    def judged(chunk: slice) -> _Judged:
        return _simulate_and_judge(table, game, settings, robots[chunk], others[chunk], random[chunk], escapes[chunk])

    with ThreadPoolExecutor(workers) as threads:
        parts = []
        for part in threads.map(judged, chunks):
            parts.append(part)
            if progress is not None:
                progress(len(parts), len(chunks))
    return _report(settings, filter_settings.epsilon, int((~escapes).sum()), parts)


def game_of(table: ValueTable, settings: RolloutSettings, spc: FilterSettings, robot: RobotSettings) -> Game:
    """Return what stays the same over all rollouts, as the kernels take it.

    Raises:
        TableError: if the table is not of the highway game.
    """
    weights, other = SafetyWeights.of(spc, robot), Disturbance.of_game(table.parameters)
    grid, turn = table.grid, robot.omega_max * settings.step  # as SPC keeps away from the table's last heading
    return Game(
        table=table.arrays,
        limits=np.array([-robot.omega_max, robot.omega_max, robot.acceleration_min, robot.acceleration_max]),
        bounds=np.array([grid.lower[2] + turn, grid.upper[2] - turn, 0.0, min(robot.speed_max, grid.upper[3])]),
        other_speed_max=float(grid.upper[4]),
        weights=np.array([weights.omega, weights.acceleration, weights.slack]),
        slack_is_free=weights.slack_is_free,
        epsilon=spc.epsilon,
        recovery=spc.recovery,
        approach=spc.approach,
        smooth=spc.smooth_gradient,
        sideways=robot.lateral_acceleration_max,
        step=settings.step,
        other=other,
        played=other._replace(responsible=False) if settings.others == "rogue" else other,
        extent=Extent.of(table),
        manoeuvres=manoeuvres_for(table, robot) if spc.keep_escape else NO_MANOEUVRES,
        driver=np.array([0.0, 3.0, 5.0, 1.5, 5.0, 4.0]),  # IDM's means; the desired speed is each car's own
        k_theta=TrackingSettings().k_theta,
        wheelbase=robot.wheelbase,
        bodies=Bodies(robot.length, robot.width, table.size.length, table.size.width),
        evades=spc.evade and spc.keep_escape,
        evader=Evader.of(robot, -math.inf, math.inf),
        curvature=settings.curvature,
        half_wave=settings.half_wave,
    )


def _starts(
    table: ValueTable, game: Game, settings: RolloutSettings, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return robots (n, 4) at the origin, or anywhere along an S, and other cars (n, cars, 3), drawn evenly over the
    table's states with ε < V <= ε + band; with several cars n may be below what was asked for, where a robot's state
    allows no such pair.
    """
    found = np.empty((settings.rollouts, settings.cars, 5))
    pending = np.arange(settings.rollouts)
    for car in range(settings.cars):
        for _ in range(_ROUNDS):
            draws = table.draw_states(len(pending), generator)
            if car > 0:  # the robot is the same for all its pairs
                draws[:, 2:4] = found[pending, 0, 2:4]
            value = table.value(draws)
            good = (value > game.epsilon) & (value <= game.epsilon + settings.band)
            for before in range(car):
                apart = np.abs(draws[:, :2] - found[pending, before, :2])
                good &= (apart[:, 0] > game.bodies.other_length) | (apart[:, 1] > game.bodies.other_width)
            found[pending[good], car] = draws[good]
            pending = pending[~good]
            if len(pending) == 0:
                break
        done = np.setdiff1d(np.arange(len(found)), pending)
        found, pending = found[done], np.arange(len(done))
    if len(found) == 0:
        raise ConfigurationError(
            f"no state of the table has {game.epsilon} < V <= {game.epsilon + settings.band}; choose another epsilon"
        )
    robots = np.zeros((len(found), 4))
    robots[:, 2:4] = found[:, 0, 2:4]
    others = np.stack([-found[:, :, 0], -found[:, :, 1], found[:, :, 4]], axis=2)
    if settings.half_wave < math.inf:  # anywhere in the S
        start = generator.uniform(0.0, 2.0 * settings.half_wave, len(found))
        robots[:, 0] += start
        others[:, :, 0] += start[:, np.newaxis]
    return robots, others


class _Judged(NamedTuple):
    """What became of one chunk."""

    fall: np.ndarray  # (n,) m, of the least V below ε
    collided: int
    collided_unturned: int
    collided_in_world: int
    causes: np.ndarray  # (entered,) int, index into CAUSES
    in_k: int  # steps with cars in K
    unmet: int


def _simulate_and_judge(
    table: ValueTable,
    game: Game,
    settings: RolloutSettings,
    robots: np.ndarray,
    others: np.ndarray,
    random: np.ndarray,
    escapes: np.ndarray,
) -> _Judged:
    count, samples = len(robots), round(settings.duration / settings.step)
    written = np.empty((count, samples + 1, settings.cars, 7), np.float32)
    values = np.empty((count, samples + 1, settings.cars), np.float32)
    slack = np.empty((count, samples), np.float32)
    private = game._replace(driver=game.driver.copy())  # the kernel writes a driver's speed into it
    roll_out_all(
        private,
        _DESIRES[settings.desire],
        settings.model == "bicycle",
        settings.others != "driver",
        robots.copy(),
        others.copy(),
        random,
        written,
        values,
        slack,
    )
    states, places = written[..., :5], written[..., 5:].astype(float)
    overlap = where_bodies_overlap_in_world(game, states.reshape(-1, 5).astype(float), places.reshape(-1, 2))
    target = table.target_values(states.reshape(-1, 5)).reshape(values.shape)
    inside = target <= 0.0
    causes = []
    for i in np.nonzero(inside.any(axis=(1, 2)))[0]:
        car = int(np.argmax(inside[i, np.argmax(inside[i].any(axis=1))]))  # the first to be in the target set
        causes.append(_cause(values[i, :, car], target[i, :, car], slack[i], game) if escapes[i] else 0)
    # Rows are asked for above ε already, where V may fall; K are the cars at ε and below.
    in_k = np.isfinite(slack) & (values[:, :-1] <= game.epsilon).any(axis=2)
    return _Judged(
        fall=np.maximum(game.epsilon - values.min(axis=(1, 2)), 0.0),
        collided=_collided(states, game),
        collided_unturned=_collided(states * [1, 1, 0, 1, 1], game),
        collided_in_world=int(overlap.reshape(count, -1).any(axis=1).sum()),
        causes=np.array(causes, dtype=int),
        in_k=int(in_k.sum()),
        unmet=int((slack[in_k] > 1e-6).sum()),
    )


def _collided(states: np.ndarray, game: Game) -> int:
    """Return in how many of the rollouts, (n, samples, cars, 5), bodies overlap."""
    overlap = where_bodies_overlap(states.reshape(-1, 5), game.bodies)
    return int(overlap.reshape(len(states), -1).any(axis=1).sum())


def _cause(value: np.ndarray, target: np.ndarray, slack: np.ndarray, game: Game) -> int:
    """Return why a pair entered the target set from whose start there was an escape, an index into CAUSES.

    Args:
        value, target: (samples + 1,) V and V(0, ·) of the pair.
        slack: (samples,) t.
        game: ε and the step.
    """
    entry = int(np.argmax(target <= 0.0))
    if value[entry] > 0.0:
        return 1
    above = np.nonzero(value[: entry + 1] > game.epsilon)[0]
    first = int(above[-1]) + 1 if len(above) else 0  # since when the pair has been in K
    if first > 0 and np.isinf(value[first - 1]) and value[first] <= 0.0:
        return 2
    unmet = float(np.nansum(np.maximum(slack[first:entry], 0.0))) * game.step
    fallen = game.epsilon - float(value[entry])
    return 3 if unmet >= 0.5 * fallen else 4


def _report(settings: RolloutSettings, epsilon: float, without_escape: int, parts: list[_Judged]) -> GuaranteeReport:
    fall = np.concatenate([part.fall for part in parts])
    causes = np.concatenate([part.causes for part in parts])
    in_k = sum(part.in_k for part in parts)
    return GuaranteeReport(
        settings=settings,
        epsilon=epsilon,
        rollouts=len(fall),
        without_escape=without_escape,
        entered=len(causes),
        collided=sum(part.collided for part in parts),
        collided_unturned=sum(part.collided_unturned for part in parts),
        collided_in_world=sum(part.collided_in_world for part in parts),
        fall_median=float(np.median(fall)),
        fall_p99=float(np.quantile(fall, 0.99)),
        fall_p999=float(np.quantile(fall, 0.999)),
        fall_max=float(fall.max()),
        unmet_percent=100.0 * sum(part.unmet for part in parts) / max(in_k, 1),
        causes={name: int((causes == index).sum()) for index, name in enumerate(CAUSES)},
    )
