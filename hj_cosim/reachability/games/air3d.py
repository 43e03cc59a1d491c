"""Two aircraft at constant speed, collision avoidance (Mitchell, Bayen, Tomlin 2005, section IV).

x = (x, y, ψ), the pursuer's position and heading in the evader's frame; controls are turn rates:
dx = −v_e + v_p cos ψ + ω_e y,  dy = v_p sin ψ − ω_e x,  dψ = ω_p − ω_e;  V(0, x) = √(x² + y²) − radius.
"""

import math

import numpy as np

from hj_cosim.reachability.games.contract import Game, state_function


@state_function
def target(x, c, out):  # type: ignore[no-untyped-def]
    """V(0, x) = √(x² + y²) − radius."""
    for i in range(out.shape[0]):
        out[i] = math.sqrt(x[0, i] * x[0, i] + x[1, i] * x[1, i]) - c[4]


@state_function
def flow(x, u, d, c, out):  # type: ignore[no-untyped-def]
    """dx/dt for the evader's turn rate u and the pursuer's d."""
    for i in range(out.shape[1]):
        out[0, i] = -c[0] + c[1] * math.cos(x[2, i]) + u[0, i] * x[1, i]
        out[1, i] = c[1] * math.sin(x[2, i]) - u[0, i] * x[0, i]
        out[2, i] = d[0, i] - u[0, i]


@state_function
def hamiltonian(x, p, c, limits, out):  # type: ignore[no-untyped-def]
    """p·drift + ω̄_e |p_x y − p_y x − p_ψ| − ω̄_p |p_ψ|."""
    evader, pursuer, evader_turn, pursuer_turn = c[0], c[1], c[2], c[3]
    closing = np.float32(pursuer * math.cos(x[2, 0]) - evader)
    passing = np.float32(pursuer * math.sin(x[2, 0]))
    for i in range(out.shape[0]):
        turning = abs(p[0, i] * x[1, i] - p[1, i] * x[0, i] - p[2, i])
        out[i] = p[0, i] * closing + p[1, i] * passing + evader_turn * turning - pursuer_turn * abs(p[2, i])


@state_function
def dissipation(x, c, out):  # type: ignore[no-untyped-def]
    """|drift| plus the turn rates' leverage."""
    closing = np.float32(abs(c[1] * math.cos(x[2, 0]) - c[0]))
    passing = np.float32(abs(c[1] * math.sin(x[2, 0])))
    for i in range(out.shape[1]):
        out[0, i] = closing + c[2] * abs(x[1, i])
        out[1, i] = passing + c[2] * abs(x[0, i])
        out[2, i] = c[2] + c[3]


@state_function
def optimal_inputs(x, p, c, limits, u, d):  # type: ignore[no-untyped-def]
    """The evader turns up the slope, the pursuer down."""
    for i in range(u.shape[1]):
        u[0, i] = c[2] * np.sign(p[0, i] * x[1, i] - p[1, i] * x[0, i] - p[2, i])
        d[0, i] = -c[3] * np.sign(p[2, i])


game = Game(
    name="air3d",
    state=("x", "y", "psi"),
    controls=("omega_e",),
    disturbances=("omega_p",),
    parameters={
        "evader_speed": 5.0,
        "pursuer_speed": 5.0,
        "evader_turn_rate": 1.0,
        "pursuer_turn_rate": 1.0,
        "radius": 5.0,
    },
    target=target,
    flow=flow,
    hamiltonian=hamiltonian,
    dissipation=dissipation,
    optimal_inputs=optimal_inputs,
    boundary=("linear", "linear", "periodic"),
    outside=("safe", "safe", "clamp"),
    limited=(False, False, False),
    slab_axes=(1, 0),
    mirrored_axes=(1, 2),
    angles=("psi",),
)
