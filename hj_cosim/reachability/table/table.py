"""Solved value tables: made from a specification, kept in a file, asked for values, gradients and optimal inputs."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from hj_cosim import locations
from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.files import whole_file
from hj_cosim.reachability.games.catalogue import find_dynamics
from hj_cosim.reachability.games.contract import Dynamics
from hj_cosim.reachability.games.highway import game as highway
from hj_cosim.reachability.games.highway.manoeuvre_cap import capped
from hj_cosim.reachability.games.highway.manoeuvres import Manoeuvres, manoeuvres_of
from hj_cosim.reachability.games.highway.target import TargetFormula
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver.solver import Progress, SolveReport, solve, state_limits
from hj_cosim.reachability.table.interpolation import interpolate
from hj_cosim.reachability.table.lookup import TableArrays, deficits, values_and_gradients
from hj_cosim.reachability.table.table_file import TableFile, open_table_file
from hj_cosim.settings import TableSpecification, read_toml, validate

# Part of every specification's hash: raised when the solver changes what it computes, so that tables are re-solved.
_SOLVER_VERSION = 4


@dataclass(frozen=True)
class ValueTable:
    """V(−horizon, ·) on a grid."""

    specification: TableSpecification
    dynamics: Dynamics
    values: np.ndarray  # float32, C order, axes in the order of the state, the margin subtracted
    report: SolveReport

    @property
    def grid(self) -> Grid:
        """The nodes."""
        return Grid.from_settings(self.specification.grid, self.dynamics.boundary)

    @property
    def parameters(self) -> dict[str, float]:
        """Every parameter of the dynamics, as the table was solved with."""
        return {**self.dynamics.parameters, **self.specification.parameters}

    @property
    def is_highway(self) -> bool:
        """Whether V(0, ·) is the highway game's: then look-ups know its formula, and the grid may be sheared."""
        return self.dynamics.target is highway.target

    @property
    def _braking_shear(self) -> float:
        return self.parameters["braking_shear"] if self.is_highway else 0.0

    @cached_property
    def arrays(self) -> TableArrays:
        """The table as jitted look-ups take it.

        Raises:
            TableError: if it is not a table of the five-dimensional highway game.
        """
        if self.dynamics.state != highway.dynamics.state:
            raise TableError(
                f"a table of {self.dynamics.name} has the state {', '.join(self.dynamics.state)};"
                " planning and filtering need p_x, p_y, theta, v_r, v_o"
            )
        grid = self.grid
        lower, upper, spacing = np.array(grid.lower), np.array(grid.upper), np.array(grid.spacing)
        parameters = highway.PARAMETERS | self.parameters
        target = TargetFormula.of_game(parameters)
        shear = self._braking_shear
        deficit = deficits(self.values, lower, spacing, shear, target) if self.is_highway else -self.values
        return TableArrays(
            deficit,
            deficit.reshape(-1),
            _five(lower),
            _five(upper),
            _five(1.0 / spacing),
            shear,
            target,
            self.is_highway,
        )

    def manoeuvres(self, robot: Mapping[str, float] | None = None) -> Manoeuvres:
        """Return the manoeuvres of the table's game, which judge states without its grid.

        Args:
            robot: parameters of the game that are the robot's own, if other than the game's.

        Raises:
            TableError: if it is not a table of the highway game.
        """
        if not self.is_highway:
            raise TableError(f"there are no manoeuvres for {self.dynamics.name}, only for the highway game")
        return manoeuvres_of({**self.parameters, **(robot or {})}, self.grid)

    def value_and_gradient(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return V (N,) and ∂V/∂x (N, n) at `states` (N, n), outside the grid as the dynamics say.

        A table of the highway game is looked up as planning and filtering do; of other games V is interpolated itself.
        Of a state that is not finite nothing is known: NaN.
        """
        rows = np.atleast_2d(np.asarray(states, np.float64))
        unknown = np.flatnonzero(~np.isfinite(rows).all(axis=1))
        if len(unknown) == 0:
            return self._look_up(rows)
        known = rows.copy()
        known[unknown] = self.grid.lower
        values, gradients = self._look_up(known)
        values[unknown], gradients[unknown] = np.nan, np.nan
        return values, gradients

    def _look_up(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.is_highway:
            return values_and_gradients(self.arrays, rows)
        grid = self.grid
        return interpolate(
            self.values.reshape(-1),
            np.array(grid.shape),
            np.array(grid.lower),
            1.0 / grid.spacing,
            np.array([boundary == "periodic" for boundary in grid.boundary]),
            np.array([outside == "safe" for outside in self.dynamics.outside]),
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
        rows = np.atleast_2d(states)
        return self.dynamics.optimal(rows, self.gradient(rows), self.parameter_array(), self.state_limits())

    def target_values(self, states: np.ndarray) -> np.ndarray:
        """Return V(0, ·), (N,), the formula itself, at `states` (N, n)."""
        return self.dynamics.target_values(self._grid_points(np.atleast_2d(states)), self.parameter_array())

    def parameter_array(self) -> np.ndarray:
        """Return the parameters as the dynamics' functions take them."""
        return self.dynamics.parameter_values(self.specification.parameters, "the table")

    def state_limits(self) -> np.ndarray:
        """Return the limits that inputs respect, (2, n) float32."""
        return state_limits(self.dynamics, self.grid, self.specification.state_limits)

    def in_grid(self, states: np.ndarray) -> np.ndarray:
        """Return which of `states` (N, n) lie within the grid on every axis that is not periodic, (N,) bool."""
        rows = self._grid_points(np.atleast_2d(states))
        grid = self.grid
        wraps = np.array([boundary == "periodic" for boundary in grid.boundary])
        inside = (rows >= np.array(grid.lower)) & (rows <= np.array(grid.upper))
        return np.asarray((inside | wraps).all(axis=1))

    def draw_states(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Return random states, (count, n), spread evenly over the grid."""
        points = generator.uniform(self.grid.lower, self.grid.upper, (count, self.grid.dimension))
        return highway.states_at(points, self._braking_shear) if self.is_highway else points

    def extent(self, axis: int, held: np.ndarray) -> tuple[float, float]:
        """Return the first and the last coordinate of the grid along a state variable, the others held, (n,)."""
        ahead = np.array(held, np.float64)
        ahead[axis] = 0.0
        shift = float(ahead[axis] - self._grid_points(ahead)[axis])
        return self.grid.lower[axis] + shift, self.grid.upper[axis] + shift

    def _grid_points(self, states: np.ndarray) -> np.ndarray:
        return highway.grid_points(states, self._braking_shear) if self.is_highway else states

    def save(self, path: Path) -> None:
        """Write the table, whole or not at all.

        Raises:
            HjCosimError: if it cannot be written.
        """
        arrays = {"values": self.values} | {f"axis{i}": axis for i, axis in enumerate(self.grid.axes)}
        specification = self.specification.model_dump_json()
        report = asdict(self.report) | {
            "specification_hash": specification_hash(self.specification, self.dynamics),
            "checksum": _checksum(arrays, specification),
        }
        with whole_file(path) as temporary:
            content: dict[str, Any] = {
                **arrays,
                "spec": np.array(specification),
                "report": np.array(json.dumps(report)),
            }
            np.savez(temporary, **content)

    @staticmethod
    def load(path: Path, specification: TableSpecification | None = None) -> "ValueTable":
        """Return the table in a file, which anybody may have made.

        Args:
            path: the .npz.
            specification: what it must have been solved from, the place of its dynamics included. Without one, a
                table whose game is a Python file is refused: loading a table runs nothing that the table names.

        Raises:
            TableError: if it is missing, truncated, altered, not finite, or was solved by another version of the
                dynamics.
        """
        if not path.is_file():
            raise TableError(f"there is no table {path}; solve it with `hj-cosim table solve`")
        with open_table_file(path) as file:
            specification_json = file.text("spec")
            found = TableSpecification.model_validate_json(specification_json)
            report = _report_of(file)
            if found.dynamics.endswith(".py") and found.dynamics != (specification and specification.dynamics):
                raise TableError(
                    f"{path} names the Python file {found.dynamics} as its game, which is not run because a table says"
                    " so; load it by its specification"
                )
            dynamics = find_dynamics(found.dynamics)
            grid = Grid.from_settings(found.grid, dynamics.boundary)
            shapes = {f"axis{number}": (nodes,) for number, nodes in enumerate(grid.shape)}
            if set(file.names) != {"values", "spec", "report", *shapes} or grid.dimension != dynamics.dimension:
                raise ValueError(f"it holds {', '.join(sorted(file.names))}, which is no table of {dynamics.name}")
            arrays = {name: file.array(name, shape, np.float64) for name, shape in shapes.items()}
            if not all(np.allclose(arrays[f"axis{i}"], axis, rtol=1e-12) for i, axis in enumerate(grid.axes)):
                raise ValueError("its axes are not those of its specification")
            arrays["values"] = file.array("values", grid.shape, np.float32)
        if report.checksum != _checksum(arrays, specification_json):
            raise TableError(f"{path} was altered after it was solved; delete it and solve it again")
        if report.specification_hash != specification_hash(found, dynamics):
            raise TableError(f"{path} was solved by another version of {dynamics.name}; solve it again")
        report_fields = {field.name: getattr(report, field.name) for field in fields(SolveReport)}
        return ValueTable(found, dynamics, arrays["values"], SolveReport(**report_fields))


@dataclass(frozen=True)
class _KeptReport(SolveReport):
    """The report as a table's file has it."""

    specification_hash: str
    checksum: str


def _report_of(file: TableFile) -> _KeptReport:
    """Return a file's report.

    Raises:
        ValueError: if it is no JSON, or says something else than a report.
    """
    return TypeAdapter(_KeptReport).validate_json(file.text("report"))


def _five(numbers: np.ndarray) -> tuple[float, float, float, float, float]:
    first, second, third, fourth, fifth = (float(number) for number in numbers)
    return first, second, third, fourth, fifth


def specification_hash(specification: TableSpecification, dynamics: Dynamics) -> str:
    """Return what identifies a table's content: the specification, the dynamics' source, the solver's version."""
    # The description says nothing about the values, nor does the place of a dynamics file.
    content = specification.model_dump_json(exclude={"description", "dynamics"})
    return hashlib.sha256(f"{_SOLVER_VERSION} {dynamics.fingerprint} {content}".encode()).hexdigest()


def _checksum(arrays: dict[str, np.ndarray], specification: str) -> str:
    digest = hashlib.sha256(specification.encode())
    for name in sorted(arrays):
        digest.update(f"{name} {arrays[name].shape} {arrays[name].dtype}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()


def find_specification(name_or_path: str) -> Path:
    """Return the TOML file of a specification: a name in value_tables/, or a path ending in .toml.

    Raises:
        ConfigurationError: if there is none.
    """
    return locations.find_toml(str(name_or_path), locations.specifications_folder(), "table specification")


def read_specification(path: Path) -> TableSpecification:
    """Return the specification in a TOML file, checked against the dynamics that it names.

    Raises:
        ConfigurationError: if it cannot be read, or a key or a value is wrong.
    """
    specification = validate(TableSpecification, read_toml(path), str(path))
    if specification.dynamics.endswith(".py"):
        specification = specification.model_copy(
            update={"dynamics": str((path.parent / Path(specification.dynamics).expanduser()).resolve())}
        )
    try:
        dynamics = find_dynamics(specification.dynamics)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    if len(specification.grid.shape) != dynamics.dimension:
        raise ConfigurationError(
            f"{path}: grid.shape has {len(specification.grid.shape)} entries; {dynamics.name} has"
            f" {dynamics.dimension} axes: {', '.join(dynamics.state)}"
        )
    dynamics.parameter_values(specification.parameters, str(path))
    _require_manoeuvres(specification, dynamics, str(path))
    return specification


def _require_manoeuvres(specification: TableSpecification, dynamics: Dynamics, name: str) -> None:
    if specification.capped_by_manoeuvres and dynamics.target is not highway.target:
        raise ConfigurationError(
            f"{name}: capped_by_manoeuvres is for the highway game, whose manoeuvres are known, not for {dynamics.name}"
        )


def table_path(specification_path: Path) -> Path:
    """Return where the solved table of a specification file is kept."""
    if specification_path.parent == locations.specifications_folder():
        return locations.tables_folder() / f"{specification_path.stem}.npz"
    return specification_path.with_suffix(".npz")


def solve_table(specification: TableSpecification | str, progress: Progress | None = None) -> ValueTable:
    """Solve a specification, or the one that a name or a path means; nothing is written.

    Args:
        specification: what to solve, or its name in value_tables/, or a path to a TOML file.
        progress: called with the steps done and the steps in all, after each step.

    Returns:
        The table.

    Raises:
        ConfigurationError: if the specification is wrong.
        TableError: if the solution is not finite.
    """
    name = "the table specification"
    if isinstance(specification, str):
        name = str(find_specification(specification))
        specification = read_specification(Path(name))
    dynamics = find_dynamics(specification.dynamics)
    _require_manoeuvres(specification, dynamics, name)
    values, report = solve(specification, dynamics, name, progress)
    if specification.capped_by_manoeuvres:
        grid = Grid.from_settings(specification.grid, dynamics.boundary)
        values = capped(values, grid, {**dynamics.parameters, **specification.parameters})
    return ValueTable(specification, dynamics, values - np.float32(specification.margin), report)


def load_table(name_or_path: str, progress: Progress | None = None) -> ValueTable:
    """Return the solved table of a specification; solve and keep it if there is none or the specification changed.

    Args:
        name_or_path: a name in value_tables/, or a path to a TOML file.
        progress: called with the steps done and the steps in all, after each step of a solve.

    Raises:
        ConfigurationError: if the specification is wrong.
        TableError: if the kept table is truncated or was altered.
    """
    path = find_specification(name_or_path)
    specification = read_specification(path)
    kept = table_path(path)
    if kept.is_file() and _kept_hash(kept) == specification_hash(specification, find_dynamics(specification.dynamics)):
        return ValueTable.load(kept, specification)
    table = solve_table(specification, progress)
    table.save(kept)
    return table


def _kept_hash(path: Path) -> str:
    """Return the specification hash in a table's file without reading its values."""
    with open_table_file(path) as file:
        return _report_of(file).specification_hash
