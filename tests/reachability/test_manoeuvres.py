import numpy as np
import pytest
from fine_simulation import near_by_simulation

from hj_cosim.control.spc.escape import RESERVE
from hj_cosim.errors import TableError
from hj_cosim.reachability.games.highway.least_between import least_between
from hj_cosim.reachability.games.highway.manoeuvres import Manoeuvres, lower_bounds
from hj_cosim.reachability.table.store import solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import TableSpecification

STEP, DURATION = 0.01, 7.9  # s; of the brute force
TOLERANCE = 0.02  # m, what the steps of the brute force may be wrong by where V is small
EARLY = 20  # samples of STEP


@pytest.fixture(scope="module")
def manoeuvres(small_table: ValueTable) -> Manoeuvres:
    return small_table.manoeuvres()


def only(manoeuvres: Manoeuvres, which: int) -> Manoeuvres:
    return manoeuvres._replace(
        heading=manoeuvres.heading[which : which + 1], acceleration=manoeuvres.acceleration[which : which + 1]
    )


def one_step(
    states: np.ndarray, heading: float, acceleration: float, heading_o: np.ndarray, acceleration_o: np.ndarray
) -> np.ndarray:
    """Return the states (n, 5) a step later, the robot driving a manoeuvre, the other cars with inputs (n,) each."""
    turned = states[:, 2] + np.clip(heading - states[:, 2], -0.3 * STEP, 0.3 * STEP)
    faster = np.clip(states[:, 3] + acceleration * STEP, 0.0, 40.0)
    others = np.clip(states[:, 4] + acceleration_o * STEP, 0.0, 40.0)
    driven, middle = 0.5 * (states[:, 3] + faster) * STEP, 0.5 * (states[:, 2] + turned)
    others_driven = 0.5 * (states[:, 4] + others) * STEP
    x = states[:, 0] + driven * np.cos(middle) - others_driven * np.cos(heading_o)
    y = states[:, 1] + driven * np.sin(middle) - others_driven * np.sin(heading_o)
    return np.column_stack([x, y, turned, faster, others])


def brute_force(
    table: ValueTable, states: np.ndarray, heading: float, acceleration: float, inputs: np.ndarray
) -> np.ndarray:
    """Return the least V(0, .), (n,), of games in which the other cars' (θ_o, a_o) are `inputs`, (T, n, 2)."""
    least = table.target_values(states)
    for other in inputs:
        states = one_step(states, heading, acceleration, other[:, 0], other[:, 1])
        least = np.minimum(least, table.target_values(states))
    return least


