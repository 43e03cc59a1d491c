"""The other cars by size: a table is solved for the largest body of a class."""

from hj_cosim.reachability.games.contract import SizeClass

# The other cars, by the size that a table has to be right for; smaller ones count as cars.
SIZE_CLASSES = (SizeClass("car", 5.0, 2.0), SizeClass("van or truck", 12.0, 2.5), SizeClass("long truck", 18.0, 2.5))
CAR = SIZE_CLASSES[0]
