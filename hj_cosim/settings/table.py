"""What a value table is solved from."""

import math
from typing import Literal

from pydantic import Field, model_validator

from hj_cosim.settings.base import Number, Seconds, Settings

Scheme = Literal["first_order", "eno2", "weno3", "weno5"]
Boundary = Literal["linear", "away_from_zero", "periodic"]


class GridSettings(Settings):
    """A regular grid: one entry an axis, in the order of the state."""

    lower: tuple[float, ...] = Field(description="the first node, in the units of the state")
    upper: tuple[float, ...] = Field(description="the last node; of a periodic axis, where it repeats")
    shape: tuple[int, ...] = Field(description="nodes an axis, 7 or more, 200 million in all at most")
    boundary: tuple[Boundary, ...] | None = Field(None, description="what lies beyond; the dynamics' own unless given")

    @model_validator(mode="after")
    def _is_a_grid(self) -> "GridSettings":
        counts = {len(self.lower), len(self.upper), len(self.shape), len(self.boundary or self.shape)}
        if len(counts) > 1:
            raise ValueError("lower, upper, shape and boundary must have one entry per axis each")
        for axis, (low, high, nodes) in enumerate(zip(self.lower, self.upper, self.shape, strict=True)):
            if low >= high:
                raise ValueError(f"lower ({low}) must be below upper ({high}) on axis {axis}")
            if nodes < 7:
                raise ValueError(f"shape ({nodes}) must be 7 or more on axis {axis}, as wide as the widest stencil")
        if math.prod(self.shape) > 200_000_000:
            raise ValueError(f"shape has {math.prod(self.shape)} nodes; 200 million is the most")
        return self


class TableSpecification(Settings):
    """What a value table is solved from; a TOML file in value_tables/."""

    description: str = Field("", description="one line, for the list of tables")
    dynamics: str = Field(description="highway, air3d, double_integrator, or a Python file beside the specification")
    grid: GridSettings = Field(description="the nodes")
    horizon: Seconds = Field(3.0, gt=0, le=60, description="how far the game looks ahead")
    scheme: Scheme = Field("weno5", description="spatial derivatives")
    runge_kutta: Literal[1, 2, 3] | None = Field(None, description="order in time; the scheme's own unless given")
    cfl: Number = Field(0.75, gt=0, le=1, description="time step in units of the largest stable one")
    clamp: bool = Field(True, description="keep values within [min V0, V0], as the exact solution does")
    state_limits: bool = Field(True, description="an input that would leave the grid is not available")
    margin: Number = Field(
        0.0, ge=0, description="in units of V, subtracted from what is solved, to err on the safe side"
    )
    capped_by_manoeuvres: bool = Field(
        False, description="highway game: no value is above what the best of some manoeuvres guarantees"
    )
    parameters: dict[str, float] = Field(default_factory=dict, description="of the dynamics, over their defaults")
