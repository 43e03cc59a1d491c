"""A highway specification made out for a robot and the cars that it meets."""

import math

from hj_cosim.reachability.games.contract import SizeClass
from hj_cosim.reachability.games.highway.parameters import PARAMETERS
from hj_cosim.settings import GridSettings, RobotSettings, TableSpecification

_FEWEST_NODES = 7  # of an axis


def of_pair(specification: TableSpecification, robot: RobotSettings, other: SizeClass) -> TableSpecification:
    """Return the specification for a robot's body and limits, and other cars of a size.

    What is the pair's already stays as it is written, so that the robot that a specification was written for has the
    table that it names. For larger bodies the grid is longer and wider, for weaker brakes longer by what they cost over
    the horizon; it ends at the robot's top speed. Its spacing stays, or gets a little finer.

    Args:
        specification: of the highway game.
        robot: whose table it is to be.
        other: the largest other car that it is to be right for.

    Raises:
        ValidationError: if the grid would have too many nodes.
    """
    written = {**PARAMETERS, **specification.parameters}
    pair = {
        "omega_max": robot.omega_max,
        "acceleration_min": robot.acceleration_min,
        "acceleration_max": robot.acceleration_max,
        "length": 0.5 * (robot.length + other.length),
        "width": 0.5 * (robot.width + other.width),
        "lateral_acceleration_max": robot.lateral_acceleration_max,
        "turned_length": robot.length if written["turned_length"] > 0.0 else 0.0,
    }
    changes = {name: value for name, value in pair.items() if value != written[name]}
    weaker = max(pair["acceleration_min"] - written["acceleration_min"], 0.0)
    along = max(pair["length"] - written["length"], 0.0) + 0.5 * weaker * specification.horizon**2
    across = max(pair["width"] - written["width"], 0.0)
    grid = specification.grid
    grid = _with_ends(grid, 0, grid.lower[0] - along, grid.upper[0] + along)
    grid = _with_ends(grid, 1, grid.lower[1] - across, grid.upper[1] + across)
    grid = _with_ends(grid, 3, grid.lower[3], robot.speed_max)
    return specification.model_copy(update={"grid": grid, "parameters": {**specification.parameters, **changes}})


def _with_ends(grid: GridSettings, axis: int, low: float, high: float) -> GridSettings:
    """Return the grid with other ends of an axis, as many nodes as its spacing needs, an odd number kept odd."""
    if (low, high) == (grid.lower[axis], grid.upper[axis]):
        return grid
    intervals = grid.shape[axis] - 1
    spacing = (grid.upper[axis] - grid.lower[axis]) / intervals
    nodes = max(math.ceil((high - low) / spacing - 1e-9) + 1, _FEWEST_NODES)
    nodes += grid.shape[axis] % 2 == 1 and nodes % 2 == 0
    replaced = {"lower": low, "upper": high, "shape": nodes}
    changes = {
        name: tuple(value if k == axis else old for k, old in enumerate(getattr(grid, name)))
        for name, value in replaced.items()
    }
    return GridSettings.model_validate(grid.model_dump() | changes)
