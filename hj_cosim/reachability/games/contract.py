"""What a differential game is made of, and where the games live.

A game is a `Dynamics`: five small jitted functions and a few facts. Each function works on n states at once, `x` of
shape (dimension, n), because the solver calls it once per slab of the grid, so that the call costs nothing and the
loop inside runs in SIMD. All nodes of a slab share their coordinates but those along the game's two `slab_axes`: in
the Hamiltonian and the dissipation, which only the solver calls, whatever depends on the others may be computed once,
from `x[:, 0]`. Everything is float32.

    target(x, c, out)                              V(0, x): out (n,)
    flow(x, u, d, c, out)                          dx/dt: u (controls, n), d (disturbances, n), out (dimension, n)
    hamiltonian(x, p, c, limits, out)              max_u min_d p·f, p (dimension, n): out (n,)
    dissipation(x, c, out)                         bounds on |∂H/∂p_i|: out (dimension, n)
    optimal_inputs(x, p, c, limits, u, d)          the inputs that attain the Hamiltonian, into u and d

`c` holds the parameters in the order in which the dynamics declares them, `limits` the least and greatest state,
shape (2, dimension): at a limit an input that would cross it is not available; ±inf means no limit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import cfunc, njit, types
from numba.core.errors import NumbaError

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import Boundary

Outside = Literal["safe", "clamp"]
StateFunction = Callable[..., None]

VECTOR = types.Array(types.float32, 1, "C")
MATRIX = types.Array(types.float32, 2, "C")
TARGET = types.void(MATRIX, VECTOR, VECTOR)
HAMILTONIAN = types.void(MATRIX, MATRIX, VECTOR, MATRIX, VECTOR)
DISSIPATION = types.void(MATRIX, VECTOR, MATRIX)

# What the compiler may do with floating point: fuse and approximate divisions, but never assume that there are no
# NaNs. With that assumption min(0, NaN) is 0, and a solve that went wrong returns V0 and looks plausible.
FLOATING_POINT = {"contract", "arcp", "nsz"}


@dataclass(frozen=True)
class Dynamics:
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
    fingerprint: str = ""  # of the source, so that a table knows when its dynamics changed

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return len(self.state)

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

    def hamiltonian_values(
        self, states: np.ndarray, gradients: np.ndarray, parameters: np.ndarray, limits: np.ndarray
    ) -> np.ndarray:
        """Return H, (n,), at any `states` (n, dimension) with `gradients` (n, dimension)."""
        out = np.empty(len(states), np.float32)
        for row in range(len(states)):  # one state is a slab of its own: see the module's docstring
            here = slice(row, row + 1)
            self.hamiltonian(_columns(states[here]), _columns(gradients[here]), parameters, limits, out[here])
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


def _columns(rows: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.asarray(rows, np.float32).T)


def state_function(function: StateFunction) -> StateFunction:
    """Compile a function over many states; the decorator of a dynamics' five functions.

    The solver makes a C function of the same source (see `pointer`), so that one compiled kernel serves all games.
    """
    return njit(cache=True, fastmath=FLOATING_POINT, error_model="numpy")(function)


def pointer(function: StateFunction, signature: Any) -> Any:
    """Return such a function as a C function that the kernel can be given.

    Raises:
        ConfigurationError: if it does not compile for this signature.
    """
    source = getattr(function, "py_func", function)
    try:
        return cfunc(signature, cache=True, fastmath=FLOATING_POINT, error_model="numpy")(source)
    except NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        raise ConfigurationError(
            f"{source.__code__.co_filename}: {source.__name__} does not compile: {reason}"
        ) from error
