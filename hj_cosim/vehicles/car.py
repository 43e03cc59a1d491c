"""The body of a background car, where nothing else says how long and wide it is, and larger ones in its terms."""

from hj_cosim.kernels import kernel
from hj_cosim.settings.scenario import CAR_LENGTH, CAR_WIDTH

__all__ = ["CAR_LENGTH", "CAR_WIDTH", "to_nearest_part"]


@kernel
def to_nearest_part(offset: float, size: float, usual: float) -> float:
    """Return the offset to the nearest place at which a car fits into a larger body.

    A body that is larger than a car's covers every place of a car within it; the nearest of them is what keeps the
    least distance. Of a body that is not larger, it is the centre.

    Args:
        offset: from the body's centre, m, along its length or its width.
        size: of the body in that direction, m.
        usual: of a car, m.
    """
    spare = max(0.5 * (size - usual), 0.0)
    return offset - min(max(offset, -spare), spare)
