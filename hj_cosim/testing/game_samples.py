"""A game with states, slopes and inputs to try it on; how its functions are called while they are watched."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba.core.errors import NumbaError

from hj_cosim.reachability.games.contract import FUNCTIONS, Game, compiler_says
from hj_cosim.testing.expectations import ContractError, require

SLABS, NODES = 24, 16
OTHER_SLOPES = 12  # for which inputs are asked at each state: what they are is available there
# Of float32 in sums whose terms cancel, relative to the terms.
RELATIVE, ABSOLUTE = 3e-4, 1e-4
# What output arrays hold before a function writes to them; no value of any game.
_BEFORE = (np.float32(7.25e33), np.float32(-3.5e33))


class Slab(NamedTuple):
    """Nodes of a grid that differ along the game's slab axes alone, as the solver hands them over, with slopes."""

    points: np.ndarray  # (dimension, NODES) float32, the grid's coordinates
    slopes: np.ndarray  # (dimension, NODES) float32, of V along them


@dataclass(frozen=True)
class GameSamples:
    """A game within a box of its grid, with its parameters and limits."""

    game: Game
    parameters: Mapping[str, float]  # all of them
    lower: np.ndarray  # (dimension,)
    upper: np.ndarray

    @property
    def values(self) -> np.ndarray:
        """The parameters as the functions take them."""
        return self.game.parameter_values(self.parameters, self.game.name)

    @property
    def limits(self) -> np.ndarray:
        """The least and greatest state, (2, dimension) float32; ±inf along an axis that has none."""
        limited = np.array(self.game.limited)
        return np.array([np.where(limited, self.lower, -np.inf), np.where(limited, self.upper, np.inf)], np.float32)

    def slabs(self, seed: int = 0) -> Iterator[Slab]:
        """Yield SLABS slabs; about every fourth coordinate of a limited axis is at its limit."""
        draw = np.random.default_rng(seed)
        shape = (self.game.dimension, NODES)
        axes = np.isin(np.arange(self.game.dimension), self.game.slab_axes)[:, None]
        for _ in range(SLABS):
            points = draw.uniform(self.lower[:, None], self.upper[:, None], shape)
            at = draw.choice([0, 0, 0, 0, 0, 0, -1, 1], shape) * np.array(self.game.limited)[:, None]
            points = np.where(at < 0, self.lower[:, None], np.where(at > 0, self.upper[:, None], points))
            points = np.where(axes, points, points[:, :1])  # all nodes share the other coordinates
            yield Slab(points.astype(np.float32), self.some_slopes(draw))

    def some_slopes(self, draw: np.random.Generator) -> np.ndarray:
        """Return slopes of all sizes, (dimension, NODES) float32; one in ten is 0."""
        shape = (self.game.dimension, NODES)
        slopes = draw.normal(size=shape) * draw.choice([0.1, 1.0, 10.0], (1, NODES))
        return np.where(draw.random(shape) < 0.1, 0.0, slopes).astype(np.float32)

    def states_at(self, points: np.ndarray) -> np.ndarray:
        """Return the states at points of the grid, both (dimension, n) float32."""
        return np.ascontiguousarray(self.game.states_at(points.T, self.parameters).T, np.float32)

    def gradients_at(self, points: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return ∇V over the state of slopes along the grid, both (dimension, n) float32."""
        states = self.game.states_at(points.T.astype(np.float64), self.parameters)
        gradients = np.empty(states.shape)
        for axis, unit in enumerate(np.eye(self.game.dimension)):
            ahead, behind = (self.game.grid_points(states + way * unit, self.parameters) for way in (1.0, -1.0))
            gradients[:, axis] = (0.5 * (ahead - behind) * slopes.T).sum(axis=1)
        return np.ascontiguousarray(gradients.T, np.float32)

    def target(self, points: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Return V(0, ·), (n,), at points (dimension, n), with the game's parameters or `values`."""
        return self._called("target", (points, self.values if values is None else values), [points.shape[1:]])[0]

    def flow(self, states: np.ndarray, controls: np.ndarray, disturbances: np.ndarray) -> np.ndarray:
        """Return dx/dt, (dimension, n)."""
        return self._called("flow", (states, controls, disturbances, self.values), [states.shape])[0]

    def hamiltonian(self, points: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return H, (n,)."""
        return self._called("hamiltonian", (points, slopes, self.values, self.limits), [points.shape[1:]])[0]

    def dissipation(self, points: np.ndarray) -> np.ndarray:
        """Return the bounds on |∂H/∂p|, (dimension, n)."""
        return self._called("dissipation", (points, self.values), [points.shape])[0]

    def optimal_inputs(self, states: np.ndarray, gradients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the inputs that the game calls optimal: controls (controls, n), disturbances (disturbances, n)."""
        nodes = states.shape[1]
        shapes = [(len(self.game.controls), nodes), (len(self.game.disturbances), nodes)]
        u, d = self._called("optimal_inputs", (states, gradients, self.values, self.limits), shapes)
        return u, d

    def require_indices_within(self) -> None:
        """Check, as interpreted Python, that no function reaches beyond the arrays; compiled code would not notice.

        Raises:
            ContractError: if one does.
        """
        slab = next(self.slabs())
        points, slopes = (np.ascontiguousarray(array[:, :3]) for array in slab)
        u, d = (np.zeros((len(inputs), 3), np.float32) for inputs in (self.game.controls, self.game.disturbances))
        rows, row = np.zeros((self.game.dimension, 3), np.float32), np.zeros(3, np.float32)
        arguments = {
            "target": (points, self.values, row),
            "flow": (points, u, d, self.values, rows),
            "hamiltonian": (points, slopes, self.values, self.limits, row),
            "dissipation": (points, self.values, rows),
            "optimal_inputs": (points, slopes, self.values, self.limits, u, d),
        }
        for name in FUNCTIONS:
            function = getattr(self.game, name)
            try:
                with np.errstate(all="ignore"):
                    getattr(function, "py_func", function)(*arguments[name])
            except IndexError as error:
                raise ContractError(
                    f"{self.game.name}: {name} reaches beyond an array: {error}; the game has {self.game.dimension}"
                    f" state variables, {len(u)} controls, {len(d)} disturbances and {len(self.parameters)} parameters"
                ) from error
            except (ArithmeticError, ValueError):
                pass  # compiled, it answers inf or NaN where the interpreter refuses; that is looked at later
            except Exception as error:  # whatever a stranger's code raises
                raise self._raised(name, error) from error

    def at(self, states: np.ndarray, which: int, what: str = "") -> str:
        """Return where a sentence speaks of, of states (dimension, n)."""
        named = zip(self.game.state, states[:, which], strict=True)
        return "at " + ", ".join(f"{name} = {value:.6g}" for name, value in named) + what

    def _raised(self, name: str, error: Exception) -> ContractError:
        if isinstance(error, NumbaError):
            return ContractError(f"{self.game.name}: {name} does not compile: {compiler_says(error)}")
        said = str(error).splitlines()
        what = f"{type(error).__name__}: {said[0]}" if said else type(error).__name__
        return ContractError(f"{self.game.name}: {name} raised {what}")

    def _called(
        self, name: str, given: Sequence[np.ndarray], shapes: Sequence[tuple[int, ...]]
    ) -> tuple[np.ndarray, ...]:
        """Return what one of the game's functions writes, called twice.

        Raises:
            ContractError: if it raises, writes to what it is given, leaves something unwritten, says another thing the
                second time, or something that is not finite though what it was given is.
        """
        before = [array.copy() for array in given]
        answers = []
        for filling in _BEFORE:
            out = tuple(np.full(shape, filling, np.float32) for shape in shapes)
            try:
                getattr(self.game, name)(*given, *out)
            except Exception as error:  # whatever a stranger's code raises
                said = next((line for line in reversed(str(error).strip().splitlines()) if line.strip()), "")
                raise ContractError(
                    f"{self.game.name}: {name} raised {type(error).__name__}: {said.strip()}"
                ) from error
            answers.append(out)
        same = all(np.array_equal(now, kept, equal_nan=True) for now, kept in zip(given, before, strict=True))
        require(same, f"{self.game.name}: {name} wrote to what it was given; only the last arrays are to be written to")
        clean = all(np.isfinite(array).all() for array in given if array is not given[-1])
        for first, second in zip(*answers, strict=True):
            unwritten = (first == _BEFORE[0]) & (second == _BEFORE[1])
            if unwritten.any():
                row = f"row {np.argwhere(unwritten)[0][0]} of " if first.ndim > 1 else ""
                raise ContractError(f"{self.game.name}: {name} leaves {row}its output unwritten")
            repeatable = np.array_equal(first, second, equal_nan=True)
            require(repeatable, f"{self.game.name}: {name} answers the same states differently the second time")
            if clean and not np.isfinite(first).all():
                node = int(np.argwhere(~np.isfinite(first))[0][-1])
                raise ContractError(f"{self.game.name}: {name} is not finite {self.at(given[0], node)}")
        return answers[0]


def alike(one: np.ndarray | float, other: np.ndarray | float, terms: np.ndarray | float = 0.0) -> np.ndarray:
    """Return whether numbers are the same within what float32 sums of such terms leave."""
    scale = np.maximum(np.maximum(np.abs(one), np.abs(other)), terms)
    return np.asarray(np.abs(one - other) <= ABSOLUTE + RELATIVE * scale)


def listed(numbers: np.ndarray) -> str:
    """Return numbers as a sentence has them."""
    return f"({', '.join(f'{number:.4g}' for number in numbers)})"


def where(holds: np.ndarray) -> list[int]:
    """Return the indices at which something holds."""
    return [int(index) for index in np.flatnonzero(holds)]
