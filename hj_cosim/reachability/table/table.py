"""What a solved value table answers: values, gradients, optimal inputs, rows for a filter."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hj_cosim.errors import StateError, TableError
from hj_cosim.reachability.games.contract import TWO_CARS, Game, HalfPlanes, RowsOfCars, SizeClass
from hj_cosim.reachability.games.highway.target import TargetFormula
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver.solver import SolveReport, state_limits
from hj_cosim.reachability.table.deficits import deficits
from hj_cosim.reachability.table.interpolation import interpolate
from hj_cosim.reachability.table.lookup import values_and_gradients
from hj_cosim.reachability.table.size_classes import CAR
from hj_cosim.reachability.table.stack import TableStack, stacked
from hj_cosim.reachability.table.states import state_rows
from hj_cosim.reachability.table.table_arrays import TableArrays, TableGrid
from hj_cosim.settings import TableSpecification

_NO_TARGET = TargetFormula(*(0.0,) * len(TargetFormula._fields))


@dataclass(frozen=True)
class ValueTable:
    """V(−horizon, ·) on a grid.

    Whoever asks about states gives them as (N, n), or (n,) for one; another shape, or an angle beyond ± π, is a
    StateError. Of a state that is not finite nothing is known, and every answer about it is NaN.
    """

    specification: TableSpecification
    game: Game
    values: np.ndarray  # float32, C order, axes in the order of the state, the margin subtracted
    report: SolveReport
    size: SizeClass = CAR  # the largest other cars that it is for
    # Of the same game and robot, for larger other cars, as far as any are met: `store.with_larger` adds them.
    larger: tuple["ValueTable", ...] = ()

    @cached_property
    def grid(self) -> Grid:
        """The nodes."""
        return Grid.from_settings(self.specification.grid, self.game.boundary)

    @cached_property
    def parameters(self) -> Mapping[str, float]:
        """Every parameter of the game, as the table was solved with."""
        return {**self.game.parameters, **self.specification.parameters}

    @cached_property
    def arrays(self) -> TableArrays:
        """The table as jitted look-ups take it.

        Raises:
            TableError: if it is not a table of a game of two cars.
        """
        game, grid = self.game, self.grid
        game.require_two_cars()
        lower, upper, spacing = np.array(grid.lower), np.array(grid.upper), np.array(grid.spacing)
        shear = 0.0 if game.shear is None else self.parameters[game.shear.parameter]
        if game.target_formula is None:
            target, deficit = _NO_TARGET, -self.values
        else:
            target = game.target_formula(self.parameters)
            deficit = deficits(self.values, lower, spacing, shear, target)
        grid_of_it = TableGrid(
            0,
            deficit.shape,
            _five(lower),
            _five(upper),
            _five(1.0 / spacing),
            shear,
            target,
            game.target_formula is not None,
        )
        return TableArrays(np.ascontiguousarray(deficit).reshape(-1), grid_of_it)

    @property
    def by_size(self) -> tuple["ValueTable", ...]:
        """The table itself, and those of larger other cars, the smallest first."""
        return (self, *self.larger)

    @cached_property
    def stack(self) -> TableStack:
        """The tables by size class as jitted look-ups take them, each car's being that of its class.

        Raises:
            TableError: if it is not a table of a game of two cars.
        """
        return stacked([((table.size.length, table.size.width), table.arrays) for table in self.by_size])

    def manoeuvres(self, robot: Mapping[str, float] | None = None) -> Any:
        """Return the manoeuvres of the table's game, which judge states without its grid, as its kernels take them.

        Args:
            robot: parameters of the game that are the robot's own, if other than the game's.

        Raises:
            TableError: if none are known for the game.
        """
        if self.game.manoeuvres is None:
            raise TableError(f"no manoeuvres are known for the game {self.game.name}")
        return self.game.manoeuvres.of_game({**self.parameters, **(robot or {})}, self.grid)

    def guaranteed(self, states: np.ndarray) -> np.ndarray:
        """Return what the best manoeuvre guarantees at `states` (N, n), (N,): a lower bound of V without the grid.

        Raises:
            TableError: if no manoeuvres are known for the game.
        """
        manoeuvres = self.manoeuvres()
        rows, known = self._known_rows(states)
        assert self.game.manoeuvres is not None  # else there are none to return
        bounds = self.game.manoeuvres.lower_bounds(manoeuvres, rows)
        bounds[~known] = np.nan
        return bounds

    def value_and_gradient(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return V (N,) and ∂V/∂x (N, n) at `states` (N, n), outside the grid as the game says.

        A table of two cars is looked up as planning and filtering do; of other games V is interpolated itself.
        """
        rows, known = self._known_rows(states)
        values, gradients = self._look_up(rows)
        values[~known], gradients[~known] = np.nan, np.nan
        return values, gradients

    def _look_up(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.game.state == TWO_CARS:
            return values_and_gradients(*self.arrays, rows)
        grid = self.grid
        return interpolate(
            self.values.reshape(-1),
            np.array(grid.shape),
            np.array(grid.lower),
            1.0 / grid.spacing,
            np.array([boundary == "periodic" for boundary in grid.boundary]),
            np.array([outside == "safe" for outside in self.game.outside]),
            rows,
        )

    def value(self, states: np.ndarray) -> np.ndarray:
        """Return V, (N,), at `states` (N, n)."""
        return self.value_and_gradient(states)[0]

    def gradient(self, states: np.ndarray) -> np.ndarray:
        """Return ∂V/∂x, (N, n), at `states` (N, n), per state unit."""
        return self.value_and_gradient(states)[1]

    def optimal_control(self, states: np.ndarray) -> np.ndarray:
        """Return the controls that raise V most, (N, controls) (paper, eq. HJI optimal control)."""
        return self._optimal(states)[0]

    def optimal_disturbance(self, states: np.ndarray) -> np.ndarray:
        """Return the disturbances that lower V most, (N, disturbances)."""
        return self._optimal(states)[1]

    def _optimal(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows, known = self._known_rows(states)
        u, d = self.game.optimal(rows, self._look_up(rows)[1], self.parameter_array(), self.state_limits())
        u[~known], d[~known] = np.nan, np.nan
        return u, d

    @cached_property
    def half_planes(self) -> HalfPlanes:
        """What a filter asks of its control u: states (K, n) and gradients (K, n) to a row per control and c, (.., K).

        Coefficients · u + c is dV/dt at the worst disturbance, so that V falls for none where it is 0 or more. Not
        checked as other questions are, for a filter asks at every step: the states have to be right.
        """
        return self.game.half_planes(self.parameters, self.state_limits())

    @cached_property
    def closed_rows(self) -> RowsOfCars | None:
        """The game's own way to the rows of all cars, if it has one; `cars.rows_of_cars` takes it."""
        if self.game.closed_rows is None:
            return None
        if not self.larger:
            return self.game.closed_rows(self.parameters)
        return self.game.closed_rows(self.parameters, [(table.size, table.parameters) for table in self.larger])

    def target_values(self, states: np.ndarray) -> np.ndarray:
        """Return V(0, ·), (N,), the formula itself, at `states` (N, n)."""
        rows, known = self._known_rows(states)
        values = self.game.target_values(self._grid_points(rows), self.parameter_array())
        values[~known] = np.nan
        return values

    def parameter_array(self) -> np.ndarray:
        """Return the parameters as the game's functions take them."""
        return self.game.parameter_values(self.specification.parameters, "the table")

    def state_limits(self) -> np.ndarray:
        """Return the limits that inputs respect, (2, n) float32."""
        return state_limits(self.game, self.grid, self.specification.state_limits)

    def in_grid(self, states: np.ndarray) -> np.ndarray:
        """Return which of `states` (N, n) lie within the grid on every axis that is not periodic, (N,) bool.

        One that is not finite does not.
        """
        rows, known = self._known_rows(states)
        points, grid = self._grid_points(rows), self.grid
        wraps = np.array([boundary == "periodic" for boundary in grid.boundary])
        inside = (points >= np.array(grid.lower)) & (points <= np.array(grid.upper))
        return np.asarray((inside | wraps).all(axis=1) & known)

    def draw_states(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Return random states, (count, n), spread evenly over the grid."""
        points = generator.uniform(self.grid.lower, self.grid.upper, (count, self.grid.dimension))
        return self.game.states_at(points, self.parameters)

    def extent(self, axis: int, held: np.ndarray) -> tuple[float, float]:
        """Return the first and the last coordinate of the grid along a state variable, the others held, (n,).

        Raises:
            StateError: if `held` is no single state.
        """
        ahead = np.array(held, np.float64)
        if ahead.ndim != 1:
            raise StateError(
                f"what is held has the shape {ahead.shape}; one state is right: {', '.join(self.game.state)}"
            )
        state_rows(self.game, self.grid, ahead)
        ahead[axis] = 0.0
        shift = float(ahead[axis] - self._grid_points(ahead)[axis])
        return self.grid.lower[axis] + shift, self.grid.upper[axis] + shift

    def _known_rows(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states as rows, the grid's first node in place of one that is not finite, and which are, (N,) bool."""
        rows = state_rows(self.game, self.grid, states)
        known = np.isfinite(rows).all(axis=1)
        return (rows if known.all() else np.where(known[:, None], rows, self.grid.lower)), known

    def _grid_points(self, states: np.ndarray) -> np.ndarray:
        return self.game.grid_points(states, self.parameters)


def _five(numbers: np.ndarray) -> tuple[float, float, float, float, float]:
    first, second, third, fourth, fifth = (float(number) for number in numbers)
    return first, second, third, fourth, fifth
