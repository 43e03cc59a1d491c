"""The same games in hj_reachability (StanfordASL, JAX), for the fixtures and the benchmark; needs the extra `peers`."""

from collections.abc import Callable

import hj_reachability as hj
import jax.numpy as jnp
import numpy as np

from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.grid import Grid
from hj_cosim.settings import TableSpecification


class PeerHighway(hj.dynamics.Dynamics):
    """The highway game with inputs that no limit of the state restricts."""

    def __init__(self, parameters: dict[str, float]) -> None:
        self.p = parameters
        super().__init__("max", "min", None, None)

    def __call__(self, state, control, disturbance, time):
        _, _, theta, v_r, v_o = state
        return jnp.array(
            [
                v_r * jnp.cos(theta) - v_o * jnp.cos(disturbance[0]),
                v_r * jnp.sin(theta) - v_o * jnp.sin(disturbance[0]),
                control[0],
                control[1],
                disturbance[1],
            ]
        )

    def optimal_control_and_disturbance(self, state, time, grad_value):
        p = self.p
        omega = jnp.where(grad_value[2] > 0, p["omega_max"], -p["omega_max"])
        a_r = jnp.where(grad_value[3] > 0, p["acceleration_max"], p["acceleration_min"])
        bound = p["other_heading_max"]
        theta_o = jnp.clip(jnp.arctan2(grad_value[1], grad_value[0]), -bound, bound)
        a_o = jnp.where(grad_value[4] > 0, p["other_acceleration_min"], p["other_acceleration_max"])
        return jnp.array([omega, a_r]), jnp.array([theta_o, a_o])

    def partial_max_magnitudes(self, state, time, value, grad_value_box):
        p = self.p
        _, _, theta, v_r, v_o = state
        along, across = v_r * jnp.cos(theta), v_r * jnp.sin(theta)
        bound = p["other_heading_max"]
        return jnp.array(
            [
                jnp.maximum(jnp.abs(along - v_o), jnp.abs(along - v_o * jnp.cos(bound))),
                jnp.abs(across) + v_o * jnp.sin(bound),
                p["omega_max"],
                max(-p["acceleration_min"], p["acceleration_max"]),
                max(-p["other_acceleration_min"], p["other_acceleration_max"]),
            ]
        )


def peer_solver(specification: TableSpecification) -> Callable[[float], np.ndarray]:
    """Return a function from a horizon (s) to the peer's solution, in the peer's formulation (see `peer_cases`)."""
    dynamics = find_game(specification.dynamics)
    ours = Grid.from_settings(specification.grid, dynamics.boundary)
    periodic = tuple(axis for axis, boundary in enumerate(ours.boundary) if boundary == "periodic")
    grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(
        hj.sets.Box(jnp.array(ours.lower), jnp.array(ours.upper)), ours.shape, periodic_dims=periodic or None
    )
    states = np.stack(np.meshgrid(*ours.axes, indexing="ij"), -1).reshape(-1, ours.dimension)
    target = dynamics.target_values(states, dynamics.parameter_values(specification.parameters, "peer"))
    accuracy = {"first_order": "low", "eno2": "medium", "weno3": "high", "weno5": "very_high"}[specification.scheme]
    settings = hj.SolverSettings.with_accuracy(
        accuracy, hamiltonian_postprocessor=hj.solver.backwards_reachable_tube, CFL_number=specification.cfl
    )
    parameters = {**dynamics.parameters, **specification.parameters}
    peer_dynamics = hj.systems.Air3d() if dynamics.name == "air3d" else PeerHighway(parameters)
    initial = jnp.array(target.reshape(ours.shape))

    def solve(horizon: float) -> np.ndarray:
        solved = hj.step(settings, peer_dynamics, grid, 0.0, initial, -horizon, progress_bar=False)
        return np.asarray(solved.block_until_ready())

    return solve


def solve_with_peer(specification: TableSpecification) -> np.ndarray:
    """Return the peer's solution of a specification."""
    return peer_solver(specification)(specification.horizon)
