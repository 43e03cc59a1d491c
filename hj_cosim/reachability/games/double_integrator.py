"""A point that brakes before a wall: the game whose tube is known in closed form.

x = (position, velocity), dx = (velocity, u), |u| <= acceleration; unsafe within `half_width` of the origin:
V(0, x) = |position| − half_width. There is no disturbance.
"""

from hj_cosim.reachability.games.contract import Game, state_function


@state_function
def target(x, c, out):  # type: ignore[no-untyped-def]
    """V(0, x) = |position| − half_width."""
    for i in range(out.shape[0]):
        out[i] = abs(x[0, i]) - c[1]


@state_function
def flow(x, u, d, c, out):  # type: ignore[no-untyped-def]
    """dx/dt = (velocity, u)."""
    for i in range(out.shape[1]):
        out[0, i] = x[1, i]
        out[1, i] = u[0, i]


@state_function
def hamiltonian(x, p, c, limits, out):  # type: ignore[no-untyped-def]
    """p₁ velocity + acceleration |p₂|."""
    for i in range(out.shape[0]):
        push = c[0] if (p[1, i] > 0.0 and x[1, i] < limits[1, 1]) or (p[1, i] < 0.0 and x[1, i] > limits[0, 1]) else 0.0
        out[i] = p[0, i] * x[1, i] + push * abs(p[1, i])


@state_function
def dissipation(x, c, out):  # type: ignore[no-untyped-def]
    """|velocity| and the acceleration."""
    for i in range(out.shape[1]):
        out[0, i] = abs(x[1, i])
        out[1, i] = c[0]


@state_function
def optimal_inputs(x, p, c, limits, u, d):  # type: ignore[no-untyped-def]
    """Full acceleration up the slope."""
    for i in range(u.shape[1]):
        u[0, i] = 0.0
        if p[1, i] > 0.0 and x[1, i] < limits[1, 1]:
            u[0, i] = c[0]
        if p[1, i] < 0.0 and x[1, i] > limits[0, 1]:
            u[0, i] = -c[0]


game = Game(
    name="double_integrator",
    state=("position", "velocity"),
    controls=("u",),
    disturbances=(),
    parameters={"acceleration": 1.0, "half_width": 0.5},
    target=target,
    flow=flow,
    hamiltonian=hamiltonian,
    dissipation=dissipation,
    optimal_inputs=optimal_inputs,
    boundary=("linear", "linear"),
    outside=("safe", "clamp"),
    limited=(False, True),
    slab_axes=(1, 0),
)