def others_inputs(generator: np.random.Generator, games: int) -> np.ndarray:
    """Return what other cars do, (T, games, 2): at their limits or between them, changing their mind now and then."""
    holds, samples = 8, round(DURATION / STEP)
    headings = generator.choice([-0.1, 0.0, 0.1], (holds, games)) * generator.choice([1.0, 0.5], (holds, games))
    accelerations = generator.choice([-6.0, 0.0, 4.0], (holds, games))
    return np.repeat(np.stack([headings, accelerations], axis=2), -(-samples // holds), axis=0)[:samples]


def test_no_other_car_gets_below_what_a_manoeuvre_guarantees(small_table, manoeuvres):
    generator = np.random.default_rng(0)
    states = small_table.draw_states(2000, generator)
    for which, (heading, acceleration) in enumerate(zip(manoeuvres.heading, manoeuvres.acceleration, strict=True)):
        bounds = lower_bounds(only(manoeuvres, which), states)
        near = np.abs(bounds) < 5.0
        assert near.sum() > 20
        inputs = others_inputs(generator, int(near.sum()))
        least = brute_force(small_table, states[near], heading, acceleration, inputs)
        assert (least - bounds[near]).min() >= -TOLERANCE


def test_a_car_that_closes_in_from_behind_attains_what_driving_on_guarantees(small_table, manoeuvres):
    # Straight ahead of the other car, gaps along the road and across it are at their worst for the same inputs.
    which = int(np.flatnonzero((manoeuvres.heading == 0.0) & (manoeuvres.acceleration == 4.0))[0])
    generator = np.random.default_rng(1)
    states = np.column_stack(
        [
            generator.uniform(40.0, 120.0, 200),
            np.zeros(200),
            np.zeros(200),
            generator.uniform(15.0, 25.0, 200),
            generator.uniform(25.0, 32.0, 200),
        ]
    )
    inputs = np.broadcast_to([0.0, 4.0], (round(DURATION / STEP), 200, 2))
    least = brute_force(small_table, states, 0.0, 4.0, inputs)
    bounds = lower_bounds(only(manoeuvres, which), states)
    ahead = least > -5.0  # still ahead of the other car's front
    assert ahead.sum() > 50
    np.testing.assert_allclose(bounds[ahead], least[ahead], atol=0.2)


def test_no_manoeuvre_guarantees_more_than_v0_and_a_robot_that_follows_is_guaranteed_all_of_it(small_table, manoeuvres):
    states = small_table.draw_states(3000, np.random.default_rng(2))
    # In the target set both sides count, of which V(0, .) takes the nearer one.
    assert (lower_bounds(manoeuvres, states) <= np.maximum(small_table.target_values(states), 0.0) + 1e-4).all()
    # Behind in the same lane RSS is kept by braking: V = V0. What the other car can gain by weaving is less than what
    # braking at once gains on RSS's response time.
    following = np.array([[-40.0, 0.0, 0.0, 25.0, 22.0], [-28.5, 0.0, 0.0, 25.0, 22.0], [-60.0, 0.0, 0.0, 30.0, 20.0]])
    np.testing.assert_allclose(
        lower_bounds(manoeuvres, following), small_table.target_values(following), atol=TOLERANCE
    )


def test_left_is_as_good_as_right(small_table, manoeuvres):
    states = small_table.draw_states(1000, np.random.default_rng(3))
    mirrored = states * [1.0, -1.0, -1.0, 1.0, 1.0]
    np.testing.assert_allclose(lower_bounds(manoeuvres, states), lower_bounds(manoeuvres, mirrored), rtol=1e-9)


def test_bodies_that_touch_because_the_robot_is_turned_are_not_escaped_from(small_table, manoeuvres):
    turned_away = np.array([[0.0, 2.85, 0.4, 20.0, 20.0]])  # its rear corner sticks out towards the other car
    assert small_table.target_values(turned_away)[0] > 0.0
    assert lower_bounds(manoeuvres, turned_away)[0] <= 0.0


def test_driving_the_best_manoeuvre_loses_nothing_whatever_the_other_car_does(small_table, manoeuvres):
    generator = np.random.default_rng(4)
    states = small_table.draw_states(20_000, generator)
    singles = np.stack([lower_bounds(only(manoeuvres, which), states) for which in range(len(manoeuvres.heading))])
    near = np.abs(singles.max(axis=0)) < 3.0
    states, singles = states[near], singles[:, near]
    inputs = others_inputs(generator, len(states))[:EARLY]
    for which, (heading, acceleration) in enumerate(zip(manoeuvres.heading, manoeuvres.acceleration, strict=True)):
        best = singles.argmax(axis=0) == which
        later = states[best]
        for other in inputs[:, best]:
            later = one_step(later, heading, acceleration, other[:, 0], other[:, 1])
        # Looked at as far as before.
        game = manoeuvres.game._replace(duration=manoeuvres.game.duration - EARLY * STEP)
        rest = only(manoeuvres, which)._replace(game=game)
        assert (lower_bounds(rest, later) - singles[which, best]).min(initial=0.0) >= -RESERVE


def test_the_least_of_a_line_and_a_cubic_is_exact():
    generator = np.random.default_rng(6)
    count = 20_000
    along = generator.normal(0.0, 1.0, (count, 2)) * generator.choice([0.01, 1.0, 30.0], (count, 1))
    across = generator.normal(0.0, 1.0, (count, 2)) * generator.choice([1e-3, 0.1, 1.0, 4.0], (count, 1))
    shares = np.linspace(0.0, 1.0, 201)
    lines, flats = (ends[:, :1] + shares * (ends[:, 1:] - ends[:, :1]) for ends in (along, across))
    heights = np.maximum(lines, 4.0 * flats**3)
    sampled = heights.min(axis=1)
    found = np.array(
        [least_between(a[0], c[0], a[1], c[1]) for a, c in zip(along.tolist(), across.tolist(), strict=True)]
    )
    assert (found <= sampled + 1e-9).all()
    # The sampled least is above the least of all by no more than a step along either curve.
    steps = np.abs(np.diff(heights, axis=1)).max(axis=1)
    assert (found >= sampled - steps - 1e-9).all()
    crossing = (np.diff(lines > 4.0 * flats**3, axis=1) != 0).any(axis=1)
    assert crossing.mean() > 0.2


def test_the_least_of_a_line_and_a_flat_cubic_is_not_lost_to_newton_s_rule():
    # 4 across³ is flat where across is 0: at the place where both are equal it is still 0.18.
    share = np.linspace(0.0, 1.0, 2_000_001)
    expected = np.maximum(0.6 - 1.2 * share, 4.0 * (-0.3 + 1.8 * share) ** 3).min()
    assert least_between(0.6, -0.3, -0.6, 1.5) == pytest.approx(expected, abs=1e-5)
    assert expected > 0.15


@pytest.mark.parametrize("which", range(15))
def test_a_bound_is_never_above_a_fine_simulation_and_hardly_below_it(small_table, manoeuvres, which):
    states = small_table.draw_states(4000, np.random.default_rng(7 + which))
    bounds = lower_bounds(only(manoeuvres, which), states)
    near, simulated = near_by_simulation(
        small_table.parameters, states, manoeuvres.heading[which], manoeuvres.acceleration[which]
    )
    excess = bounds[near] - simulated
    assert near.sum() > 50
    assert excess.max() < 0.002  # what the simulation is wrong by
    assert np.median(excess) > -0.06
    assert np.quantile(excess, 0.05) > -0.2


def test_other_games_have_no_manoeuvres(braking: TableSpecification):
    with pytest.raises(TableError, match="no manoeuvres are known for the game double_integrator"):
        solve_table(braking).manoeuvres()


def test_a_robot_with_other_limits_has_other_manoeuvres(small_table):
    weak = small_table.manoeuvres({"acceleration_min": -3.0})
    following = np.array([[-40.0, 0.0, 0.0, 25.0, 22.0]])
    assert weak.acceleration.min() == -3.0
    assert lower_bounds(weak, following)[0] < lower_bounds(small_table.manoeuvres(), following)[0] - 5.0
