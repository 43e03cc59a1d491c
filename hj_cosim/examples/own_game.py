"""A game of one's own: a boat keeps off a rock in a current; solved, and compared with what is known in closed form."""

from pathlib import Path

import numpy as np

from hj_cosim import solve_table
from hj_cosim.reachability.games.contract import Game, state_function

# c: the game's parameters in their order. The boat makes `speed` along each axis, the current up to `current`.
SPEED, CURRENT, HALF_WIDTH = 0, 1, 2


@state_function
def target(x, c, out):
    """V(0, x), m: how far outside a square rock; safe where it is positive."""
    for i in range(out.shape[0]):
        out[i] = max(abs(x[0, i]), abs(x[1, i])) - c[HALF_WIDTH]


@state_function
def flow(x, u, d, c, out):
    """dx/dt = u + d, m/s."""
    for i in range(out.shape[1]):
        out[0, i] = u[0, i] + d[0, i]
        out[1, i] = u[1, i] + d[1, i]


@state_function
def hamiltonian(x, p, c, limits, out):
    """max_u min_d p·(u + d): the boat steers up the slope of V, the current pushes down it."""
    for i in range(out.shape[0]):
        out[i] = (c[SPEED] - c[CURRENT]) * (abs(p[0, i]) + abs(p[1, i]))


@state_function
def dissipation(x, c, out):
    """Bounds on |∂H/∂p_i|."""
    for i in range(out.shape[1]):
        out[0, i] = abs(c[SPEED] - c[CURRENT])
        out[1, i] = abs(c[SPEED] - c[CURRENT])


@state_function
def optimal_inputs(x, p, c, limits, u, d):
    """The inputs that attain the Hamiltonian."""
    for i in range(u.shape[1]):
        for axis in range(2):
            sign = 1.0 if p[axis, i] > 0.0 else -1.0
            u[axis, i] = sign * c[SPEED]
            d[axis, i] = -sign * c[CURRENT]


game = Game(
    name="boat",
    state=("x", "y"),
    controls=("u_x", "u_y"),
    disturbances=("d_x", "d_y"),
    parameters={"speed": 1.0, "current": 1.5, "half_width": 0.5},
    target=target,
    flow=flow,
    hamiltonian=hamiltonian,
    dissipation=dissipation,
    optimal_inputs=optimal_inputs,
    boundary=("linear", "linear"),
    outside=("safe", "safe"),
    limited=(False, False),
    slab_axes=(0, 1),
)

SPECIFICATION = """\
dynamics = "{file}"
horizon = 1.0
scheme = "weno3"

[grid]
lower = [-3.0, -3.0]
upper = [3.0, 3.0]
shape = [121, 121]
"""


def main(out: Path = Path("boat")) -> float:
    """Solve the game, and return the largest error of V beside the rock, m."""
    out.mkdir(exist_ok=True)
    specification = out / "boat.toml"
    specification.write_text(SPECIFICATION.format(file=Path(__file__).resolve().as_posix()))
    table = solve_table(str(specification))

    x = np.linspace(1.2, 2.4, 13)
    states = np.column_stack([x, 0.3 * x])
    known = x - 0.5 - (1.5 - 1.0) * 1.0  # in one second the current wins half a metre
    value = table.value(states)
    for place, ours, exact in zip(x, value, known, strict=True):
        print(f"x = {place:.1f} m: V = {ours:6.3f} m, in closed form {exact:6.3f} m")
    return float(np.abs(value - known).max())


if __name__ == "__main__":
    print(f"largest error {main():.4f} m")
