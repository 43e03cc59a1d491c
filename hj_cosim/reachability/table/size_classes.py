"""The other cars by size: a table is solved for the largest body of a class."""

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.contract import SizeClass

# The other cars, by the size that a table has to be right for; smaller ones count as cars.
SIZE_CLASSES = (SizeClass("car", 5.0, 2.0), SizeClass("van or truck", 12.0, 2.5), SizeClass("long truck", 18.0, 2.5))
CAR = SIZE_CLASSES[0]


def size_class(length: float, width: float) -> SizeClass:
    """Return the smallest size class that a car's body fits into.

    Args:
        length, width: m.

    Raises:
        ConfigurationError: if it fits into none.
    """
    for size in SIZE_CLASSES:
        if length <= size.length and width <= size.width:
            return size
    largest = SIZE_CLASSES[-1]
    raise ConfigurationError(
        f"a car of {length:g} m x {width:g} m is larger than every table is for; {largest.length:g} m x"
        f" {largest.width:g} m is the most"
    )
