"""What a differential game is made of.

A game is one `Game`: a few facts, five small jitted functions, and what it can do beyond being solved. Each of the five
works on n states at once, `x` of shape (dimension, n), because the solver calls it once per slab of the grid, so that
the call costs nothing and the loop inside runs in SIMD. All nodes of a slab share their coordinates but those along the
game's two `slab_axes`: in the Hamiltonian and the dissipation, which only the solver calls, whatever depends on the
others may be computed once, from `x[:, 0]`. Everything is float32.

    target(x, c, out)                              V(0, x): out (n,)
    flow(x, u, d, c, out)                          dx/dt: u (controls, n), d (disturbances, n), out (dimension, n)
    hamiltonian(x, p, c, limits, out)              max_u min_d p·f, p (dimension, n): out (n,)
    dissipation(x, c, out)                         bounds on |∂H/∂p_i|: out (dimension, n)
    optimal_inputs(x, p, c, limits, u, d)          the inputs that attain the Hamiltonian, into u and d

`c` holds the parameters in the order in which the game declares them, `limits` the least and greatest state,
shape (2, dimension): at a limit an input that would cross it is not available; ±inf means no limit.

A game whose state is `TWO_CARS` is one of the robot and one other car: planner and filter drive with it. For a filter
a game gives half-planes, coefficients · u + c >= 0, for which the flow has to be affine in the controls, and the worst
disturbance must not depend on them; so that V falls for no disturbance, whatever control lies within. They follow from
flow and optimal inputs; a game of two cars may have a closed form that is faster, `closed_rows`.

What else a game may have, and need not:

- `angles`, the state variables that are angles: who asks for a value at 90 rad is told so;
- `shear`, where its grid is not along its state;
- `target_formula`, V(0, ·) with slopes at one state: look-ups then interpolate what the game adds to it;
- `manoeuvres`, which judge states without a grid;
- `of_pair`, what of a specification is the robot's and the other car's.

`hj_cosim.testing.check_game` tries all of it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numba import cfunc, njit, types
from numba.core.errors import NumbaError

from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.reachability.grid import Grid
from hj_cosim.scene.observation import Cars
from hj_cosim.settings import Boundary, RobotSettings, TableSpecification

if TYPE_CHECKING:
    from hj_cosim.reachability.games.highway.target import TargetFormula

Outside = Literal["safe", "clamp"]
# The five that every game has.
FUNCTIONS = ("target", "flow", "hamiltonian", "dissipation", "optimal_inputs")
StateFunction = Callable[..., None]
# States (K, n) and gradients (K, n) to coefficients and c, (controls + 1, K).
HalfPlanes = Callable[[np.ndarray, np.ndarray], np.ndarray]
# Robot (4,), cars, V of all cars (J,), its gradients (J, 5) and a bound, to the cars with V up to it, (K,) int, and
# their rows (4, K): V, both coefficients, c.
RowsOfCars = Callable[[np.ndarray, Cars, np.ndarray, np.ndarray, float], tuple[np.ndarray, np.ndarray]]

# The state of a game of the robot and one other car: positions robot − other along and across the road, m, the robot's
# heading, rad, both speeds, m/s; its controls are the robot's turn rate, rad/s, and acceleration, m/s².
TWO_CARS = ("p_x", "p_y", "theta", "v_r", "v_o")

VECTOR = types.Array(types.float32, 1, "C")
MATRIX = types.Array(types.float32, 2, "C")
TARGET = types.void(MATRIX, VECTOR, VECTOR)
HAMILTONIAN = types.void(MATRIX, MATRIX, VECTOR, MATRIX, VECTOR)
DISSIPATION = types.void(MATRIX, VECTOR, MATRIX)

# What the compiler may do with floating point: fuse and approximate divisions, but never assume that there are no
# NaNs. With that assumption min(0, NaN) is 0, and a solve that went wrong returns V0 and looks plausible.
FLOATING_POINT = {"contract", "arcp", "nsz"}


@dataclass(frozen=True)
class BrakingShear:
    """A grid of two cars whose first axis is ξ = p_x − k (v_o² − v_r²) instead of p_x, m.

    The game's target, Hamiltonian and dissipation then take the grid's coordinates and the slopes along them, its flow
    and optimal inputs the state.
    """

    parameter: str  # of the game, whose value is k, s²/m

    def grid_points(self, states: np.ndarray, parameters: Mapping[str, float]) -> np.ndarray:
        """Return the grid's coordinates of `states`, (..., 5)."""
        return _moved(states, -parameters[self.parameter])

    def states_at(self, points: np.ndarray, parameters: Mapping[str, float]) -> np.ndarray:
        """Return the states at `points` of the grid, (..., 5)."""
        return _moved(points, parameters[self.parameter])


