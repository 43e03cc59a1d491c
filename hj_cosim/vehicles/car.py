"""The body of a background car, where nothing else says how long and wide it is."""

CAR_LENGTH = 5.0  # m
CAR_WIDTH = 2.0  # m
