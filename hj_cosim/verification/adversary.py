"""An adversary that searches: the inputs of another car, and what the filter is asked for, that hurt most.

The other car that the table knows plays the disturbance that lowers V most at every instant, which is not the worst
where V or its gradient is wrong. Here the whole sequence of its inputs is searched for, with the filter in the loop, by
the cross-entropy method: sequences are drawn around a mean, rolled out, and the mean and the deviation are moved to
those that came off worst for the robot, time and again. The desired control can be searched for along with them.

Cross-entropy: Rubinstein & Kroese 2004, The Cross-Entropy Method, chapter 5.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.solver.solver import Progress
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import FilterSettings, RobotSettings
from hj_cosim.verification.adversary_games import (
    CHOSEN,
    CRUISE,
    FULL_THROTTLE,
    INPUTS,
    STEERING_AT_THE_CAR,
    WITHIN_TRACKING,
    Search,
    search_games,
)
from hj_cosim.verification.bodies import bodies_overlap
from hj_cosim.verification.game import Game
from hj_cosim.verification.guarantee import RolloutSettings, game_of

Desired = Literal["cruise", "full_throttle", "steering_at_the_car", "tracker_range", "free"]
DESIRED: Mapping[Desired, int] = {
    "cruise": CRUISE,
    "full_throttle": FULL_THROTTLE,
    "steering_at_the_car": STEERING_AT_THE_CAR,
    "tracker_range": WITHIN_TRACKING,
    "free": CHOSEN,
}

_CHUNK = 10  # games between two signs of progress
_ROUNDS = 400  # draws of starts before they are given up
_DRAWS = 20_000  # states a draw


@dataclass(frozen=True)
class AdversarySettings:
    """What is searched for, how hard, and from where."""

    games: int = 200
    desired: Desired = "cruise"  # kept lane and speed; full acceleration; towards the car; or searched for, too
    above: float = 2.0  # m; starts have above < V <= up_to
    up_to: float = 2.5  # m
    duration: float = 6.0  # s
    segments: int = 12  # in which an input is constant
    population: int = 48  # sequences drawn at once
    elite: int = 8  # of them, those that the next ones are drawn around
    generations: int = 6
    step: float = 0.02  # s
    bicycle: bool = False  # the robot moves as the bicycle does, not as the table assumes
    seed: int = 0


@dataclass(frozen=True)
class AdversaryReport:
    """What the adversary achieved; of every game the rollout that hurt most counts."""

    settings: AdversarySettings
    rollouts: int  # in all games
    entered: int  # games in which it forced V(0, ·) <= 0; a start from V > 0 is outside
    collided: int  # games in which bodies touched, the robot's turned by its heading
    least_target: float  # m, of V(0, ·) over all games
    fall_median: float  # m, by which V fell below where it started, as far as it was looked up in the table
    fall_p90: float
    fall_p99: float
    fall_max: float
    without_escape: int  # games in which at some instant no manoeuvre escaped


def search_adversary(
    table: ValueTable,
    settings: AdversarySettings,
    filter_settings: FilterSettings | None = None,
    robot: RobotSettings | None = None,
    workers: int = 2,
    progress: Progress | None = None,
) -> AdversaryReport:
    """Search for the worst of many games against one other car; the same seed gives the same report.

    Args:
        table: the value function, of the highway game.
        settings: what to search for.
        filter_settings: ε, scheme, λ_3 and whether an escape is kept; the defaults unless given.
        robot: its body and limits; the default unless given.
        workers: threads.
        progress: called with the games played and the games in all.

    Raises:
        ConfigurationError: if the table has no state to start from, or more are to be chosen than are drawn.
        TableError: if the table is not of the highway game.
    """
    if not 1 < settings.elite <= settings.population:
        raise ConfigurationError(
            f"elite = {settings.elite} of population = {settings.population}; it has to be at least 2 and no larger"
        )
    game = game_of(
        table,
        RolloutSettings(step=settings.step, duration=settings.duration),
        filter_settings or FilterSettings(),
        robot or RobotSettings(),
    )
    generator = np.random.default_rng(settings.seed)
    starts, values = _starts(table, game, settings, generator)
    search = Search(
        desired=DESIRED[settings.desired],
        samples=round(settings.duration / settings.step),
        segments=settings.segments,
        population=settings.population,
        elite=settings.elite,
        generations=settings.generations,
        bicycle=settings.bicycle,
    )
    found = np.empty((settings.games, 4))  # least V(0, ·), least V, collided, without escape
    chunks = [slice(first, first + _CHUNK) for first in range(0, settings.games, _CHUNK)]

    def searched(chunk: slice) -> int:
        draws = np.random.default_rng([settings.seed, chunk.start])  # its own, whichever thread plays it
        count = len(starts[chunk])
        shape = (count, settings.generations, settings.population, settings.segments, INPUTS)
        search_games(game, search, starts[chunk], draws.standard_normal(shape), found[chunk])
        return count

    done = 0
    with ThreadPoolExecutor(workers) as threads:
        for count in threads.map(searched, chunks):
            done += count
            if progress is not None:
                progress(done, settings.games)
    fall = np.maximum(values - found[:, 1], 0.0)
    return AdversaryReport(
        settings=settings,
        rollouts=settings.games * settings.population * settings.generations,
        entered=int((found[:, 0] <= 0.0).sum()),
        collided=int((found[:, 2] > 0.0).sum()),
        least_target=float(found[:, 0].min()),
        fall_median=float(np.median(fall)),
        fall_p90=float(np.quantile(fall, 0.9)),
        fall_p99=float(np.quantile(fall, 0.99)),
        fall_max=float(fall.max()),
        without_escape=int((found[:, 3] > 0.0).sum()),
    )


def _starts(
    table: ValueTable, game: Game, settings: AdversarySettings, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return states (games, 5) with V in the range asked for, drawn evenly over the table's, and their V, m.

    Bodies that touch at the beginning are no game: V(0, ·) leaves out how much longer a turned body is along the road.
    """
    states, values, count = [], [], 0
    for _ in range(_ROUNDS):
        draws = table.draw_states(_DRAWS, generator)
        value = table.value(draws)
        good = (value > settings.above) & (value <= settings.up_to)
        for draw in np.flatnonzero(good):
            good[draw] = not bodies_overlap(*draws[draw, :3], game.bodies)
        states.append(draws[good])
        values.append(value[good])
        count += int(good.sum())
        if count >= settings.games:
            return np.concatenate(states)[: settings.games], np.concatenate(values)[: settings.games]
    raise ConfigurationError(
        f"only {count} of {_ROUNDS * _DRAWS} states of the table have {settings.above} < V <= {settings.up_to};"
        f" choose fewer games than {settings.games}, or another range"
    )
