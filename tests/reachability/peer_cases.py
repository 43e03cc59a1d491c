"""The problems on which the solver is compared with hj_reachability, in that solver's formulation."""

import numpy as np

from hj_cosim.settings import GridSettings, Scheme, TableSpecification


def air3d() -> TableSpecification:
    """Mitchell's two aircraft on the grid of the peer's own example."""
    return TableSpecification(
        dynamics="air3d",
        grid=GridSettings(
            lower=(-6.0, -10.0, 0.0),
            upper=(20.0, 10.0, 2.0 * np.pi),
            shape=(51, 40, 50),
            boundary=("away_from_zero", "away_from_zero", "periodic"),
        ),
        horizon=2.8,
        scheme="weno5",
        clamp=False,
        state_limits=False,
    )


def highway(scheme: Scheme, shape: tuple[int, ...] = (31, 17, 9, 9, 9)) -> TableSpecification:
    """The paper's game: extrapolation away from zero, inputs that no limit of the state restricts, no clamp."""
    return TableSpecification(
        dynamics="highway",
        grid=GridSettings(
            lower=(-100.0, -8.0, -0.4, 10.0, 10.0),
            upper=(100.0, 8.0, 0.4, 35.0, 35.0),
            shape=shape,
            boundary=("away_from_zero",) * 5,
        ),
        horizon=3.0,
        scheme=scheme,
        clamp=False,
        state_limits=False,
    )


def sampled_nodes(shape: tuple[int, ...], count: int) -> np.ndarray:
    """Return flat indices of nodes at least two away from every face, the same ones each time."""
    inside = np.zeros(shape, bool)
    inside[tuple(slice(2, -2) for _ in shape)] = True
    return np.sort(np.random.default_rng(0).choice(np.flatnonzero(inside), count, replace=False))