def _moved(points: np.ndarray, rate: float) -> np.ndarray:
    moved = np.array(points, np.float64)
    moved[..., 0] += rate * (moved[..., 4] ** 2 - moved[..., 3] ** 2)
    return moved


@dataclass(frozen=True)
class ManoeuvreBounds:
    """What a game's manoeuvres guarantee: lower bounds of V that need no grid."""

    of_game: Callable[[Mapping[str, float], Grid], Any]  # parameters and grid to a NamedTuple that kernels take
    lower_bounds: Callable[[Any, np.ndarray], np.ndarray]  # that and states (N, n) to bounds (N,)
    # Values at the nodes, grid and parameters to values that are nowhere above what a manoeuvre guarantees.
    capped: Callable[[np.ndarray, Grid, Mapping[str, float]], np.ndarray]


@dataclass(frozen=True)
class SizeClass:
    """Which other cars a table is for: those whose body is no larger than this."""

    name: str
    length: float  # m
    width: float


@dataclass(frozen=True)
class Game:
    """A pursuit-evasion game: controls maximise, disturbances minimise the value (paper, eq. HJI optimal control)."""

    name: str
    state: tuple[str, ...]
    controls: tuple[str, ...]
    disturbances: tuple[str, ...]
    parameters: Mapping[str, float]  # every parameter with its default
    target: StateFunction
    flow: StateFunction
    hamiltonian: StateFunction
    dissipation: StateFunction
    optimal_inputs: StateFunction
    boundary: tuple[Boundary, ...]  # what the solver assumes beyond the faces unless the specification says so
    outside: tuple[Outside, ...]  # what a look-up beyond the faces means: safe (V = +inf), or clamped to the face
    limited: tuple[bool, ...]  # axes on which inputs could leave the grid and are kept from it
    slab_axes: tuple[int, int]  # what the solver's slabs extend along, the longer axis best last
    mirrored_axes: tuple[int, ...] = ()  # V is unchanged when these coordinates are negated together
    angles: tuple[str, ...] = ()  # state variables in rad
    drawn_at: Mapping[str, float] = field(default_factory=dict)  # where pictures hold a state variable, not mid-grid
    shear: BrakingShear | None = None
    target_formula: "Callable[[Mapping[str, float]], TargetFormula] | None" = None
    # Of parameters, and of those of larger size classes where `of_pair` makes any; else from the flow.
    closed_rows: Callable[..., RowsOfCars] | None = None
    manoeuvres: ManoeuvreBounds | None = None
    of_pair: Callable[[TableSpecification, RobotSettings, SizeClass], TableSpecification] | None = None
    fingerprint: str = ""  # of the source, so that a table knows when its game changed

    def __post_init__(self) -> None:
        """Check what a game of one's own gets wrong first.

        Raises:
            ConfigurationError: if a fact has not an entry per state variable, or names one that there is not.
        """
        for fact in ("boundary", "outside", "limited"):
            if len(getattr(self, fact)) != self.dimension:
                raise ConfigurationError(
                    f"game {self.name}: {fact} has {len(getattr(self, fact))} entries; the state has {self.dimension}:"
                    f" {', '.join(self.state)}"
                )
            allowed: tuple[object, ...] = {
                "boundary": get_args(Boundary),
                "outside": get_args(Outside),
                "limited": (False, True),
            }[fact]
            for entry in getattr(self, fact):
                if entry not in allowed:
                    raise ConfigurationError(
                        f"game {self.name}: {fact} has the entry {entry!r}; choose {' or '.join(map(repr, allowed))}"
                    )
        for name in FUNCTIONS:
            if not callable(getattr(self, name)):
                raise ConfigurationError(f"game {self.name}: {name} is no function, but {getattr(self, name)!r}")
        for axis in self.mirrored_axes:
            if axis not in range(self.dimension):
                raise ConfigurationError(
                    f"game {self.name}: mirrored_axes has {axis!r}; its axes are 0 to {self.dimension - 1}"
                )
        for named in (*self.angles, *self.drawn_at):
            if named not in self.state:
                raise ConfigurationError(
                    f"game {self.name}: {named!r} is no state variable; {', '.join(self.state)} are"
                )
        if len(set(self.slab_axes) & set(range(self.dimension))) != 2:
            raise ConfigurationError(
                f"game {self.name}: slab_axes = {self.slab_axes} are not two of its {self.dimension} axes;"
                " a game has two state variables or more"
            )
        if self.shear is not None and (self.state != TWO_CARS or self.shear.parameter not in self.parameters):
            raise ConfigurationError(
                f"game {self.name}: shear needs the state {', '.join(TWO_CARS)} and a parameter {self.shear.parameter}"
            )

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return len(self.state)

    def require_two_cars(self) -> None:
        """Check that its state is that of the robot and one other car, which planning and filtering look up.

        Raises:
            TableError: if it is another.
        """
        if self.state != TWO_CARS:
            raise TableError(
                f"a table of {self.name} has the state {', '.join(self.state)};"
                f" planning and filtering need {', '.join(TWO_CARS)}"
            )

    def parameter_values(self, overrides: Mapping[str, float], source: str) -> np.ndarray:
        """Return the parameters as the functions take them, (len(parameters),) float32.

        Raises:
            ConfigurationError: if `overrides` names one that does not exist.
        """
        for key in overrides:
            if key not in self.parameters:
                raise ConfigurationError(
                    f"{source}: parameters.{key}: {self.name} has no such parameter;"
                    f" it has {', '.join(self.parameters)}"
                )
        return np.array([overrides.get(key, default) for key, default in self.parameters.items()], np.float32)

    def target_values(self, states: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Return V(0, ·), (n,), at `states` (n, dimension)."""
        out = np.empty(len(states), np.float32)
        self.target(_columns(states), parameters, out)
        return out

    def optimal(
        self, states: np.ndarray, gradients: np.ndarray, parameters: np.ndarray, limits: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the optimal controls (n, controls) and disturbances (n, disturbances)."""
        u = np.empty((len(self.controls), len(states)), np.float32)
        d = np.empty((len(self.disturbances), len(states)), np.float32)
        self.optimal_inputs(_columns(states), _columns(gradients), parameters, limits, u, d)
        return u.T, d.T

    def state_derivative(
        self, states: np.ndarray, controls: np.ndarray, disturbances: np.ndarray, parameters: np.ndarray
    ) -> np.ndarray:
        """Return dx/dt, (n, dimension)."""
        out = np.empty((self.dimension, len(states)), np.float32)
        self.flow(_columns(states), _columns(controls), _columns(disturbances), parameters, out)
        return out.T

    def half_planes(self, parameters: Mapping[str, float], limits: np.ndarray) -> HalfPlanes:
        """Return the function that makes half-planes for a filter of states and gradients, both (K, n).

        They come as (controls + 1, K), a row per control and c last: coefficients · u + c is dV/dt of a control u at
        the worst disturbance, min over d of ∇V·f(x, u, d).

        Args:
            parameters: all of them.
            limits: (2, n) as the functions take them.
        """
        values = self.parameter_values(parameters, self.name)

        def from_flow(states: np.ndarray, gradients: np.ndarray) -> np.ndarray:
            _, worst = self.optimal(states, gradients, values, limits)
            found = np.empty((len(self.controls) + 1, len(states)))
            idle = np.zeros((len(states), len(self.controls)))
            found[-1] = (gradients * self.state_derivative(states, idle, worst, values)).sum(axis=1)
            for which in range(len(self.controls)):
                unit = idle.copy()
                unit[:, which] = 1.0
                found[which] = (gradients * self.state_derivative(states, unit, worst, values)).sum(axis=1) - found[-1]
            return found

        return from_flow

    def grid_points(self, states: np.ndarray, parameters: Mapping[str, float]) -> np.ndarray:
        """Return the grid's coordinates of `states`, (..., n)."""
        return states if self.shear is None else self.shear.grid_points(states, parameters)

    def states_at(self, points: np.ndarray, parameters: Mapping[str, float]) -> np.ndarray:
        """Return the states at `points` of the grid, (..., n)."""
        return points if self.shear is None else self.shear.states_at(points, parameters)


Dynamics = Game  # what games of users' own have called it


def _columns(rows: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.asarray(rows, np.float32).T)


def state_function(function: StateFunction) -> StateFunction:
    """Compile a function over many states; the decorator of a game's five functions.

    The solver makes a C function of the same source (see `pointer`), so that one compiled kernel serves all games.
    """
    return njit(cache=True, fastmath=FLOATING_POINT, error_model="numpy")(function)


def pointer(function: StateFunction, signature: Any) -> Any:
    """Return such a function as a C function that the kernel can be given.

    Raises:
        ConfigurationError: if it does not compile for this signature, or takes more or fewer arguments.
    """
    source = getattr(function, "py_func", function)
    takes, needed = source.__code__.co_argcount, len(signature.args)
    if takes != needed:
        place = f"{source.__code__.co_filename}:{source.__code__.co_firstlineno}"
        raise ConfigurationError(f"{place}: {source.__name__} takes {takes} arguments; the solver gives it {needed}")
    try:
        return cfunc(signature, cache=True, fastmath=FLOATING_POINT, error_model="numpy")(source)
    except NumbaError as error:
        raise ConfigurationError(
            f"{source.__code__.co_filename}: {source.__name__} does not compile: {compiler_says(error)}"
        ) from error


def compiler_says(error: NumbaError) -> str:
    """Return the one of Numba's many lines that says what is wrong."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return next((line for line in lines if not line.startswith("Failed in ")), type(error).__name__)
