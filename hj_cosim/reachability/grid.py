"""Regular grids: the nodes on which a value function lives."""

import math
from dataclasses import dataclass

import numpy as np

from hj_cosim.settings import Boundary, GridSettings


@dataclass(frozen=True)
class Grid:
    """Nodes of a box, evenly spaced along every axis; the upper end of a periodic axis is its first node again."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    shape: tuple[int, ...]
    boundary: tuple[Boundary, ...]

    @staticmethod
    def from_settings(settings: GridSettings, default_boundary: tuple[Boundary, ...]) -> "Grid":
        """Return the grid of a specification, with the dynamics' boundaries where it names none."""
        return Grid(settings.lower, settings.upper, settings.shape, settings.boundary or default_boundary)

    @property
    def dimension(self) -> int:
        """Number of axes, n."""
        return len(self.shape)

    @property
    def cells(self) -> int:
        """Number of nodes in all."""
        return math.prod(self.shape)

    @property
    def spacing(self) -> np.ndarray:
        """(n,) distance between neighbouring nodes, in the state's units."""
        intervals = [n if b == "periodic" else n - 1 for n, b in zip(self.shape, self.boundary, strict=True)]
        extent: np.ndarray = np.array(self.upper) - np.array(self.lower)
        return np.asarray(extent / np.array(intervals))

    @property
    def axes(self) -> tuple[np.ndarray, ...]:
        """The nodes' coordinates along each axis, one float64 array an axis."""
        return tuple(
            np.linspace(low, high, nodes, endpoint=boundary != "periodic")
            for low, high, nodes, boundary in zip(self.lower, self.upper, self.shape, self.boundary, strict=True)
        )

    def mirrors_itself(self, axis: int) -> bool:
        """Whether negating the coordinate of `axis` maps nodes to nodes."""
        if self.boundary[axis] == "periodic":
            period = self.upper[axis] - self.lower[axis]
            shift = 2.0 * self.lower[axis] / period
            return math.isclose(shift, round(shift), abs_tol=1e-9)
        return math.isclose(self.lower[axis], -self.upper[axis], rel_tol=1e-9)

    def refined(self, factor: float) -> "Grid":
        """Return the grid with `factor` times as many intervals per axis, an odd number of nodes kept odd."""
        return Grid(
            self.lower,
            self.upper,
            tuple(_refined_count(n, factor, b == "periodic") for n, b in zip(self.shape, self.boundary, strict=True)),
            self.boundary,
        )


def _refined_count(nodes: int, factor: float, periodic: bool) -> int:
    if periodic:
        return round(nodes * factor)
    refined = round((nodes - 1) * factor) + 1
    # A node on the middle of the box (a kink of |p_x| lies there) stays one.
    return refined + 1 if nodes % 2 == 1 and refined % 2 == 0 else refined
